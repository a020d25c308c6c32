"""A factor graph of gtsam and our smoother over the log of a car: combined IMU factors, positions and velocities of GNSS.

`graphs.py FOLDER OUT` builds and solves the graph; it runs as a process, so that its memory is known.
"""

import csv
import gzip
import importlib.metadata
import math
import sys

import common

# What configs/real/pntos-car.toml declares: the origin, the start, and the latencies of position and velocity.
LATITUDE, LONGITUDE, HEIGHT = 0.693899604, -1.467992068, 225.5
START, LATE, LATE_VELOCITY = 60.0, 0.1, 0.3  # s
GYRO, GYRO_WALK = math.radians(0.007), 9.4e-6
ACCEL, ACCEL_WALK = 0.01373, 1.32e-4
JUDGED_FROM, REFERENCE_AHEAD = 200.0, 1.2  # s, m


def table(np, path):
    """The columns of a table by name."""
    with gzip.open(path, "rt") if path.suffix == ".gz" else open(path) as file:
        names = file.readline().strip().split(",")
        values = np.genfromtxt(file, delimiter=",")
    return {name: values[:, k] for k, name in enumerate(names)}


def local(np, rows):
    """North, east, down of rows with latitude, longitude and height, by way of Earth-centred coordinates on WGS-84."""
    a, e2 = 6378137.0, 6.69437999014e-3

    def earth_fixed(latitude, longitude, height):
        n = a / np.sqrt(1 - e2 * np.sin(latitude) ** 2)
        level = (n + height) * np.cos(latitude)
        return np.stack([level * np.cos(longitude), level * np.sin(longitude), (n * (1 - e2) + height) * np.sin(latitude)])

    away = earth_fixed(rows["lat_rad"], rows["lon_rad"], rows["h_m"]).T - earth_fixed(LATITUDE, LONGITUDE, HEIGHT)
    (s, c), (sl, cl) = ((math.sin(x), math.cos(x)) for x in (LATITUDE, LONGITUDE))
    return away @ np.array([[-s * cl, -s * sl, c], [-sl, cl, 0], [-c * cl, -c * sl, -s]]).T


def events(np, gnss, begin):
    """Positions and velocities of GNSS by the time of their validity: (time, kind, north-east-down)."""
    place = local(np, gnss)
    velocity = np.stack([gnss[f"v{axis}_mps"] for axis in "ned"], axis=1)
    found = [(t - LATE, "position", place[k]) for k, t in enumerate(gnss["t_s"])]
    found += [(t - LATE_VELOCITY, "velocity", velocity[k]) for k, t in enumerate(gnss["t_s"])]
    return sorted((e for e in found if e[0] >= begin), key=lambda e: e[0])


def solve(folder, out):
    """The most probable path from the first motion on, written as north, east, down, roll, pitch, yaw."""
    import gtsam
    import numpy as np

    imu, gnss = (table(np, folder / name) for name in ("imu.csv.gz", "gnss.csv"))
    times, step = imu["t_s"], 0.01
    force = np.stack([imu[f"dv{axis}_mps"] for axis in "xyz"], axis=1) / step
    rate = np.stack([imu[f"dth{axis}_rad"] for axis in "xyz"], axis=1) / step
    course = next(k for k, t in enumerate(gnss["t_s"]) if t > START and math.hypot(gnss["vn_mps"][k], gnss["ve_mps"][k]) > 3)
    rest = (times > START) & (times < START + 5)
    f, bias = force[rest].mean(axis=0), rate[rest].mean(axis=0)
    level = math.atan2(-f[1], -f[2]), math.atan2(f[0], math.hypot(f[1], f[2]))
    yaw = math.atan2(gnss["ve_mps"][course], gnss["vn_mps"][course])
    # North-east-down, gravity along the third axis.
    attitude = gtsam.Rot3.Ypr(yaw, level[1], level[0])
    timed = events(np, gnss, gnss["t_s"][course] - LATE_VELOCITY)

    settings = gtsam.PreintegrationCombinedParams.MakeSharedD(9.8011)
    settings.setGyroscopeCovariance(np.eye(3) * GYRO**2)
    settings.setAccelerometerCovariance(np.eye(3) * ACCEL**2)
    settings.setIntegrationCovariance(np.eye(3) * 1e-8)
    settings.setBiasOmegaCovariance(np.eye(3) * GYRO_WALK**2)
    settings.setBiasAccCovariance(np.eye(3) * ACCEL_WALK**2)

    def sigmas(*values):
        return gtsam.noiseModel.Diagonal.Sigmas(np.array(values, dtype=float))

    x, v, b = (gtsam.symbol_shorthand.X, gtsam.symbol_shorthand.V, gtsam.symbol_shorthand.B)
    first = np.array([gnss[f"v{axis}_mps"][course] for axis in "ned"])
    state = gtsam.NavState(attitude, local(np, gnss)[course], first)
    constant = gtsam.imuBias.ConstantBias(np.zeros(3), bias)
    graph, values = gtsam.NonlinearFactorGraph(), gtsam.Values()
    graph.add(gtsam.PriorFactorPose3(x(0), state.pose(), sigmas(0.005, 0.005, math.radians(5), 3, 3, 5)))
    graph.add(gtsam.PriorFactorVector(v(0), first, sigmas(1, 1, 0.5)))
    spread = sigmas(*3 * [0.05], *3 * [math.radians(0.03)])
    graph.add(gtsam.PriorFactorConstantBias(b(0), constant, spread))
    sample, now = int(np.searchsorted(times, timed[0][0])), timed[0][0]
    for k, (moment, kind, value) in enumerate(timed):
        if k > 0:
            moved = gtsam.PreintegratedCombinedMeasurements(settings, constant)
            while now < moment - 1e-6 and sample < len(times):
                until = min(times[sample], moment)
                if until > now:
                    moved.integrateMeasurement(force[sample], rate[sample], until - now)
                    now = until
                sample += times[sample] <= moment
            graph.add(gtsam.CombinedImuFactor(x(k - 1), v(k - 1), x(k), v(k), b(k - 1), b(k), moved))
            state = moved.predict(state, constant)
        # The path is linearised at the fixes.
        if kind == "position":
            graph.add(gtsam.GPSFactor(x(k), value, sigmas(1.5, 1.5, 2)))
            state = gtsam.NavState(state.attitude(), value, state.velocity())
        else:
            graph.add(gtsam.PriorFactorVector(v(k), value, sigmas(0.07, 0.07, 0.15)))
            state = gtsam.NavState(state.attitude(), state.position(), value)
        values.insert(x(k), state.pose())
        values.insert(v(k), state.velocity())
        values.insert(b(k), constant)
    found = gtsam.LevenbergMarquardtOptimizer(graph, values).optimize()
    with open(out, "w", newline="") as file:
        rows = csv.writer(file)
        rows.writerow(["t_s", "n_m", "e_m", "d_m", "roll_deg", "pitch_deg", "yaw_deg"])
        for k, (moment, _, _) in enumerate(timed):
            pose = found.atPose3(x(k))
            rows.writerow([moment, *pose.translation(), *np.degrees(pose.rotation().rpy())])


def judged(np, estimate, reference):
    """RMS of the horizontal position [m] and of the heading about its mean difference [deg]."""
    keep = (estimate["t_s"] > JUDGED_FROM) & (estimate["t_s"] < reference["t_s"][-1])
    t, roll, pitch, yaw = (estimate[n][keep] for n in ("t_s", "roll_deg", "pitch_deg", "yaw_deg"))
    heading, pitch = np.radians(yaw), np.radians(pitch)
    true = local(np, reference)
    # The reference's point is ahead of the unit.
    north = estimate["n_m"][keep] + REFERENCE_AHEAD * np.cos(pitch) * np.cos(heading) - np.interp(t, reference["t_s"], true[:, 0])
    east = estimate["e_m"][keep] + REFERENCE_AHEAD * np.cos(pitch) * np.sin(heading) - np.interp(t, reference["t_s"], true[:, 1])
    w, x, y, z = (reference[name] for name in ("qw", "qx", "qy", "qz"))
    truth = np.interp(t, reference["t_s"], np.unwrap(np.arctan2(2 * (w * z + x * y), 1 - 2 * (y * y + z * z))))
    error = np.unwrap(heading) - truth
    return np.sqrt(np.mean(north**2 + east**2)), np.degrees(np.std(error))


def compare(_options):
    folder = common.data_set("pntos_cobra_car") / "derived"
    common.python_packages("gtsam==4.3.0", "numpy")
    import numpy as np

    reference = table(np, folder / "ref_20hz.csv.gz")
    out, program = common.PEERS / "graph", common.fusion()
    out.mkdir(exist_ok=True)
    _, seconds, memory = common.timed(sys.executable, __file__, folder, out / "gtsam.csv")
    body = [["gtsam, combined IMU factors", *judged(np, table(np, out / "gtsam.csv"), reference), seconds, memory]]
    design = common.ROOT / "configs" / "real" / "pntos-car.toml"
    # The same information: no constraint of the wheels, no rest, no slow error of the position, nothing estimated of the
    # antenna and the latencies.
    equal = ["sensor.wheels.enabled=false", "sensor.standing.enabled=false", "sensor.resting_gyros.enabled=false"]
    equal += ["sensor.gnss_position.bias=[0, 0, 0]", 'sensor.gnss_position.noise.sigma=["1.5 m", "1.5 m", "2 m"]']
    equal += ['sensor.gnss_position.time_offset="0.1 s"', 'sensor.gnss_velocity.time_offset="0.3 s"']
    equal += ["sensor.gnss_position.lever_arm=[0, 0, 0]", "sensor.gnss_velocity.lever_arm=[0, 0, 0]"]
    for name, changes in (("ours, the same factors, `--smooth`", equal), ("ours, pntos-car as shipped, `--smooth`", [])):
        options = [part for change in changes for part in ("--set", change)]
        command = (program, "run", design, "--data", common.DATA, "--smooth", "--out", out / "ours", *options)
        _, seconds, memory = common.timed(*command)
        body.append([name, *judged(np, table(np, out / "ours" / "smoothed.csv"), reference), seconds, memory])
    text = f"gtsam {importlib.metadata.version('gtsam')}, by its Python package; {common.machine()}. "
    text += "The heading is without its mean difference; times and memory are those of the processes.\n\n"
    head = ["smoother", "horizontal RMS [m]", "heading [deg]", "processor [s]", "memory [MB]"]
    return text + common.table(head, [[n, f"{p:.2f}", f"{h:.2f}", f"{s:.1f}", f"{m:.0f}"] for n, p, h, s, m in body])


if __name__ == "__main__":
    solve(common.Path(sys.argv[1]), common.Path(sys.argv[2]))
