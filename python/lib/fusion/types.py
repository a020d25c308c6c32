"""Tables of designs and results, for type checkers and editors.

`DesignTable` has the keys of a design, as ``set`` takes them: a number is SI, a text has a unit. `Summary` has the keys of
`Result.summary`. Written by python/tables.py from the JSON Schemas of the program.
"""

from __future__ import annotations

from typing import Any, Literal, TypedDict, Union

Numbers = Union[list[float], list[Union[float, str]]]


class DesignTable(TypedDict, total=False):
    """The keys of a design."""

    filter: DesignTableFilter
    health: DesignTableHealth
    initial: dict[str, Initialiser]
    link: dict[str, Link]
    output: dict[str, Output]
    process: Process
    reference: DesignTableReference
    run: DesignTableRun
    sensor: dict[str, Sensor]
    simulation: DesignTableSimulation
    source: dict[str, Source]
    stage: dict[str, Stage]
    stress: DesignTableStress


class DesignTableFilter(TypedDict, total=False):
    """The backend: a preset, or its axes one by one."""

    backend: Literal['ekf', 'error_state', 'iekf', 'invariant', 'ukf']
    bank: FilterBankSpec
    biases: Literal['imperfect', 'two_frames']
    chart: Literal['additive_euler', 'additive_quaternion', 'body', 'left_invariant', 'navigation', 'right_invariant']
    form: Literal['joseph', 'square_root', 'standard', 'udu']
    iterations: int
    protect_calibrations: bool
    reset: Literal['full', 'plain']
    spread: FilterSpreadSpec
    tolerance: float
    update: Literal['iterated', 'outright', 'single', 'unscented']


class FilterBankSpec(TypedDict, total=False):
    """A bank of hypotheses."""

    headings: int
    hypotheses: int
    switch: float


class FilterSpreadSpec(TypedDict, total=False):
    """The scaled set of sigma points: α√(n + κ) σ from the estimate."""

    alpha: float
    beta: float
    kappa: float


class DesignTableHealth(TypedDict, total=False):
    """When the filter is no longer in good health."""

    aligned: float | str
    calibration: float | str
    coasting: float | str
    floor: HealthFloorSpec
    hold: float | str
    innovations: HealthInnovationsSpec
    jumped: float | str
    pulled: float | str
    reacquired: float | str
    rejected: HealthRejectedSpec
    silent: HealthSilentSpec
    unaided: float | str


class HealthFloorSpec(TypedDict, total=False):
    """A 1σ below it is a belief that nothing corrects any more."""

    attitude: float | str
    position: float | str
    velocity: float | str


class HealthInnovationsSpec(TypedDict, total=False):
    """Innovations of used measurements: their root mean square, in units of the σ that the filter expects of them."""

    degraded: float | str
    false_alarm: float | str
    lost: float | str
    window: float | str


class HealthRejectedSpec(TypedDict, total=False):
    """Rejections in a row of residuals that the σ of the estimate does not explain."""

    degraded: float | str
    lost: float | str


class HealthSilentSpec(TypedDict, total=False):
    """Pauses of a sensor that comes from a source."""

    at_least: float | str
    periods: float | str


class Initialiser(TypedDict, total=False):
    after: float | str
    attitude: Numbers
    attitude_sigma: Numbers | float | str
    declination: float | str
    duration: float | str
    enabled: bool
    gyro_bias_sigma: Numbers | float | str
    gyrocompass: InitialiserLevellingGyrocompassSpec
    heading: float | str
    heading_sigma: float | str
    height: float | str
    horizontal: bool
    lever_arm: Numbers
    max_age: float | str
    median_of: int
    min_distance: float | str
    min_speed: float | str
    mounting_yaw: float | str
    position: InitialiserExplicitPlace
    position_sigma: Numbers | float | str
    sigma: float | str
    source: str
    still: InitialiserLevellingStillSpec
    tilt_sigma: float | str
    type: Literal['baseline', 'compass', 'course', 'explicit', 'first_fix', 'levelling', 'levelling_in_motion']
    velocity: Numbers
    velocity_sigma: Numbers | float | str


class InitialiserLevellingGyrocompassSpec(TypedDict, total=False):
    """Gyrocompassing: rejected if its predicted error is too large."""

    accel_bias: float | str
    gyro_bias: float | str
    gyro_noise: float | str
    latitude: float | str
    max_sigma: float | str


class InitialiserExplicitPlace(TypedDict, total=False):
    """A geodetic place on or above the WGS-84 ellipsoid."""

    height: float | str
    latitude: float | str
    longitude: float | str


class InitialiserLevellingStillSpec(TypedDict, total=False):
    """Bounds of the stillness test."""

    accel_std: Numbers | float | str
    gyro_std: Numbers | float | str
    mean_rate: Numbers | float | str
    window: float | str


class Link(TypedDict, total=False):
    append_to: str
    baud: int
    clock: Literal['arrival', 'own', 'related']
    connect: str
    drift: float | str
    line_ends: bool
    listen: str
    most_waiting: int
    only_new: bool
    path: str
    port: str
    send_to: str
    sources: list[str]
    type: Literal['file', 'serial', 'stdio', 'tcp', 'udp']


class Output(TypedDict, total=False):
    component_id: int
    link: str
    listen: str
    message: (
        Literal['global_position_int', 'gps_input', 'odometry', 'vision_position_estimate']
        | list[Literal['global_position_int', 'gps_input', 'odometry', 'vision_position_estimate']]
    )
    rate: float | str
    sentences: list[Literal['GGA', 'GST', 'HDT', 'RMC', 'THS', 'VTG', 'ZDA']]
    system_id: int
    talker: str
    type: Literal['foxglove', 'json', 'mavlink', 'nmea']
    watchdog: float | str


class Process(TypedDict, total=False):
    """The process model: what moves the state."""

    acceleration_noise: Numbers | float | str
    accelerometer: ProcessStrapdownAccelerometerSpec
    accelerometer_bias: Numbers | Parameter
    accelerometer_noise: Numbers | float | str
    agility: ProcessAttitudeOnlyAgilitySpec
    attitude_noise: Numbers | float | str
    discretisation: Literal['exact', 'first_order', 'second_order']
    drift: Numbers | Parameter
    forward_noise: float | str
    gravity: float | str
    gyro: ProcessStrapdownGyroSpec
    gyro_bias: Numbers | Parameter
    gyro_noise: Numbers | float | str
    heading_noise: float | str
    heading_offset: Parameter2 | float | str
    heading_sigma: float | str
    initial_heading: float | str
    initial_position: Numbers
    initial_speed: float | str
    initial_velocity: Numbers
    input: ProcessInput
    integration: Literal['exact', 'literal']
    integrator: Literal['constant', 'first_order', 'one_sample', 'two_sample']
    latitude: float | str
    max_step: float | str
    position_noise: Numbers | float | str
    position_sigma: Numbers | float | str
    side_slip: Parameter2 | float | str
    sideways: bool
    sideways_noise: float | str
    source: str
    speed_noise: float | str
    speed_sigma: float | str
    type: (
        Literal['attitude_only', 'constant_velocity', 'dead_reckoning', 'hold', 'planar_odometry', 'strapdown', 'strapdown_external_attitude', 'strapdown_local', 'unicycle']
    )
    velocity_noise: Numbers | float | str
    velocity_sigma: Numbers | float | str
    velocity_time: float | str
    walk: Numbers | float | str
    yaw_rate_noise: float | str
    yaw_rate_sigma: float | str


class ProcessStrapdownAccelerometerSpec(TypedDict, total=False):
    """The accelerometers."""

    bias: Numbers | Parameter
    noise: Numbers | float | str
    scale: Numbers | Parameter
    vibration: float | str


class Parameter(TypedDict, total=False):
    """The table form of a parameter."""

    correlation_time: float | str
    estimate: bool
    initial: Numbers
    random_walk: Numbers | float | str
    shared: str
    sigma: Numbers | float | str


class ProcessAttitudeOnlyAgilitySpec(TypedDict, total=False):
    """How fast the vehicle can change its motion: a gap in the input adds this uncertainty."""

    acceleration: Numbers | float | str
    angular_rate: Numbers | float | str
    tilt: float | str
    time: float | str
    turning_radius: float | str


class ProcessStrapdownGyroSpec(TypedDict, total=False):
    """The gyros."""

    bias: Numbers | Parameter
    noise: Numbers | float | str
    scale: Numbers | Parameter
    scale_noise: float | str


class Parameter2(TypedDict, total=False):
    """The table form of a parameter."""

    correlation_time: float | str
    estimate: bool
    initial: float | str
    random_walk: Numbers | float | str
    shared: str
    sigma: float | str


class ProcessInput(TypedDict, total=False):
    """The limits of the samples that drive the process."""

    longest_gap: float | str
    longest_interval: float | str
    range: dict[str, Numbers | float | str]


DesignTableReference = TypedDict(
    "DesignTableReference",
    {
        "channels": "list[Literal['attitude', 'depth', 'height', 'horizontal_position', 'position', 'velocity']]",
        "converged": "ReferenceConvergedSpec",
        "episodes": "DesignTableReferenceEpisodes | list[DesignTableReferenceEpisodes]",
        "from": "float | str",
        "lever_arm": "Numbers",
        "nees_from": "float | str",
        "remove_mean_mounting": "bool",
        "sigma": "ReferenceSigmaSpec",
        "source": "dict[str, ReferenceReferencePart] | str",
        "surface": "float | str",
        "trajectory": "ReferenceTrajectorySpec",
        "velocity_from_position": "ReferenceDifferentiateSpec",
    }, total=False,
)


class ReferenceConvergedSpec(TypedDict, total=False):
    """Limits of the errors of a run that has converged, at least one."""

    by: float | str
    heading: float | str
    position: float | str
    velocity: float | str


DesignTableReferenceEpisodes = TypedDict(
    "DesignTableReferenceEpisodes",
    {
        "duration": "float | str",
        "every": "float | str",
        "from": "float | str",
        "to": "float | str",
        "until": "float | str",
    }, total=False,
)


class ReferenceSigmaSpec(TypedDict, total=False):
    """1σ of a reference's own errors."""

    attitude: Numbers | ReferenceSigmaSpecAttitude | float | str
    position: Numbers | ReferenceSigmaSpecAttitude | float | str
    velocity: Numbers | ReferenceSigmaSpecAttitude | float | str


class ReferenceSigmaSpecAttitude(TypedDict, total=False):
    """The table form."""

    from_source: bool
    scale: float | str


class ReferenceReferencePart(TypedDict, total=False):
    """The channels of a source that count, and their lever arm and accuracy."""

    channels: list[Literal['attitude', 'depth', 'height', 'horizontal_position', 'position', 'velocity']]
    lever_arm: Numbers
    sigma: ReferenceSigmaSpec
    surface: float | str
    velocity_from_position: ReferenceDifferentiateSpec


class ReferenceDifferentiateSpec(TypedDict, total=False):
    """The slope of a cubic fitted to neighbouring positions."""

    half_window: int
    max_span: float | str


class ReferenceTrajectorySpec(TypedDict, total=False):
    """How the trajectory as a whole is compared, as the tool evo does."""

    align: Literal['none', 'se3', 'yaw']
    distances: Numbers
    pairs: Literal['all', 'consecutive']


class DesignTableRun(TypedDict, total=False):
    """The settings of the whole run."""

    data_dir: str
    description: str
    longest_jump: float | str
    map_details: list[RunMapDetailSpec]
    order: Literal['hold', 'rewind']
    origin: InitialiserExplicitPlace
    output_rate: float | str
    reorder: float | str
    restart_after: float | str
    restart_lost: float | str
    rewind: RunRewindSpec
    seed: int
    smooth: RunSmoothSpec
    start: float | str
    stop: float | str


class RunMapDetailSpec(TypedDict, total=False):
    """A part of the map that a report shows enlarged."""

    centre: Numbers | float | str
    size: float | str
    title: str


class RunRewindSpec(TypedDict, total=False):
    """How far a filter goes back."""

    horizon: float | str
    spacing: float | str


class RunSmoothSpec(TypedDict, total=False):
    """Smoothing in addition to the estimates."""

    lag: float | str


class Sensor(TypedDict, total=False):
    attitude: Numbers | Parameter3
    attitude_walk: float | str
    axes: Literal['both', 'down', 'right']
    azimuths: Numbers
    beacons: list[InitialiserExplicitPlace]
    beam_angle: float | str
    bias: Numbers | Parameter | Parameter2 | float | str
    centre: Parameter2 | float | str
    clock_drift: Parameter2 | float | str
    clock_offset: Parameter2 | float | str
    current: Numbers | Parameter
    date: str
    declination: Parameter2 | float | str
    deviation: SensorHeadingDeviationSpec
    enabled: bool
    gate: Gate | Literal['none', 'two_condition']
    gauge: Parameter2 | float | str
    gravity: float | str
    hard_iron: Numbers | Parameter
    height: float | str
    horizontal: bool
    inclination: Parameter2 | float | str
    landmarks: list[InitialiserExplicitPlace | Numbers]
    latitude: float | str
    lever_arm: Numbers | Parameter
    longitude: float | str
    loss: Literal['cauchy', 'huber', 'quadratic', 'student_t'] | Loss
    measures: Literal['bearing_range', 'vector']
    mounting: Numbers | Parameter3 | Parameter4 | Parameter5 | Parameter6 | Parameter7 | Parameter8 | Parameter9
    noise: Numbers | SensorNoise | float | str
    only_with: SensorOnlyWith | str
    part: Literal['all', 'heading', 'navigation', 'tilt']
    position: InitialiserExplicitPlace
    position_walk: float | str
    quality: str
    range_sigma: Literal['fix_interval', 'horizontal_range', 'reported', 'slant_range']
    scale: Parameter2 | float | str
    sea_level_pressure: Parameter2 | float | str
    slip: Parameter2 | float | str
    soft_iron: list[Numbers]
    sound_speed: Parameter2 | float | str
    source: str
    strength: Parameter2 | float | str
    surface: Parameter2 | float | str
    switch: SensorSwitch
    time_offset: Parameter2 | float | str
    transceiver: Numbers | Parameter
    type: (
        Literal['attitude', 'barometer', 'body_velocity', 'depth', 'dvl', 'gnss_position', 'gnss_velocity', 'gravity_direction', 'heading', 'height', 'horizontal_position', 'horizontal_velocity', 'landmark', 'magnetometer', 'nonholonomic', 'odometer', 'pseudorange', 'pseudorange_rate', 'range', 'track_odometry', 'usbl', 'usbl_position', 'vessel_pose', 'yaw_rate', 'zero_angular_rate', 'zero_velocity']
    )
    vessel: str


class Parameter3(TypedDict, total=False):
    """The table form of a parameter."""

    correlation_time: float | str
    estimate: bool
    initial: Numbers
    random_walk: Numbers | float | str
    shared: str
    sigma: Numbers | float | str


class SensorHeadingDeviationSpec(TypedDict, total=False):
    """The error of a compass, in addition to its bias, as a function of the magnetic heading: the effect of the
    vehicle's own field."""

    cos: Parameter2 | float | str
    cos_2: Parameter2 | float | str
    sin: Parameter2 | float | str
    sin_2: Parameter2 | float | str


class Gate(TypedDict, total=False):
    """Accepts or rejects each measurement; without a gate, all are accepted."""

    ellipse: Literal['estimate', 'innovation', 'per_axis']
    false_ends: float | str
    false_rate: float | str
    height: bool
    lost: float | str
    magnitude: Literal['distance', 'quality', 'reported', 'step']
    max_quality: float | str
    max_reported: float | str
    max_speed: float | str
    min_distance: float | str
    probability: float | str
    reach: float | str
    recovery: GateNisRecoverySpec
    sigma: float | str
    speed: float | str
    type: Literal['hypotheses', 'nis', 'none', 'two_condition']
    vertical_sigma: float | str
    wander: float | str


class GateNisRecoverySpec(TypedDict, total=False):
    """When a gate counts its sensor as denied, and when it re-acquires it."""

    deny_after: int
    gap: float | str
    never_reacquire: bool
    reacquire_after: float | str
    resume_after: int


class Loss(TypedDict, total=False):
    """Weighs each measurement; without one, least squares."""

    c: float | str
    k: float | str
    nu: float | str
    type: Literal['cauchy', 'huber', 'quadratic', 'student_t']


class Parameter4(TypedDict, total=False):
    """The table form of a parameter."""

    correlation_time: float | str
    estimate: bool
    initial: Numbers
    random_walk: Numbers | float | str
    shared: str
    sigma: Numbers | float | str


class Parameter5(TypedDict, total=False):
    """The table form of a parameter."""

    correlation_time: float | str
    estimate: bool
    initial: Numbers
    random_walk: Numbers | float | str
    shared: str
    sigma: Numbers | float | str


class Parameter6(TypedDict, total=False):
    """The table form of a parameter."""

    correlation_time: float | str
    estimate: bool
    initial: Numbers
    random_walk: Numbers | float | str
    shared: str
    sigma: Numbers | float | str


class Parameter7(TypedDict, total=False):
    """The table form of a parameter."""

    correlation_time: float | str
    estimate: bool
    initial: Numbers
    random_walk: Numbers | float | str
    shared: str
    sigma: Numbers | float | str


class Parameter8(TypedDict, total=False):
    """The table form of a parameter."""

    correlation_time: float | str
    estimate: bool
    initial: Numbers
    random_walk: Numbers | float | str
    shared: str
    sigma: Numbers | float | str


class Parameter9(TypedDict, total=False):
    """The table form of a parameter."""

    correlation_time: float | str
    estimate: bool
    initial: Numbers
    random_walk: Numbers | float | str
    shared: str
    sigma: Numbers | float | str


class SensorNoise(TypedDict, total=False):
    from_source: bool
    scale: float | str
    sigma: Numbers | float | str


class SensorOnlyWith(TypedDict, total=False):
    memory: float | str
    sensor: str


class SensorSwitch(TypedDict, total=False):
    """Rows that switch the sensor while the filter runs; each holds until the next one."""

    noise: str
    source: str
    used: str


class DesignTableSimulation(TypedDict, total=False):
    """A simulated run: a trajectory or a controlled vehicle, an inertial measurement unit, and the errors of each
    sensor."""

    constellation: SimulationConstellationSpec
    control: Control
    draw_parameters: bool
    draw_start: bool
    imu: SimulationImuErrorSpec
    longest: float | str
    mission: list[Task]
    odometry: SimulationOdometryErrorSpec
    platform: dict[str, SimulationShipSpec]
    reference_rate: float | str
    sea: SimulationSeaSpec
    seed: int
    sensor: dict[str, SimulationSensorErrorSpec]
    ship: SimulationShipSpec
    start: SimulationStartSpec
    steered_by: str
    track_speeds: SimulationTrackSpeedsSpec
    trajectory: list[Segment]
    unit: Numbers
    vehicle: Vehicle


class SimulationConstellationSpec(TypedDict, total=False):
    """Navigation satellites on circular orbits, for simulated sensors `pseudorange` and `pseudorange_rate`."""

    few: list[SimulationFewSpec]
    inclination: float | str
    ionosphere: float | str
    mask: float | str
    planes: int
    radius: float | str
    satellites: int
    sectors: list[SimulationSectorSpec]
    signal_error: float | str
    troposphere: float | str


class SimulationFewSpec(TypedDict, total=False):
    """A time span with at most so many satellites."""

    most: int
    window: DesignTableReferenceEpisodes | list[DesignTableReferenceEpisodes]


SimulationSectorSpec = TypedDict(
    "SimulationSectorSpec",
    {
        "from": "float | str",
        "mask": "float | str",
        "to": "float | str",
        "window": "DesignTableReferenceEpisodes | list[DesignTableReferenceEpisodes]",
    }, total=False,
)


class Control(TypedDict, total=False):
    approach: ControlAutopilotApproachSpec
    heading: ControlAutopilotHeadingSpec
    line: ControlAutopilotLineSpec
    rate: float | str
    type: Literal['autopilot']


class ControlAutopilotApproachSpec(TypedDict, total=False):
    """Speed before the end of a way."""

    gain: float | str
    least: float | str


class ControlAutopilotHeadingSpec(TypedDict, total=False):
    """Gains of the heading law."""

    derivative: float | str
    integral: float | str
    integral_within: float | str
    max_rate: float | str
    proportional: float | str


class ControlAutopilotLineSpec(TypedDict, total=False):
    """Parameters of the line law."""

    integral: float | str
    look_ahead: float | str


class SimulationImuErrorSpec(TypedDict, total=False):
    """The simulated inertial measurement unit."""

    accelerometer: SimulationAccelerometerErrorSpec
    fault: dict[str, Fault]
    gyro: SimulationGyroErrorSpec
    preset: Literal['consumer', 'hg1700', 'navigation', 'perfect']
    rate: float | str


class SimulationAccelerometerErrorSpec(TypedDict, total=False):
    """Errors of three accelerometers: the differences from the preset."""

    bias: Numbers | float | str
    bias_random_walk: Numbers | float | str
    markov: SimulationAccelerometerDriftSpec
    misalignment: Numbers | float | str
    noise: Numbers | float | str
    resolution: Numbers | float | str
    scale_factor: Numbers | float | str
    scale_noise: float | str


class SimulationAccelerometerDriftSpec(TypedDict, total=False):
    """A first-order Gauss-Markov error."""

    correlation_time: float | str
    sigma: Numbers | float | str


class Fault(TypedDict, total=False):
    amplitude: Numbers | float | str
    at: float | str
    band: Numbers | float | str
    by: float | str
    channel: str
    copies: int
    correlation_time: float | str
    factor: Numbers | float | str
    numbers: list[int]
    rate: Numbers | float | str
    sigma: Numbers | float | str
    size: Numbers
    type: (
        Literal['bias_step', 'clock_jump', 'drop', 'duplicate', 'frozen', 'late', 'noise', 'not_a_number', 'oscillation', 'outage', 'outliers', 'ramp', 'scale', 'spike', 'swap', 'wander']
    )
    value: Numbers | float | str
    window: DesignTableReferenceEpisodes | list[DesignTableReferenceEpisodes]


class SimulationGyroErrorSpec(TypedDict, total=False):
    """Errors of three gyroscopes: the differences from the preset."""

    bias: Numbers | float | str
    bias_random_walk: Numbers | float | str
    markov: SimulationAccelerometerDriftSpec
    misalignment: Numbers | float | str
    noise: Numbers | float | str
    resolution: Numbers | float | str
    scale_factor: Numbers | float | str
    scale_noise: float | str


Task = TypedDict(
    "Task",
    {
        "distance": "float | str",
        "duration": "float | str",
        "for": "float | str",
        "from": "Numbers | float | str",
        "heading": "float | str",
        "radius": "float | str",
        "speed": "float | str",
        "to": "Numbers | float | str",
        "type": "Literal['drive', 'go_to', 'turn_to', 'wait']",
        "until": "float | str",
        "within": "float | str",
    }, total=False,
)


class SimulationOdometryErrorSpec(TypedDict, total=False):
    """The simulated odometry of a vehicle on level ground."""

    fault: dict[str, Fault]
    forward_noise: float | str
    rate: float | str
    sideways_noise: float | str
    yaw_rate_noise: float | str


class SimulationShipSpec(TypedDict, total=False):
    """A ship near the vehicle, moored or under way."""

    antenna: Numbers
    attitude: SimulationShipAttitudeSpec
    gps: SimulationShipGpsSpec
    heading: float | str
    mounting: Numbers
    pitch: SimulationSineSpec
    position: Numbers
    roll: SimulationSineSpec
    speed: float | str
    transceiver: Numbers
    transponder: Numbers
    usbl: SimulationTransceiverSpec
    watch_circle: SimulationCircleSpec
    yaw: SimulationSineSpec


class SimulationShipAttitudeSpec(TypedDict, total=False):
    """The ship's attitude reference."""

    bias_sigma: Numbers | float | str
    fault: dict[str, Fault]
    rate: float | str
    white: Numbers | float | str


class SimulationShipGpsSpec(TypedDict, total=False):
    """The ship's GPS."""

    fault: dict[str, Fault]
    rate: float | str
    white: Numbers | float | str


class SimulationSineSpec(TypedDict, total=False):
    """An angle that swings."""

    amplitude: float | str
    period: float | str


class SimulationTransceiverSpec(TypedDict, total=False):
    """The acoustic system."""

    angle_white: Numbers | float | str
    fault: dict[str, Fault]
    interval: SimulationIntervalSpec
    processing: float | str
    range_white: float | str
    sound_speed: float | str
    sound_speed_sigma: float | str
    unheard: SimulationUnheardSpec


class SimulationIntervalSpec(TypedDict, total=False):
    """How long until the next measurement."""

    least: float | str
    most: float | str
    spread: float | str


class SimulationUnheardSpec(TypedDict, total=False):
    """Pings that are not heard."""

    longest: int
    loud: SimulationLoudSpec
    rate: float | str


class SimulationLoudSpec(TypedDict, total=False):
    """Times at which more pings are not heard."""

    rate: float | str
    window: DesignTableReferenceEpisodes | list[DesignTableReferenceEpisodes]


class SimulationCircleSpec(TypedDict, total=False):
    """A circle at a steady pace."""

    period: float | str
    radius: float | str


class SimulationSeaSpec(TypedDict, total=False):
    """The sea that carries a boat."""

    current: Numbers
    tide: list[SimulationTideSpec]
    waves: SimulationWavesSpec


class SimulationTideSpec(TypedDict, total=False):
    """The current at a time."""

    at: float | str
    current: Numbers


class SimulationWavesSpec(TypedDict, total=False):
    """Waves, and how far the boat moves in them."""

    direction: float | str
    height: float | str
    period: float | str
    pitch: float | str
    roll: float | str


class SimulationSensorErrorSpec(TypedDict, total=False):
    """How a sensor is simulated: when it measures, and with which errors."""

    bias_sigma: Numbers | float | str
    fault: dict[str, Fault]
    markov: SimulationMarkovSpec
    rate: float | str
    resolution: Numbers | float | str
    start: float | str
    truth: dict[str, Any]
    white: Numbers | float | str


class SimulationMarkovSpec(TypedDict, total=False):
    """A first-order Gauss-Markov error."""

    correlation_time: float | str
    sigma: Numbers | float | str


class SimulationStartSpec(TypedDict, total=False):
    """The start of the trajectory: level, at rest unless a speed is given."""

    heading: float | str
    position: Numbers
    speed: float | str


class SimulationTrackSpeedsSpec(TypedDict, total=False):
    """The instrument that measures the speeds of a vehicle's tracks."""

    rate: float | str
    white: float | str


class Segment(TypedDict, total=False):
    acceleration: float | str
    amplitude: float | str
    angle: float | str
    bank: bool
    by: Numbers
    distance: float | str
    duration: float | str
    end_speed: float | str
    heading: float | str
    height: float | str
    length: float | str
    lift: float | str
    period: float | str
    pitch: float | str
    radius: float | str
    rate: float | str
    speed: float | str
    stance: float
    strides: int
    sway: float | str
    turn: float | str
    type: (
        Literal['bump', 'circle', 'climb', 'fly', 'hover', 'rest', 'rotate_in_place', 'sine', 'straight', 'turn', 'walk']
    )
    velocity: Numbers
    wavelength: float | str


class Vehicle(TypedDict, total=False):
    gauge: float | str
    icr: VehicleSkidSteerRotationCentres
    lag: float | str
    max_acceleration: float | str
    max_speed: float | str
    slip: VehicleSkidSteerSlipSpec
    terrain: VehicleSkidSteerTerrainSpec
    turn_slip: float | str
    type: Literal['skid_steer']


class VehicleSkidSteerRotationCentres(TypedDict, total=False):
    """The instantaneous centres of rotation of the tracks."""

    ahead: float | str
    left: float | str
    right: float | str


class VehicleSkidSteerSlipSpec(TypedDict, total=False):
    """Longitudinal slip: the share of its speed that a track loses."""

    correlation_time: float | str
    mean: float | str
    sigma: float | str


class VehicleSkidSteerTerrainSpec(TypedDict, total=False):
    """Uneven ground."""

    correlation_length: float | str
    sigma: float | str


class Source(TypedDict, total=False):
    bad_rows: Literal['skip', 'stop']
    channels: (
        dict[str, SourceArrowChannelSpec]
        | dict[str, SourceCsvChannelSpec]
        | dict[str, SourceDataflashChannelSpec]
        | dict[str, SourceMatChannelSpec]
        | dict[str, SourceMavlinkChannelSpec]
        | dict[str, SourceMcapChannelSpec]
        | dict[str, SourceNmeaChannelSpec]
        | dict[str, SourceParquetChannelSpec]
        | dict[str, SourceRosbag2ChannelSpec]
        | dict[str, SourceRosbagChannelSpec]
        | dict[str, SourceRtklibChannelSpec]
        | dict[str, SourceUbxChannelSpec]
        | dict[str, SourceUlogChannelSpec]
    )
    comment: str
    delimiter: str
    each: str
    fault: dict[str, Fault]
    header: Literal['comment'] | bool | int
    interval: Literal['nominal', 'stamps']
    keep: SourceArrowKeep
    names: list[str]
    path: str
    rate: float | str
    repeats: Literal['drop', 'keep']
    skip: int
    time: (
        SourceArrowTimeSpec
        | SourceCsvTimeSpec
        | SourceDataflashOwnTimeSpec
        | SourceMatMatTimeSpec
        | SourceMavlinkOwnTimeSpec
        | SourceMcapOwnTimeSpec
        | SourceNmeaOwnTimeSpec
        | SourceParquetTimeSpec
        | SourceRosbag2OwnTimeSpec
        | SourceRosbagOwnTimeSpec
        | SourceRtklibPosTimeSpec
        | SourceUbxOwnTimeSpec
        | SourceUlogOwnTimeSpec
    )
    topic: str
    type: (
        Literal['arrow', 'csv', 'dataflash', 'mat', 'mavlink', 'mcap', 'nmea', 'parquet', 'rosbag', 'rosbag2', 'rtklib', 'ubx', 'ulog']
    )
    valid: (
        SourceArrowChannelSpecValid
        | SourceCsvChannelSpecValid
        | SourceDataflashChannelSpecValid
        | SourceMatChannelSpecValid
        | SourceMavlinkChannelSpecValid
        | SourceMcapChannelSpecValid
        | SourceNmeaChannelSpecValid
        | SourceParquetChannelSpecValid
        | SourceRosbag2ChannelSpecValid
        | SourceRosbagChannelSpecValid
        | SourceRtklibChannelSpecValid
        | SourceUbxChannelSpecValid
        | SourceUlogChannelSpecValid
        | list[SourceArrowChannelSpecValid]
        | list[SourceCsvChannelSpecValid]
        | list[SourceDataflashChannelSpecValid]
        | list[SourceMatChannelSpecValid]
        | list[SourceMavlinkChannelSpecValid]
        | list[SourceMcapChannelSpecValid]
        | list[SourceNmeaChannelSpecValid]
        | list[SourceParquetChannelSpecValid]
        | list[SourceRosbag2ChannelSpecValid]
        | list[SourceRosbagChannelSpecValid]
        | list[SourceRtklibChannelSpecValid]
        | list[SourceUbxChannelSpecValid]
        | list[SourceUlogChannelSpecValid]
    )


class SourceArrowChannelSpec(TypedDict, total=False):
    """A channel: its columns and how they are combined."""

    average: bool
    column: list[str] | str
    columns: list[list[str] | str]
    course: SourceArrowChannelSpecCourse | str
    dcm: list[str]
    down: SourceArrowChannelSpecCourse | str
    east: str
    ecef: list[str]
    enu: list[str]
    euler: SourceArrowEulerSpec
    height: str
    height_unit: str
    increment: bool
    inverse: bool
    latency: float | str
    latitude: str
    longitude: str
    navigation_rotation: SourceArrowRotationSpec
    north: str
    offset: Numbers | float | str
    quaternion: list[str]
    rotation: SourceArrowRotationSpec
    rpy: list[str]
    scale: Numbers | float
    speed: SourceArrowChannelSpecCourse | str
    unit: str
    up: SourceArrowChannelSpecCourse | str
    utm: SourceArrowUtmSpec
    valid: SourceArrowChannelSpecValid | list[SourceArrowChannelSpecValid]
    variance: bool


class SourceArrowChannelSpecCourse(TypedDict, total=False):
    column: str
    unit: str


class SourceArrowEulerSpec(TypedDict, total=False):
    """Angles about the axes of turns."""

    columns: list[str]
    order: str


class SourceArrowRotationSpec(TypedDict, total=False):
    """A fixed rotation."""

    axes: list[str]
    rpy: Numbers


class SourceArrowUtmSpec(TypedDict, total=False):
    """A place on the grid."""

    easting: str
    hemisphere: Literal['north', 'south']
    northing: str
    zone: int


class SourceArrowChannelSpecValid(TypedDict, total=False):
    at_least: float
    at_most: float
    column: str
    equals: Numbers | float | str
    not_equals: Numbers | float | str


class SourceCsvChannelSpec(TypedDict, total=False):
    """A channel: its columns and how they are combined."""

    average: bool
    column: list[str] | str
    columns: list[list[str] | str]
    course: SourceArrowChannelSpecCourse | str
    dcm: list[str]
    down: SourceArrowChannelSpecCourse | str
    east: str
    ecef: list[str]
    enu: list[str]
    euler: SourceArrowEulerSpec
    height: str
    height_unit: str
    increment: bool
    inverse: bool
    latency: float | str
    latitude: str
    longitude: str
    navigation_rotation: SourceArrowRotationSpec
    north: str
    offset: Numbers | float | str
    quaternion: list[str]
    rotation: SourceArrowRotationSpec
    rpy: list[str]
    scale: Numbers | float
    speed: SourceArrowChannelSpecCourse | str
    unit: str
    up: SourceArrowChannelSpecCourse | str
    utm: SourceCsvUtmSpec
    valid: SourceCsvChannelSpecValid | list[SourceCsvChannelSpecValid]
    variance: bool


class SourceCsvUtmSpec(TypedDict, total=False):
    """A place on the grid."""

    easting: str
    hemisphere: Literal['north', 'south']
    northing: str
    zone: int


class SourceCsvChannelSpecValid(TypedDict, total=False):
    at_least: float
    at_most: float
    column: str
    equals: Numbers | float | str
    not_equals: Numbers | float | str


class SourceDataflashChannelSpec(TypedDict, total=False):
    """A channel: its columns and how they are combined."""

    average: bool
    column: list[str] | str
    columns: list[list[str] | str]
    course: SourceArrowChannelSpecCourse | str
    dcm: list[str]
    down: SourceArrowChannelSpecCourse | str
    east: str
    ecef: list[str]
    enu: list[str]
    euler: SourceArrowEulerSpec
    height: str
    height_unit: str
    increment: bool
    inverse: bool
    latency: float | str
    latitude: str
    longitude: str
    navigation_rotation: SourceArrowRotationSpec
    north: str
    offset: Numbers | float | str
    quaternion: list[str]
    rotation: SourceArrowRotationSpec
    rpy: list[str]
    scale: Numbers | float
    speed: SourceArrowChannelSpecCourse | str
    unit: str
    up: SourceArrowChannelSpecCourse | str
    utm: SourceDataflashUtmSpec
    valid: SourceDataflashChannelSpecValid | list[SourceDataflashChannelSpecValid]
    variance: bool


class SourceDataflashUtmSpec(TypedDict, total=False):
    """A place on the grid."""

    easting: str
    hemisphere: Literal['north', 'south']
    northing: str
    zone: int


class SourceDataflashChannelSpecValid(TypedDict, total=False):
    at_least: float
    at_most: float
    column: str
    equals: Numbers | float | str
    not_equals: Numbers | float | str


class SourceMatChannelSpec(TypedDict, total=False):
    """A channel: its columns and how they are combined."""

    average: bool
    column: list[str] | str
    columns: list[list[str] | str]
    course: SourceArrowChannelSpecCourse | str
    dcm: list[str]
    down: SourceArrowChannelSpecCourse | str
    east: str
    ecef: list[str]
    enu: list[str]
    euler: SourceArrowEulerSpec
    height: str
    height_unit: str
    increment: bool
    inverse: bool
    latency: float | str
    latitude: str
    longitude: str
    navigation_rotation: SourceArrowRotationSpec
    north: str
    offset: Numbers | float | str
    quaternion: list[str]
    rotation: SourceArrowRotationSpec
    rpy: list[str]
    scale: Numbers | float
    speed: SourceArrowChannelSpecCourse | str
    unit: str
    up: SourceArrowChannelSpecCourse | str
    utm: SourceMatUtmSpec
    valid: SourceMatChannelSpecValid | list[SourceMatChannelSpecValid]
    variance: bool


class SourceMatUtmSpec(TypedDict, total=False):
    """A place on the grid."""

    easting: str
    hemisphere: Literal['north', 'south']
    northing: str
    zone: int


class SourceMatChannelSpecValid(TypedDict, total=False):
    at_least: float
    at_most: float
    column: str
    equals: Numbers | float | str
    not_equals: Numbers | float | str


class SourceMavlinkChannelSpec(TypedDict, total=False):
    """A channel: its columns and how they are combined."""

    average: bool
    column: list[str] | str
    columns: list[list[str] | str]
    course: SourceArrowChannelSpecCourse | str
    dcm: list[str]
    down: SourceArrowChannelSpecCourse | str
    east: str
    ecef: list[str]
    enu: list[str]
    euler: SourceArrowEulerSpec
    height: str
    height_unit: str
    increment: bool
    inverse: bool
    latency: float | str
    latitude: str
    longitude: str
    navigation_rotation: SourceArrowRotationSpec
    north: str
    offset: Numbers | float | str
    quaternion: list[str]
    rotation: SourceArrowRotationSpec
    rpy: list[str]
    scale: Numbers | float
    speed: SourceArrowChannelSpecCourse | str
    unit: str
    up: SourceArrowChannelSpecCourse | str
    utm: SourceMavlinkUtmSpec
    valid: SourceMavlinkChannelSpecValid | list[SourceMavlinkChannelSpecValid]
    variance: bool


class SourceMavlinkUtmSpec(TypedDict, total=False):
    """A place on the grid."""

    easting: str
    hemisphere: Literal['north', 'south']
    northing: str
    zone: int


class SourceMavlinkChannelSpecValid(TypedDict, total=False):
    at_least: float
    at_most: float
    column: str
    equals: Numbers | float | str
    not_equals: Numbers | float | str


class SourceMcapChannelSpec(TypedDict, total=False):
    """A channel: its columns and how they are combined."""

    average: bool
    column: list[str] | str
    columns: list[list[str] | str]
    course: SourceArrowChannelSpecCourse | str
    dcm: list[str]
    down: SourceArrowChannelSpecCourse | str
    east: str
    ecef: list[str]
    enu: list[str]
    euler: SourceArrowEulerSpec
    height: str
    height_unit: str
    increment: bool
    inverse: bool
    latency: float | str
    latitude: str
    longitude: str
    navigation_rotation: SourceArrowRotationSpec
    north: str
    offset: Numbers | float | str
    quaternion: list[str]
    rotation: SourceArrowRotationSpec
    rpy: list[str]
    scale: Numbers | float
    speed: SourceArrowChannelSpecCourse | str
    unit: str
    up: SourceArrowChannelSpecCourse | str
    utm: SourceMcapUtmSpec
    valid: SourceMcapChannelSpecValid | list[SourceMcapChannelSpecValid]
    variance: bool


class SourceMcapUtmSpec(TypedDict, total=False):
    """A place on the grid."""

    easting: str
    hemisphere: Literal['north', 'south']
    northing: str
    zone: int


class SourceMcapChannelSpecValid(TypedDict, total=False):
    at_least: float
    at_most: float
    column: str
    equals: Numbers | float | str
    not_equals: Numbers | float | str


class SourceNmeaChannelSpec(TypedDict, total=False):
    """A channel: its columns and how they are combined."""

    average: bool
    column: list[str] | str
    columns: list[list[str] | str]
    course: SourceArrowChannelSpecCourse | str
    dcm: list[str]
    down: SourceArrowChannelSpecCourse | str
    east: str
    ecef: list[str]
    enu: list[str]
    euler: SourceArrowEulerSpec
    height: str
    height_unit: str
    increment: bool
    inverse: bool
    latency: float | str
    latitude: str
    longitude: str
    navigation_rotation: SourceArrowRotationSpec
    north: str
    offset: Numbers | float | str
    quaternion: list[str]
    rotation: SourceArrowRotationSpec
    rpy: list[str]
    scale: Numbers | float
    speed: SourceArrowChannelSpecCourse | str
    unit: str
    up: SourceArrowChannelSpecCourse | str
    utm: SourceNmeaUtmSpec
    valid: SourceNmeaChannelSpecValid | list[SourceNmeaChannelSpecValid]
    variance: bool


class SourceNmeaUtmSpec(TypedDict, total=False):
    """A place on the grid."""

    easting: str
    hemisphere: Literal['north', 'south']
    northing: str
    zone: int


class SourceNmeaChannelSpecValid(TypedDict, total=False):
    at_least: float
    at_most: float
    column: str
    equals: Numbers | float | str
    not_equals: Numbers | float | str


class SourceParquetChannelSpec(TypedDict, total=False):
    """A channel: its columns and how they are combined."""

    average: bool
    column: list[str] | str
    columns: list[list[str] | str]
    course: SourceArrowChannelSpecCourse | str
    dcm: list[str]
    down: SourceArrowChannelSpecCourse | str
    east: str
    ecef: list[str]
    enu: list[str]
    euler: SourceArrowEulerSpec
    height: str
    height_unit: str
    increment: bool
    inverse: bool
    latency: float | str
    latitude: str
    longitude: str
    navigation_rotation: SourceArrowRotationSpec
    north: str
    offset: Numbers | float | str
    quaternion: list[str]
    rotation: SourceArrowRotationSpec
    rpy: list[str]
    scale: Numbers | float
    speed: SourceArrowChannelSpecCourse | str
    unit: str
    up: SourceArrowChannelSpecCourse | str
    utm: SourceParquetUtmSpec
    valid: SourceParquetChannelSpecValid | list[SourceParquetChannelSpecValid]
    variance: bool


class SourceParquetUtmSpec(TypedDict, total=False):
    """A place on the grid."""

    easting: str
    hemisphere: Literal['north', 'south']
    northing: str
    zone: int


class SourceParquetChannelSpecValid(TypedDict, total=False):
    at_least: float
    at_most: float
    column: str
    equals: Numbers | float | str
    not_equals: Numbers | float | str


class SourceRosbagChannelSpec(TypedDict, total=False):
    """A channel: its columns and how they are combined."""

    average: bool
    column: list[str] | str
    columns: list[list[str] | str]
    course: SourceArrowChannelSpecCourse | str
    dcm: list[str]
    down: SourceArrowChannelSpecCourse | str
    east: str
    ecef: list[str]
    enu: list[str]
    euler: SourceArrowEulerSpec
    height: str
    height_unit: str
    increment: bool
    inverse: bool
    latency: float | str
    latitude: str
    longitude: str
    navigation_rotation: SourceArrowRotationSpec
    north: str
    offset: Numbers | float | str
    quaternion: list[str]
    rotation: SourceArrowRotationSpec
    rpy: list[str]
    scale: Numbers | float
    speed: SourceArrowChannelSpecCourse | str
    unit: str
    up: SourceArrowChannelSpecCourse | str
    utm: SourceRosbagUtmSpec
    valid: SourceRosbagChannelSpecValid | list[SourceRosbagChannelSpecValid]
    variance: bool


class SourceRosbagUtmSpec(TypedDict, total=False):
    """A place on the grid."""

    easting: str
    hemisphere: Literal['north', 'south']
    northing: str
    zone: int


class SourceRosbagChannelSpecValid(TypedDict, total=False):
    at_least: float
    at_most: float
    column: str
    equals: Numbers | float | str
    not_equals: Numbers | float | str


class SourceRosbag2ChannelSpec(TypedDict, total=False):
    """A channel: its columns and how they are combined."""

    average: bool
    column: list[str] | str
    columns: list[list[str] | str]
    course: SourceArrowChannelSpecCourse | str
    dcm: list[str]
    down: SourceArrowChannelSpecCourse | str
    east: str
    ecef: list[str]
    enu: list[str]
    euler: SourceArrowEulerSpec
    height: str
    height_unit: str
    increment: bool
    inverse: bool
    latency: float | str
    latitude: str
    longitude: str
    navigation_rotation: SourceArrowRotationSpec
    north: str
    offset: Numbers | float | str
    quaternion: list[str]
    rotation: SourceArrowRotationSpec
    rpy: list[str]
    scale: Numbers | float
    speed: SourceArrowChannelSpecCourse | str
    unit: str
    up: SourceArrowChannelSpecCourse | str
    utm: SourceRosbag2UtmSpec
    valid: SourceRosbag2ChannelSpecValid | list[SourceRosbag2ChannelSpecValid]
    variance: bool


class SourceRosbag2UtmSpec(TypedDict, total=False):
    """A place on the grid."""

    easting: str
    hemisphere: Literal['north', 'south']
    northing: str
    zone: int


class SourceRosbag2ChannelSpecValid(TypedDict, total=False):
    at_least: float
    at_most: float
    column: str
    equals: Numbers | float | str
    not_equals: Numbers | float | str


class SourceRtklibChannelSpec(TypedDict, total=False):
    """A channel: its columns and how they are combined."""

    average: bool
    column: list[str] | str
    columns: list[list[str] | str]
    course: SourceArrowChannelSpecCourse | str
    dcm: list[str]
    down: SourceArrowChannelSpecCourse | str
    east: str
    ecef: list[str]
    enu: list[str]
    euler: SourceArrowEulerSpec
    height: str
    height_unit: str
    increment: bool
    inverse: bool
    latency: float | str
    latitude: str
    longitude: str
    navigation_rotation: SourceArrowRotationSpec
    north: str
    offset: Numbers | float | str
    quaternion: list[str]
    rotation: SourceArrowRotationSpec
    rpy: list[str]
    scale: Numbers | float
    speed: SourceArrowChannelSpecCourse | str
    unit: str
    up: SourceArrowChannelSpecCourse | str
    utm: SourceRtklibUtmSpec
    valid: SourceRtklibChannelSpecValid | list[SourceRtklibChannelSpecValid]
    variance: bool


class SourceRtklibUtmSpec(TypedDict, total=False):
    """A place on the grid."""

    easting: str
    hemisphere: Literal['north', 'south']
    northing: str
    zone: int


class SourceRtklibChannelSpecValid(TypedDict, total=False):
    at_least: float
    at_most: float
    column: str
    equals: Numbers | float | str
    not_equals: Numbers | float | str


class SourceUbxChannelSpec(TypedDict, total=False):
    """A channel: its columns and how they are combined."""

    average: bool
    column: list[str] | str
    columns: list[list[str] | str]
    course: SourceArrowChannelSpecCourse | str
    dcm: list[str]
    down: SourceArrowChannelSpecCourse | str
    east: str
    ecef: list[str]
    enu: list[str]
    euler: SourceArrowEulerSpec
    height: str
    height_unit: str
    increment: bool
    inverse: bool
    latency: float | str
    latitude: str
    longitude: str
    navigation_rotation: SourceArrowRotationSpec
    north: str
    offset: Numbers | float | str
    quaternion: list[str]
    rotation: SourceArrowRotationSpec
    rpy: list[str]
    scale: Numbers | float
    speed: SourceArrowChannelSpecCourse | str
    unit: str
    up: SourceArrowChannelSpecCourse | str
    utm: SourceUbxUtmSpec
    valid: SourceUbxChannelSpecValid | list[SourceUbxChannelSpecValid]
    variance: bool


class SourceUbxUtmSpec(TypedDict, total=False):
    """A place on the grid."""

    easting: str
    hemisphere: Literal['north', 'south']
    northing: str
    zone: int


class SourceUbxChannelSpecValid(TypedDict, total=False):
    at_least: float
    at_most: float
    column: str
    equals: Numbers | float | str
    not_equals: Numbers | float | str


class SourceUlogChannelSpec(TypedDict, total=False):
    """A channel: its columns and how they are combined."""

    average: bool
    column: list[str] | str
    columns: list[list[str] | str]
    course: SourceArrowChannelSpecCourse | str
    dcm: list[str]
    down: SourceArrowChannelSpecCourse | str
    east: str
    ecef: list[str]
    enu: list[str]
    euler: SourceArrowEulerSpec
    height: str
    height_unit: str
    increment: bool
    inverse: bool
    latency: float | str
    latitude: str
    longitude: str
    navigation_rotation: SourceArrowRotationSpec
    north: str
    offset: Numbers | float | str
    quaternion: list[str]
    rotation: SourceArrowRotationSpec
    rpy: list[str]
    scale: Numbers | float
    speed: SourceArrowChannelSpecCourse | str
    unit: str
    up: SourceArrowChannelSpecCourse | str
    utm: SourceUlogUtmSpec
    valid: SourceUlogChannelSpecValid | list[SourceUlogChannelSpecValid]
    variance: bool


class SourceUlogUtmSpec(TypedDict, total=False):
    """A place on the grid."""

    easting: str
    hemisphere: Literal['north', 'south']
    northing: str
    zone: int


class SourceUlogChannelSpecValid(TypedDict, total=False):
    at_least: float
    at_most: float
    column: str
    equals: Numbers | float | str
    not_equals: Numbers | float | str


class SourceArrowKeep(TypedDict, total=False):
    """Which rows are kept: every n-th row, or all others."""

    every: int
    except_every: int
    offset: int


class SourceArrowTimeSpec(TypedDict, total=False):
    """The stamp of a row: log time = about + scale · (stamp − epoch − about) + offset."""

    about: float | str
    backwards: Literal['skip', 'stop']
    calendar: Literal['gps', 'tai', 'utc']
    column: str
    counts_from: Literal['gps', 'unix']
    date: str
    day: str
    epoch: float | str
    max_jump: float | str
    offset: float | str
    order: Literal['dmy', 'mdy', 'ymd']
    plus: SourceArrowPlusSpec
    rate: float | str
    scale: float
    start: float | str
    stop: float | str
    ties: Literal['keep', 'skip', 'stop']
    unit: str


class SourceArrowPlusSpec(TypedDict, total=False):
    """The second column of a stamp."""

    column: str
    each: float | str


class SourceCsvTimeSpec(TypedDict, total=False):
    """The stamp of a row: log time = about + scale · (stamp − epoch − about) + offset."""

    about: float | str
    backwards: Literal['skip', 'stop']
    calendar: Literal['gps', 'tai', 'utc']
    column: str
    counts_from: Literal['gps', 'unix']
    date: str
    day: str
    epoch: float | str
    max_jump: float | str
    offset: float | str
    order: Literal['dmy', 'mdy', 'ymd']
    plus: SourceArrowPlusSpec
    rate: float | str
    scale: float
    start: float | str
    stop: float | str
    ties: Literal['keep', 'skip', 'stop']
    unit: str


class SourceDataflashOwnTimeSpec(TypedDict, total=False):
    """The clock of a format that defines the unit and the zero point of its stamps."""

    about: float | str
    backwards: Literal['skip', 'stop']
    column: str
    epoch: float | str
    max_jump: float | str
    offset: float | str
    scale: float
    start: float | str
    stop: float | str
    ties: Literal['keep', 'skip', 'stop']


class SourceMatMatTimeSpec(TypedDict, total=False):
    """The stamp of a sample: log time = about + scale · (stamp − epoch − about) + offset."""

    about: float | str
    backwards: Literal['skip', 'stop']
    column: str
    counts_from: Literal['gps', 'unix']
    epoch: float | str
    max_jump: float | str
    offset: float | str
    rate: float | str
    scale: float
    start: float | str
    stop: float | str
    ties: Literal['keep', 'skip', 'stop']
    unit: str


class SourceMavlinkOwnTimeSpec(TypedDict, total=False):
    """The clock of a format that defines the unit and the zero point of its stamps."""

    about: float | str
    backwards: Literal['skip', 'stop']
    column: str
    epoch: float | str
    max_jump: float | str
    offset: float | str
    scale: float
    start: float | str
    stop: float | str
    ties: Literal['keep', 'skip', 'stop']


class SourceMcapOwnTimeSpec(TypedDict, total=False):
    """The clock of a format that defines the unit and the zero point of its stamps."""

    about: float | str
    backwards: Literal['skip', 'stop']
    column: str
    epoch: float | str
    max_jump: float | str
    offset: float | str
    scale: float
    start: float | str
    stop: float | str
    ties: Literal['keep', 'skip', 'stop']


class SourceNmeaOwnTimeSpec(TypedDict, total=False):
    """The clock of a format that defines the unit and the zero point of its stamps."""

    about: float | str
    backwards: Literal['skip', 'stop']
    column: str
    epoch: float | str
    max_jump: float | str
    offset: float | str
    scale: float
    start: float | str
    stop: float | str
    ties: Literal['keep', 'skip', 'stop']


class SourceParquetTimeSpec(TypedDict, total=False):
    """The stamp of a row: log time = about + scale · (stamp − epoch − about) + offset."""

    about: float | str
    backwards: Literal['skip', 'stop']
    calendar: Literal['gps', 'tai', 'utc']
    column: str
    counts_from: Literal['gps', 'unix']
    date: str
    day: str
    epoch: float | str
    max_jump: float | str
    offset: float | str
    order: Literal['dmy', 'mdy', 'ymd']
    plus: SourceArrowPlusSpec
    rate: float | str
    scale: float
    start: float | str
    stop: float | str
    ties: Literal['keep', 'skip', 'stop']
    unit: str


class SourceRosbagOwnTimeSpec(TypedDict, total=False):
    """The clock of a format that defines the unit and the zero point of its stamps."""

    about: float | str
    backwards: Literal['skip', 'stop']
    column: str
    epoch: float | str
    max_jump: float | str
    offset: float | str
    scale: float
    start: float | str
    stop: float | str
    ties: Literal['keep', 'skip', 'stop']


class SourceRosbag2OwnTimeSpec(TypedDict, total=False):
    """The clock of a format that defines the unit and the zero point of its stamps."""

    about: float | str
    backwards: Literal['skip', 'stop']
    column: str
    epoch: float | str
    max_jump: float | str
    offset: float | str
    scale: float
    start: float | str
    stop: float | str
    ties: Literal['keep', 'skip', 'stop']


class SourceRtklibPosTimeSpec(TypedDict, total=False):
    """The clock of a solution, which names its time system itself: a number as `epoch` is nanoseconds of GPS time."""

    about: float | str
    backwards: Literal['skip', 'stop']
    epoch: float | str
    max_jump: float | str
    offset: float | str
    scale: float
    start: float | str
    stop: float | str
    ties: Literal['keep', 'skip', 'stop']


class SourceUbxOwnTimeSpec(TypedDict, total=False):
    """The clock of a format that defines the unit and the zero point of its stamps."""

    about: float | str
    backwards: Literal['skip', 'stop']
    column: str
    epoch: float | str
    max_jump: float | str
    offset: float | str
    scale: float
    start: float | str
    stop: float | str
    ties: Literal['keep', 'skip', 'stop']


class SourceUlogOwnTimeSpec(TypedDict, total=False):
    """The clock of a format that defines the unit and the zero point of its stamps."""

    about: float | str
    backwards: Literal['skip', 'stop']
    column: str
    epoch: float | str
    max_jump: float | str
    offset: float | str
    scale: float
    start: float | str
    stop: float | str
    ties: Literal['keep', 'skip', 'stop']


Stage = TypedDict(
    "Stage",
    {
        "adaptive": "float | str",
        "alpha": "Numbers",
        "angle_sigma": "Numbers | float | str",
        "antenna": "Numbers",
        "attitude_sigma": "Numbers | float | str",
        "band": "float | str",
        "beta": "Numbers",
        "centre": "float | str",
        "channel": "Literal['attitude', 'body_velocity', 'depth', 'heading', 'velocity']",
        "declination": "float | str",
        "delay": "float | str",
        "each": "str",
        "enabled": "bool",
        "filter": "DesignTableFilter",
        "floor": "float | str",
        "from": "Literal['last', 'predicted']",
        "gain": "float | str",
        "gate": "StageCompassFieldGateSpec",
        "gauge": "float | str",
        "gnss": "StageStationarityGnssWitness",
        "gravity": "float | str",
        "hard_iron": "Numbers",
        "health": "DesignTableHealth",
        "humidity": "float | str",
        "include": "list[str]",
        "initial": "dict[str, Initialiser]",
        "level_source": "str",
        "longest_gap": "float | str",
        "longest_range": "float | str",
        "mask": "float | str",
        "max_mean_acceleration": "float | str",
        "max_speed": "float | str",
        "min_speed": "float | str",
        "mounting": "Numbers",
        "noise": "StageCompassFieldNoiseSpec",
        "persist": "int",
        "position_sigma": "Numbers | float | str",
        "process": "Process",
        "range_sigma": "float | str",
        "rate": "float | str",
        "sensor": "dict[str, Sensor]",
        "ship_attitude": "str",
        "ship_position": "str",
        "sigma": "float | str",
        "sigma_low": "float | str",
        "slip": "float | str",
        "soft_iron": "list[Numbers]",
        "sound_speed": "float | str",
        "source": "str",
        "stage": "dict[str, Stage]",
        "still": "InitialiserLevellingStillSpec",
        "test_rate": "float | str",
        "time_constant": "float | str",
        "transceiver": "Numbers",
        "type": "Literal['compass', 'elevation_noise', 'filter', 'gravity_gradient', 'klobuchar', 'once_per', 'periodic', 'saastamoinen', 'stationarity', 'steady_force', 'track_velocity', 'usbl_fix']",
    }, total=False,
)


class StageCompassFieldGateSpec(TypedDict, total=False):
    """Rejects the headings of a field that is not the Earth's: with another size or dip."""

    adopt_after: float | str
    dip: float | str
    enabled: bool
    field: StageCompassFieldSpec
    hold_off: float | str
    learn_for: float | str
    magnitude: float | str
    smooth_over: float | str


class StageCompassFieldSpec(TypedDict, total=False):
    """An undisturbed field."""

    dip: float | str
    magnitude: float | str


class StageStationarityGnssWitness(TypedDict, total=False):
    """GNSS as a witness of stillness."""

    max_age: float | str
    max_speed: float | str
    source: str


class StageCompassFieldNoiseSpec(TypedDict, total=False):
    """The 1σ of a field: √(sigma² + (difference · d)²)."""

    difference: float | str
    sigma: float | str


class DesignTableStress(TypedDict, total=False):
    """What `fusion stress` applies, and how it judges."""

    apart: float | str
    at: float | str
    draw: StressDrawSpec
    fault: dict[str, dict[str, Any]]
    pairs: int
    recovery: float | str
    settle: float | str
    watch: float | str


class StressDrawSpec(TypedDict, total=False):
    """How `fusion stress --draw` draws faults and judges cases."""

    delay: Numbers
    factor: Numbers
    false_good: float | str
    input: Numbers
    late: float | str
    left: float | str
    longest: float | str
    of: list[str]
    over: float | str
    recovered: float | str
    shortest: float | str
    size: Numbers
    together: int


class Summary(TypedDict):
    """The result of a run, as summary.json has it."""

    backend: str
    coasted: float
    consumers: list[SummaryConsumerCounts]
    control: SummaryRecord | None
    current: SummaryCurrent | None
    description: str
    detectors: list[SummaryDetector]
    epochs: int
    excesses: list[SummaryExcess]
    failures: list[str]
    faults: list[SummaryFaultWindow]
    filter_ns_per_epoch: float
    findings: list[SummaryFinding]
    further_failures: int
    health: list[SummaryFilterHealth]
    held_back: float
    hypotheses: SummaryHypotheses | None
    inside: list[SummaryInsideScore]
    judged_by: str | None
    judged_by_used_rows: bool
    kernel: str
    parameters: list[SummaryFinalState]
    provenance: SummaryProvenance
    refused_samples: int
    score: SummaryScore | None
    sections: list[SummaryRunSection]
    sensors: list[SummarySensorStatistics]
    smoothed: SummarySmoothed | None
    sources: list[SummarySourceStatistics]
    start_angle: list[Any] | None
    started: float | None
    unused_rows: list[list[Any]]
    waited: SummaryWait | None
    waiting: list[list[Any]]
    wall_seconds: float


class SummaryConsumerCounts(TypedDict):
    """The outcomes of the rows of one consumer: the process, an initialiser, a stage or a sensor."""

    after_run: int
    before_run: int
    before_start: int
    frozen: int
    late: int
    name: str
    not_finite: int
    not_needed: int
    otherwise: int
    out_of_range: int
    rejected: int
    rows: int
    spikes: int
    stream: str
    switched_off: int
    time_jumps: int
    unusable: int
    used: int


class SummaryRecord(TypedDict):
    """A mission as it was carried out."""

    closure: Numbers
    is_done: bool
    legs: list[SummaryLeg]
    way: float


SummaryLeg = TypedDict(
    "SummaryLeg",
    {
        "across": "SummaryErrors | None",
        "from": "float",
        "heading": "SummaryHeadingErrors | None",
        "miss": "Numbers | None",
        "name": "str",
        "to": "float",
    },
)


class SummaryErrors(TypedDict):
    """Errors over a leg."""

    last: float
    max: float
    rms: float


class SummaryHeadingErrors(TypedDict):
    """Errors of a heading over a leg [rad]."""

    errors: SummaryErrors
    overshoot: float
    wanted: float


class SummaryCurrent(TypedDict):
    """The estimates as known at the time, for a filter that uses rows as they arrive."""

    longest_seconds: float
    memory: int
    most_rows_again: int
    rewinds: int
    rows_again: int
    score: SummaryScore | None


class SummaryScore(TypedDict):
    """The result."""

    attitude_deg: SummaryAxes | None
    blocks: list[SummaryBlockScore]
    convergence: SummaryConvergence | None
    course: SummaryCourse | None
    drift: list[SummaryDrift]
    drift_median: float | None
    drift_rms: float | None
    episodes: SummaryEpisodes | None
    epochs: int
    heading_rmse_deg: float | None
    horizontal_max: float | None
    horizontal_median: float | None
    horizontal_p95: float | None
    horizontal_rms: float | None
    inclination_rmse_deg: float | None
    mounting_deg: Numbers | None
    nees_attitude: SummaryConsistency | None
    nees_height: SummaryConsistency | None
    nees_position: SummaryConsistency | None
    nees_undefined: list[int]
    nees_velocity: SummaryConsistency | None
    offset: SummaryOffset | None
    position: SummaryAxes | None
    position_rmse_m: float | None
    rotation_rmse_deg: float | None
    spread: SummarySpreads
    steep: int
    trajectory: SummaryTrajectory | None
    travelled: SummaryTravelled | None
    velocity: SummaryAxes | None


class SummaryAxes(TypedDict):
    """RMS, mean and largest magnitude per axis."""

    inside: list[float | None]
    max: list[float | None]
    max_time: list[float | None]
    mean: list[float | None]
    rms: list[float | None]
    three_sigma: list[float | None]


class SummaryBlockScore(TypedDict):
    """The score of a block, for each axis of its tangent space and in its unit."""

    error: Numbers
    inside: list[float | None]
    is_parameter: bool
    name: str
    nees: SummaryConsistency | None
    nees_undefined: int
    rms: Numbers
    sigma: Numbers
    three_sigma: Numbers
    unit: str


class SummaryConsistency(TypedDict):
    """The mean of a χ² statistic with the band that a consistent filter stays in."""

    band: list[Any]
    count: int
    dof: int
    independent: float
    mean: float


class SummaryConvergence(TypedDict):
    """The result for the limits in a run."""

    after: float | None
    converged: bool


class SummaryCourse(TypedDict):
    """Headings against the course."""

    estimate_deg: float
    own_deg: float
    reference_deg: float
    share: float
    share_sigma: float


SummaryDrift = TypedDict(
    "SummaryDrift",
    {
        "end_horizontal": "float",
        "end_sigma": "float",
        "from": "float",
        "growth": "float",
        "is_cut": "bool",
        "max_horizontal": "float",
        "moved": "SummaryMoved | None",
        "to": "float",
        "until": "float",
    },
)


class SummaryMoved(TypedDict):
    """A measurement that moved the estimate."""

    sensor: str
    sigmas: float
    time: float


class SummaryEpisodes(TypedDict):
    """The score in the declared episodes and outside them."""

    during: SummaryPartScore
    outside: SummaryPartScore


class SummaryPartScore(TypedDict):
    """The score of a part of a run."""

    epochs: int
    horizontal_rms: float
    nees: list[SummaryConsistency | None]
    position: SummaryAxes | None


class SummaryOffset(TypedDict):
    """A constant offset in body axes that was fitted to the position errors."""

    body: Numbers
    explained: float
    halves: list[Numbers]
    halves_sigma: list[Numbers]
    latency: float
    latency_explained: float
    latency_sigma: float
    own: Numbers
    sigma: Numbers


class SummarySpreads(TypedDict):
    """Median and 95 % of each error."""

    heading_deg: SummaryLengthSpread | None
    horizontal: SummaryLengthSpread | None
    position: SummaryLengthSpread | None
    rotation_deg: SummaryLengthSpread | None
    velocity: SummaryLengthSpread | None


class SummaryLengthSpread(TypedDict):
    """Median and 95 % of the length of an error."""

    median: float
    p95: float


class SummaryTrajectory(TypedDict):
    """Absolute and relative errors of a trajectory."""

    absolute: list[SummaryAbsoluteError]
    attitudes: int
    horizontal: bool
    length: float
    poses: int
    relative: list[SummaryRelativeError]
    shown: Literal['none', 'se3', 'yaw']


class SummaryAbsoluteError(TypedDict):
    """Absolute trajectory error after an alignment."""

    align: Literal['none', 'se3', 'yaw']
    position: SummaryStatistics
    rotation_deg: SummaryStatistics | None


class SummaryStatistics(TypedDict):
    """Statistics of errors."""

    count: int
    max: float
    mean: float
    median: float
    min: float
    p95: float
    rmse: float
    std: float


class SummaryRelativeError(TypedDict):
    """Relative pose error over a distance."""

    distance: float
    position: SummaryStatistics
    rotation_deg: SummaryStatistics | None


class SummaryTravelled(TypedDict):
    """The largest change of the horizontal position error, in % of the distance travelled."""

    distance: float
    from_origin_percent: float
    reciprocal_percent: float


class SummaryDetector(TypedDict):
    """The test results of a detector stage."""

    held: int
    nearest: str | None
    stage: str
    tests: int


SummaryExcess = TypedDict(
    "SummaryExcess",
    {
        "dof": "int",
        "from": "float",
        "measurements": "int",
        "moved": "list[SummaryMoved2]",
        "nis": "float",
        "sensor": "str",
        "to": "float",
    },
)


SummaryMoved2 = TypedDict(
    "SummaryMoved2",
    {
        "axis": "int",
        "from": "float",
        "is_vector": "bool",
        "name": "str",
        "sigma": "float",
        "sigmas": "float",
        "to": "float",
        "unit": "str",
    },
)


SummaryFaultWindow = TypedDict(
    "SummaryFaultWindow",
    {
        "fault": "str",
        "from": "float",
        "stream": "str",
        "to": "float",
    },
)


class SummaryFinding(TypedDict):
    """Something that a designer should look at."""

    about: str
    advice: str
    edits: list[SummaryEdit]
    evidence: str
    rule: str


class SummaryEdit(TypedDict):
    """One change of a design: a key gets a value, or is left out."""

    key: str
    value: str | None


class SummaryFilterHealth(TypedDict):
    """The health of a filter over a run."""

    aligned: float | None
    filter: str
    further_transitions: int
    in_outages: float
    spent: SummarySpent
    state: Literal['aligning', 'coasting', 'degraded', 'good', 'lost']
    transitions: list[SummaryTransition]
    until: float
    worst: Literal['aligning', 'coasting', 'degraded', 'good', 'lost']


class SummarySpent(TypedDict):
    """Time spent in each state [s]."""

    aligning: float
    coasting: float
    degraded: float
    good: float
    lost: float


class SummaryTransition(TypedDict):
    """A change of the health."""

    reasons: list[SummaryNamedReason]
    state: Literal['aligning', 'coasting', 'degraded', 'good', 'lost']
    time: float


class SummaryNamedReason(TypedDict):
    """A reason for the health of a filter, in the names of the design."""

    of: str
    reason: str
    state: Literal['aligning', 'coasting', 'degraded', 'good', 'lost']


class SummaryHypotheses(TypedDict):
    """The hypotheses of the outermost filter through a run."""

    changes: list[SummaryChange]
    count: int
    further_changes: int
    most: int
    probability: float


class SummaryChange(TypedDict):
    """A change of the displayed hypothesis."""

    angle: float | None
    time: float


class SummaryInsideScore(TypedDict):
    """The score of a filter inside a stage."""

    filter: str
    score: SummaryScore


class SummaryFinalState(TypedDict):
    """The state of one parameter at the end of a run."""

    name: str
    sigma: Numbers
    unit: str
    value: Numbers


class SummaryProvenance(TypedDict):
    """The inputs of a run, or of each run of a comparison."""

    design: str
    hash: str
    seed: int | None
    set: list[str]
    variants: list[str]
    version: str


class SummaryRunSection(TypedDict):
    """A section of the result that is a table."""

    columns: list[SummarySectionColumn]
    name: str
    notes: list[str]
    rows: list[Numbers]
    title: str


class SummarySectionColumn(TypedDict):
    """A column of a [`RunSection`]."""

    name: str
    unit: str


class SummarySensorStatistics(TypedDict):
    """The outcomes of a sensor's measurements."""

    accepted: int
    disagrees_from: float | None
    disturbed: SummaryDisturbed | None
    ends_denied: bool
    gate_power: list[float | None]
    innovations: SummaryInnovations
    longest_rejection_streak: SummaryRejectionStreak | None
    name: str
    nis: SummaryConsistency | None
    reacquired: int
    reacquired_at: Numbers
    rejected: int
    unusable: int
    with_leader: int


class SummaryDisturbed(TypedDict):
    """How the filter treated the rows that declared faults changed, and the other rows."""

    caught: int
    false_rejections: int
    missed: int


class SummaryInnovations(TypedDict):
    """The innovations r = z ⊟ h(x̂) of accepted measurements: sensor minus estimate before the update."""

    axis: list[str]
    count: int
    independent: Numbers
    lag_1: Numbers
    max: Numbers
    max_time: Numbers
    mean: Numbers
    mean_sigmas: Numbers
    rms: Numbers
    unit: list[str]


SummaryRejectionStreak = TypedDict(
    "SummaryRejectionStreak",
    {
        "from": "float",
        "measurements": "int",
        "seconds": "float",
    },
)


class SummarySmoothed(TypedDict):
    """The estimates smoothed with later data."""

    estimates: int
    iteration: SummaryIteration | None
    lag: float | None
    score: SummaryScore | None


class SummaryIteration(TypedDict):
    """The entries of [`Iteration`], for the schema."""

    cost: float
    distance: float
    is_converged: bool
    iterations: int
    shortened: int


class SummarySourceStatistics(TypedDict):
    """The statistics of a source."""

    name: str
    rows: int
    skipped: list[list[Any]]
    used: int


class SummaryWait(TypedDict):
    """The part of a log before the start of the outermost filter."""

    of: float
    seconds: float
    waited: list[list[Any]]
