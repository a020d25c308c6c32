"""A robot in the plane: filterpy and ours on the benchmark `localization` of the UKF-M project."""

import csv
import importlib.metadata
import time

import common

SPEED_NOISE, FIX, DT, SECONDS, SEEDS = 0.01, 1.0, 0.01, 40, 40
CHARTS = ("error_state", "invariant")


def drawn(np, seed):
    """Truth (north, east, heading) each second, rows of odometry, and fixes."""
    random = np.random.default_rng(seed)
    noise = np.array([SPEED_NOISE, SPEED_NOISE, np.radians(1.0)])
    pose = np.array([0.0, 0.0, np.radians(45) * random.standard_normal()])
    poses, speed, rate = [], 2 * np.pi * 5 / SECONDS, 2 * np.pi / SECONDS
    for k in range(100 * SECONDS):
        middle = pose[2] + 0.5 * rate * DT
        pose = pose + np.array([speed * np.cos(middle), speed * np.sin(middle), rate]) * DT
        if (k + 1) % 100 == 0:
            poses.append(pose)
    poses = np.array(poses)
    odometry = [speed, 0, rate] + noise * random.standard_normal((100 * SECONDS, 3))
    return poses, odometry, poses[:, :2] + FIX * random.standard_normal((SECONDS, 2))


def with_filterpy(np, odometry, fixes):
    """States and 1σ each second of the extended Kalman filter of filterpy."""
    from filterpy.kalman import ExtendedKalmanFilter

    noise = np.diag([SPEED_NOISE**2, SPEED_NOISE**2, np.radians(1.0) ** 2])
    ekf = ExtendedKalmanFilter(dim_x=3, dim_z=2)
    ekf.x, ekf.R = np.zeros(3), np.eye(2) * FIX**2
    ekf.P = np.diag([1e-12, 1e-12, np.radians(45) ** 2])
    found = []
    for second, fix in enumerate(fixes):
        for forward, right, rate in odometry[100 * second : 100 * second + 100]:
            c, s = np.cos(ekf.x[2]), np.sin(ekf.x[2])
            north, east = c * forward - s * right, s * forward + c * right
            ekf.x = ekf.x + np.array([north, east, rate]) * DT
            phi = np.array([[1, 0, -east * DT], [0, 1, north * DT], [0, 0, 1]])
            g = np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]]) * DT
            ekf.P = phi @ ekf.P @ phi.T + g @ noise @ g.T
        ekf.update(fix, lambda x: np.eye(2, 3), lambda x: x[:2])
        found.append((*ekf.x, *np.sqrt(np.diag(ekf.P)[:2])))
    return np.array(found)


def with_ours(np, program, chart, odometry, fixes):
    """States and 1σ each second of our command, which reads files of text."""
    folder = common.PEERS / "robot"
    folder.mkdir(exist_ok=True)
    with open(folder / "odometry.csv", "w", newline="") as file:
        rows = csv.writer(file)
        rows.writerow(["t", "forward", "right", "rate"])
        # The row at 0 s starts the filter.
        rows.writerows([k * DT, *map(float, odometry[max(k - 1, 0)])] for k in range(len(odometry) + 1))
    with open(folder / "gnss.csv", "w", newline="") as file:
        rows = csv.writer(file)
        rows.writerow(["t", "n", "e", "d"])
        rows.writerows([k + 1, *map(float, fix), 0] for k, fix in enumerate(fixes))
    out = folder / "out"
    common.run(program, "run", common.DESIGNS / "robot.toml", "--backend", chart, "--data", folder, "--out", out)
    found = []
    with open(out / "estimates.csv") as file:
        for row in csv.DictReader(file):
            second = float(row["t_s"])
            if second > 0.5 and abs(second - round(second)) < 1e-6:
                state = [float(row[name]) for name in ("n_m", "e_m", "yaw_deg", "sigma_n_m", "sigma_e_m")]
                found.append([*state[:2], np.radians(state[2]), *state[3:]])
    return np.array(found)


def scored(np, run):
    """RMS of place and heading and NEES over its dimension, over the last 20 s, and milliseconds of a run."""
    errors, nees, taken = [], [], 0.0
    for seed in range(SEEDS):
        poses, odometry, fixes = drawn(np, seed)
        began = time.perf_counter()
        found = run(odometry, fixes)
        taken += time.perf_counter() - began
        error = found[20:, :3] - poses[20:]
        error[:, 2] = (error[:, 2] + np.pi) % (2 * np.pi) - np.pi
        errors.append(error)
        nees.append((error[:, :2] ** 2 / found[20:, 3:] ** 2).mean())
    errors = np.concatenate(errors)
    distance = np.sqrt((errors[:, :2] ** 2).sum(axis=1).mean())
    heading = np.degrees(np.sqrt((errors[:, 2] ** 2).mean()))
    return [f"{distance:.3f}", f"{heading:.2f}", f"{np.mean(nees):.2f}", f"{1e3 * taken / SEEDS:.0f}"]


def compare(_options):
    common.python_packages("filterpy==2.0.0", "numpy")
    import numpy as np

    program = common.fusion()
    body = [["filterpy, EKF", *scored(np, lambda *rows: with_filterpy(np, *rows))]]
    for chart in CHARTS:
        body.append([f"ours, `{chart}`", *scored(np, lambda *rows, chart=chart: with_ours(np, program, chart, *rows))])
    text = f"filterpy {importlib.metadata.version('filterpy')}, {SEEDS} robots; {common.machine()}. "
    text += "The time of ours has the start of the program and its files of text.\n\n"
    return text + common.table(["filter", "place RMS [m]", "heading RMS [deg]", "NEES, 1 is ideal", "a run [ms]"], body)
