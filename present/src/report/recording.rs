//! The data that a report draws, collected during a run in bounded memory.

use super::consistency::Judged;
use super::parameters::Parameters;
use super::path::Path;
use super::sensor::SensorTrack;
use super::trace::{Samples, Trace};
use fusion::assembly::{Assembly, StreamChannel, StreamLayout};
use fusion::design::{Design, MapDetailSpec};
use fusion::observe::{Filters, RunEvent, RunObserver, Thinning};
use fusion::rows::Row;
use fusion::score::{Deviation, EpochError, ReferenceEpoch, attitude_error, nees_of};
use fusion::solution::{Solution, sigmas};
use fusion_core::filter::Update;
use fusion_core::geometry::so3;
use fusion_core::geometry::wgs84::Geodetic;
use fusion_core::math;
use fusion_core::memory::{Memory, Tape};
use fusion_core::runner::{Event, Halt};
use fusion_core::state::Manifold;
use fusion_core::time::Time;
use fusion_models::block::Shape;
use fusion_models::earth::LocalFrame;
use fusion_tables::Unit;
use nalgebra::{Quaternion, UnitQuaternion, Vector3};

/// Buckets of a series: at two rows each, more than a wide screen has pixels.
pub(super) const BUCKETS: usize = 8192;
/// Points of a path, and fixes of a sensor.
pub(super) const POINTS: usize = 8192;
/// Whole estimates.
const STATES: usize = 4096;
/// Buckets of the NEES.
const NEES: usize = 2048;
/// The shortest time between drawn estimates \[ns\]: 50 Hz shows every motion of a vehicle or a hand. Measurements
/// are drawn at their own rate.
const PERIOD: i64 = 20_000_000;
/// Input channels that are drawn; further ones are left out.
const INPUTS: usize = 24;
/// Channels with these names give the accuracy of other channels.
const QUALITY: [&str; 5] = ["sigma", "variance", "covariance", "noise", "accuracy"];

/// The frame and the point that the curves refer to.
#[derive(Clone, Debug, Default)]
pub struct Frame {
    /// Origin of local north, east, down; by default the first position.
    pub origin: Option<Geodetic>,
    /// The reference's point in body axes \[m\]: the estimate is shown there.
    pub lever_arm: Vector3<f64>,
    /// Whether the mean rotation between the two bodies is taken out of the attitude errors.
    pub remove_mean_mounting: bool,
}

/// Collects one run.
///
/// ```
/// use fusion_present::report::{Frame, Recording};
/// let mut recording = Recording::new(Frame::default());
/// recording.input("heading", "deg", fusion::core::time::Time::from_seconds(0.1), &[90.0]);
/// ```
#[derive(Clone, Debug)]
pub struct Recording {
    pub(super) frame: Frame,
    /// Which estimates are drawn.
    thinning: Thinning,
    local: Option<LocalFrame>,
    pub(super) position: Quantity,
    pub(super) velocity: Quantity,
    pub(super) attitude: Quantity,
    /// Estimated and reference attitude and the 1σ of roll, pitch, yaw, if the mounting between the two is
    /// known only at the end.
    pub(super) mounted: Samples<11>,
    /// Whole estimates, to compare runs: position, velocity, roll pitch yaw. Estimates at equal times have equal
    /// numbers in all runs.
    pub(super) states: Samples<9>,
    pub(super) path: Path,
    pub(super) true_path: Path,
    pub(super) sensors: Vec<SensorTrack>,
    pub(super) inputs: Vec<InputTrack>,
    pub(super) parameters: Parameters,
    /// NEES of position, velocity, attitude.
    pub(super) nees: [Judged; 3],
    true_angles: Unwrapped<3>,
    angles: Unwrapped<3>,
    /// Parts of the map that are enlarged.
    pub(super) details: Vec<MapDetailSpec>,
    /// The recording of the smoothed estimates, if there are any.
    pub(super) smoothed: Option<Box<Self>>,
    /// By stream: the channels that are drawn, with their tracks.
    ports: Vec<Vec<(StreamChannel, usize)>>,
}

/// Estimate, truth and error of a vector with three axes.
#[derive(Clone, Debug)]
pub(super) struct Quantity {
    /// Value and 3σ per axis.
    pub estimate: Trace,
    pub truth: Trace,
    /// Error and 3σ per axis.
    pub error: Trace,
    /// The full turns to add to the estimate so that it is comparable with the truth.
    pub turns: Option<Vector3<f64>>,
}

impl Quantity {
    fn new() -> Self {
        Self {
            estimate: Trace::new(6, BUCKETS),
            truth: Trace::new(3, BUCKETS),
            error: Trace::new(6, BUCKETS),
            turns: None,
        }
    }
}

/// A group of input channels.
#[derive(Clone, Debug)]
pub(super) struct InputTrack {
    pub name: String,
    pub unit: String,
    pub trace: Trace,
    /// Factor from the value in the row to the unit.
    scale: f64,
    angle: Option<Unwrapped<1>>,
}

impl InputTrack {
    pub(super) const fn is_angle(&self) -> bool {
        self.angle.is_some()
    }
}

/// Angles in degrees made continuous.
#[derive(Clone, Debug)]
struct Unwrapped<const N: usize> {
    last: Option<[f64; N]>,
}

impl<const N: usize> Unwrapped<N> {
    const NONE: Self = Self { last: None };

    fn next(&mut self, angles: [f64; N]) -> [f64; N] {
        let last = self.last.unwrap_or([0.0; N]);
        let near = std::array::from_fn(|i| angles[i] - 360.0 * math::round((angles[i] - last[i]) / 360.0));
        self.last = Some(near);
        near
    }
}

/// The tracks that the design gives are there before.
impl Memory for Recording {
    fn remember(&mut self, tape: &mut Tape<'_>) {
        self.thinning.remember(tape);
        self.local.remember(tape);
        self.position.remember(tape);
        self.velocity.remember(tape);
        self.attitude.remember(tape);
        self.mounted.remember(tape);
        self.states.remember(tape);
        self.path.remember(tape);
        self.true_path.remember(tape);
        self.sensors.as_mut_slice().remember(tape);
        self.inputs.as_mut_slice().remember(tape);
        self.parameters.remember(tape);
        self.nees.remember(tape);
        self.true_angles.remember(tape);
        self.angles.remember(tape);
    }
}

fusion_core::memory!(Quantity {
    estimate,
    truth,
    error,
    turns
});

impl Memory for InputTrack {
    fn remember(&mut self, tape: &mut Tape<'_>) {
        self.trace.remember(tape);
        if let Some(angle) = &mut self.angle {
            angle.remember(tape);
        }
    }
}

impl<const N: usize> Memory for Unwrapped<N> {
    fn remember(&mut self, tape: &mut Tape<'_>) {
        let mut has_last = self.last.is_some();
        has_last.remember(tape);
        let mut last = self.last.unwrap_or([0.0; N]);
        if has_last {
            last.remember(tape);
        }
        self.last = has_last.then_some(last);
    }
}

impl Recording {
    /// An empty recording.
    #[must_use]
    pub fn new(frame: Frame) -> Self {
        Self {
            local: frame.origin.map(LocalFrame::new),
            frame,
            thinning: Thinning::new(PERIOD),
            position: Quantity::new(),
            velocity: Quantity::new(),
            attitude: Quantity::new(),
            mounted: Samples::new(POINTS),
            states: Samples::new(STATES),
            path: Path::new(POINTS),
            true_path: Path::new(POINTS),
            sensors: Vec::new(),
            inputs: Vec::new(),
            parameters: Parameters::default(),
            nees: std::array::from_fn(|_| Judged::new(NEES)),
            true_angles: Unwrapped::NONE,
            angles: Unwrapped::NONE,
            details: Vec::new(),
            smoothed: None,
            ports: Vec::new(),
        }
    }

    /// A recording for other estimates of the same run.
    pub(super) fn beside(&self) -> Self {
        Self::new(self.frame.clone())
    }

    /// For a run of `design`, which it observes.
    #[must_use]
    pub fn of(design: &Design, assembly: &Assembly) -> Self {
        let reference = design.reference.as_ref().map(|r| &r.block);
        let mut recording = Self::new(Frame {
            origin: design.run.origin.map(Into::into),
            lever_arm: reference.map_or_else(Vector3::zeros, |r| r.point().into()),
            remove_mean_mounting: reference.is_some_and(|r| r.remove_mean_mounting),
        });
        recording.details.clone_from(&design.run.map_details);
        let filters = Filters::of(assembly);
        recording.parameters = Parameters::of(&filters);
        for sensor in filters.sensors() {
            let track = recording.sensor(&sensor.name, sensor.rows.len());
            recording.sensors[track].is_place = sensor.is_place;
        }
        // The channels that drive the process come first, then those that the sensors read.
        let driving = design.process.block.model.input();
        let drives = |c: &StreamChannel| driving.iter().any(|d| d.name == c.name);
        for stream in &assembly.streams {
            recording.ports.push(Vec::new());
            if stream.name == fusion::world::REFERENCE || reference.is_some_and(|r| r.source.has(&stream.name)) {
                continue;
            }
            recording.connect(stream);
        }
        let mut order: Vec<usize> = (0..recording.inputs.len()).collect();
        let drivers: Vec<usize> = recording
            .ports
            .iter()
            .flatten()
            .filter(|(c, _)| drives(c))
            .map(|(_, i)| *i)
            .collect();
        order.sort_by_key(|i| !drivers.contains(i));
        order.truncate(INPUTS);
        for port in &mut recording.ports {
            port.retain(|(_, i)| order.contains(i));
            port.iter_mut()
                .for_each(|(_, i)| *i = order.iter().position(|o| o == i).unwrap_or(0));
        }
        recording.inputs = order.iter().map(|i| recording.inputs[*i].clone()).collect();
        recording
    }

    /// Draws the channels of the latest stream.
    fn connect(&mut self, stream: &StreamLayout) {
        let id = self.ports.len() - 1;
        for channel in &stream.channels {
            let is_quality = QUALITY.iter().any(|q| channel.name.contains(q));
            let is_drawn = matches!((channel.shape, channel.width), (Shape::Vector | Shape::Angle, 1 | 3));
            if is_quality || !is_drawn {
                continue;
            }
            let unit = Unit::of_si(&channel.dimension.to_string());
            let mut name = channel.name.replace('_', " ");
            let driving = ["angular rate", "specific force"].contains(&name.as_str());
            if !driving && name != stream.name {
                name = format!("{} · {name}", stream.name);
            }
            let angle = channel.shape == Shape::Angle && channel.width == 1;
            let track = self.track(&name, unit.symbol(), channel.width, angle, unit.of(1.0));
            self.ports[id].push((channel.clone(), track));
        }
    }

    /// An estimate, in order of time.
    pub fn estimate(&mut self, solution: &Solution) {
        let t = solution.time.seconds();
        let mut state = [f64::NAN; 9];
        if let Some((place, p)) = solution.position {
            let ned = self.ned(&self.at_the_reference(solution, place));
            state[..3].copy_from_slice(ned.as_slice());
            self.path.push(t, [ned.x, ned.y]);
            self.position.estimate.push(t, &six(&ned, &sigmas(&p)));
        }
        if let Some((v, p)) = solution.velocity {
            state[3..6].copy_from_slice(v.as_slice());
            self.velocity.estimate.push(t, &six(&v, &sigmas(&p)));
        }
        if let Some((rpy, sigma)) = solution.rpy() {
            let rpy: Vector3<f64> = self.angles.next(rpy.map(f64::to_degrees).into()).into();
            state[6..].copy_from_slice(rpy.as_slice());
            self.attitude.estimate.push(t, &six(&rpy, &sigma.map(f64::to_degrees)));
        }
        self.states.push(t, state);
    }

    /// An epoch of the reference, in order of time, with the error of the estimates given before it.
    pub fn reference(&mut self, epoch: &ReferenceEpoch, error: Option<&EpochError>) {
        let t = epoch.time.seconds();
        if let Some(ned) = epoch.position.and_then(|place| self.known_ned(&place)) {
            if ned.x.is_finite() {
                self.true_path.push(t, [ned.x, ned.y]);
            }
            self.position.truth.push(t, ned.as_slice());
        }
        if let Some(v) = epoch.velocity {
            self.velocity.truth.push(t, v.as_slice());
        }
        if let Some(q) = epoch.attitude {
            let rpy = self.true_angles.next(so3::to_rpy(&q).map(f64::to_degrees).into());
            self.attitude.truth.push(t, &rpy);
        }
        if let Some(error) = error {
            self.error(t, error);
        }
    }

    fn error(&mut self, t: f64, error: &EpochError) {
        if let Some(d) = &error.position {
            self.position.error.push(t, &deviation(d));
            self.nees[0].add(t, nees_of(d));
        }
        if let Some(d) = &error.velocity {
            self.velocity.error.push(t, &deviation(d));
            self.nees[1].add(t, nees_of(d));
        }
        let Some(a) = &error.attitude else { return };
        let sigma = a.rpy.sigma().map(f64::to_degrees);
        if self.frame.remove_mean_mounting {
            let (q, truth) = (a.estimate.coords, a.truth.coords);
            let row: Vec<f64> = q.iter().chain(truth.iter()).chain(sigma.iter()).copied().collect();
            self.mounted.push(t, std::array::from_fn(|i| row[i]));
        } else {
            self.attitude.error.push(t, &six(&a.rpy.error.map(f64::to_degrees), &sigma));
            self.nees[2].add(t, nees_of(&a.body));
        }
        if let (None, Some(estimate), Some(truth)) = (self.attitude.turns, self.angles.last, self.true_angles.last) {
            let apart = Vector3::from(truth) - Vector3::from(estimate);
            self.attitude.turns = Some(apart.map(|d| 360.0 * math::round(d / 360.0)));
        }
    }

    /// A measurement of `sensor`, which lies at `position` if it is a fix.
    pub fn measurement(&mut self, sensor: &str, time: Time, position: Option<Geodetic>, update: &Update<'_>) {
        let index = self.sensor(sensor, update.residual.len());
        self.judged(index, time, position, update);
    }

    fn judged(&mut self, sensor: usize, time: Time, position: Option<Geodetic>, update: &Update<'_>) {
        let ned = position.map(|p| self.ned(&p));
        self.sensors[sensor].judged(time.seconds(), ned, update);
    }

    /// Sensor data in `unit`: one number, or three along the body's axes.
    pub fn input(&mut self, name: &str, unit: &str, time: Time, values: &[f64]) {
        if let Some(at) = self.inputs.iter().position(|i| i.name == name) {
            self.sample(at, time, values);
        } else if self.inputs.len() < INPUTS {
            let at = self.track(name, unit, values.len(), unit == "deg" && values.len() == 1, 1.0);
            self.sample(at, time, values);
        }
    }

    /// A row of a stream of the assembly.
    fn row(&mut self, row: &Row<'_>) {
        let Some(port) = self.ports.get_mut(row.stream).map(std::mem::take) else {
            return;
        };
        for (channel, track) in &port {
            let values = &row.values[channel.offset..channel.offset + channel.width];
            self.sample(*track, row.time.shifted(-channel.delay), values);
        }
        self.ports[row.stream] = port;
    }

    /// First and last time \[s\] of anything recorded.
    pub(super) fn span(&self) -> Option<(f64, f64)> {
        let quantities = [&self.position, &self.velocity, &self.attitude];
        let spans = quantities.into_iter().flat_map(|q| [q.estimate.span(), q.truth.span()]);
        let spans = spans
            .chain(self.sensors.iter().map(|s| s.updates.span()))
            .chain(self.inputs.iter().map(|i| i.trace.span()));
        spans.flatten().reduce(|a, b| (a.0.min(b.0), a.1.max(b.1)))
    }

    /// The origin of its local coordinates.
    pub(super) fn origin(&self) -> Option<LocalFrame> {
        self.local
    }

    /// Bytes held.
    #[must_use]
    pub fn bytes(&self) -> usize {
        let quantities = [&self.position, &self.velocity, &self.attitude];
        let traces = quantities.into_iter().flat_map(|q| [&q.estimate, &q.truth, &q.error]);
        let traces = traces
            .chain(self.sensors.iter().flat_map(|s| [&s.updates, &s.apart, &s.intervals.series]))
            .chain(self.inputs.iter().map(|i| &i.trace))
            .chain(self.parameters.tracks().flat_map(|p| [&p.estimate, &p.truth]))
            .chain(self.nees.iter().map(|n| &n.series));
        let fixes = self.sensors.iter().flat_map(|s| &s.fixes).map(Samples::bytes);
        let paths = [self.states.bytes(), self.path.bytes(), self.true_path.bytes(), self.mounted.bytes()];
        traces.map(Trace::bytes).chain(fixes).chain(paths).sum()
    }

    fn ned(&mut self, place: &Geodetic) -> Vector3<f64> {
        self.local.get_or_insert_with(|| LocalFrame::new(*place)).to_ned(place)
    }

    /// The same for a place with an unknown (NaN) horizontal position or height. `None` if one of them is unknown
    /// and the frame is not yet known.
    fn known_ned(&mut self, place: &Geodetic) -> Option<Vector3<f64>> {
        let (is_placed, has_height) = (place.lat.is_finite() && place.lon.is_finite(), place.height.is_finite());
        if is_placed && has_height {
            return Some(self.ned(place));
        }
        let frame = self.local?;
        let origin = frame.origin();
        if !is_placed {
            return Some(Vector3::new(f64::NAN, f64::NAN, origin.height - place.height));
        }
        let ned = frame.to_ned(&Geodetic {
            height: origin.height,
            ..*place
        });
        Some(Vector3::new(ned.x, ned.y, f64::NAN))
    }

    fn at_the_reference(&self, at: &Solution, place: Geodetic) -> Geodetic {
        match at.attitude {
            Some((q, _)) if self.frame.lever_arm != Vector3::zeros() => place.offset(&(q * self.frame.lever_arm)),
            _ => place,
        }
    }

    /// The index of the track of `name`; a missing track is created for `residual` rows.
    fn sensor(&mut self, name: &str, residual: usize) -> usize {
        self.sensors.iter().position(|s| s.name == name).unwrap_or_else(|| {
            self.sensors.push(SensorTrack::new(name, residual));
            self.sensors.len() - 1
        })
    }

    fn track(&mut self, name: &str, unit: &str, width: usize, angle: bool, scale: f64) -> usize {
        self.inputs.push(InputTrack {
            name: name.to_owned(),
            unit: unit.to_owned(),
            trace: Trace::new(width, BUCKETS),
            scale,
            angle: angle.then_some(Unwrapped::NONE),
        });
        self.inputs.len() - 1
    }

    fn sample(&mut self, track: usize, time: Time, values: &[f64]) {
        let track = &mut self.inputs[track];
        if values.len() != track.trace.channels() || values.iter().all(|v| !v.is_finite()) {
            return;
        }
        let mut scaled = [0.0; 3];
        for (s, v) in scaled.iter_mut().zip(values) {
            *s = v * track.scale;
        }
        if let Some(angle) = &mut track.angle {
            [scaled[0]] = angle.next([scaled[0]]);
        }
        track.trace.push(time.seconds(), &scaled[..values.len()]);
    }
}

impl RunObserver for Recording {
    fn memory(&mut self) -> Option<&mut dyn Memory> {
        Some(self)
    }

    fn on(&mut self, event: &RunEvent<'_>) -> Result<(), Halt> {
        match event {
            RunEvent::Row(row) => self.row(row),
            RunEvent::Estimate { filter, solution, belief } => {
                self.parameters.estimate(filter, belief);
                if filter.is_outermost() && self.thinning.takes(belief.time) {
                    self.estimate(solution);
                }
            }
            RunEvent::Truth { filter, belief, truth } => self.parameters.truth(filter, belief, truth),
            RunEvent::Reference { filter, epoch, error } if filter.is_outermost() => self.reference(epoch, *error),
            RunEvent::Filter {
                filter,
                event: Event::Updated { sensor, update, time, .. },
            } => {
                let track = filter.first_sensor + sensor;
                // That of smoothed estimates has no sensors.
                let Some(sensor) = self.sensors.get(track) else { return Ok(()) };
                let place = sensor.is_place.then(|| Geodetic::read(update.value));
                self.judged(track, *time, place, update);
            }
            _ => {}
        }
        Ok(())
    }
}

/// The attitude quantity with the mounting, now known, taken out.
pub(super) fn mounted_attitude(samples: &Samples<11>, mounting: &UnitQuaternion<f64>) -> (Trace, Trace) {
    let (mut truth, mut error) = (Trace::new(3, POINTS + 2), Trace::new(6, POINTS + 2));
    let mut angles = Unwrapped::<3>::NONE;
    let quaternion = |c: &[f64]| UnitQuaternion::new_unchecked(Quaternion::new(c[3], c[0], c[1], c[2]));
    for (t, row) in samples.iter() {
        let (estimate, reference) = (quaternion(&row[..4]), quaternion(&row[4..8]));
        let e = attitude_error(&(estimate * mounting), &reference).map(f64::to_degrees);
        error.push(t, &six(&e, &Vector3::new(row[8], row[9], row[10])));
        truth.push(
            t,
            &angles.next(so3::to_rpy(&(reference * mounting.inverse())).map(f64::to_degrees).into()),
        );
    }
    (truth, error)
}

/// The value and its 3σ.
/// An error with its 3σ; not a number along an axis that the reference does not know.
fn deviation(d: &Deviation) -> [f64; 6] {
    let known = |v: Vector3<f64>| Vector3::from_fn(|k, _| if d.known[k] { v[k] } else { f64::NAN });
    six(&known(d.error), &known(d.sigma()))
}

fn six(value: &Vector3<f64>, sigma: &Vector3<f64>) -> [f64; 6] {
    std::array::from_fn(|i| if i < 3 { value[i] } else { 3.0 * sigma[i - 3] })
}
