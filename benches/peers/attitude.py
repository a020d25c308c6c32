"""The attitude of an inertial and magnetic unit: VQF, and the filters of Madgwick and Mahony, on trials of BROAD."""

import gzip
import importlib.metadata
import json
import time

import common

RATE = 285.714  # Hz
TRIALS = {"02, slow rotation": ("02", []), "15, fast translation": ("15", ["--variant", "trial_15"])}
TRIALS["31, a magnet near by"] = ("31", ["--variant", "trial_31"])
# The gain of Madgwick is the one in use for such units, that of Mahony the best of four on trial 02.
MADGWICK, MAHONY = {"gain": 0.05}, {"k_P": 0.4, "k_I": 1e-6}


def judged(np, columns, estimate):
    """RMS of heading and inclination [deg], as the benchmark computes them, over the time in which the unit moves."""
    w, x, y, z = columns("q", "wxyz").T
    a, b, c, d = estimate.T
    # The product of the estimate and the inverse of the reference.
    ew, ex = a * w + b * x + c * y + d * z, -a * x + b * w - c * z + d * y
    ey, ez = -a * y + b * z + c * w - d * x, -a * z - b * y + c * x + d * w
    heading = 2 * np.arctan2(ez, ew)
    # `ahrs` counts from another axis: by quarter turns.
    heading -= np.pi / 2 * np.round(np.nanmedian(heading) / (np.pi / 2))
    heading = (heading + np.pi) % (2 * np.pi) - np.pi
    inclination = 2 * np.arccos(np.clip(np.hypot(ew, ez), 0, 1))
    moves = (columns("moving", [""])[:, 0] == 1) & np.isfinite(w)
    assert abs(ex**2 + ey**2 + ez**2 + ew**2 - 1)[moves].max() < 1e-3, "quaternions of length one"
    return [float(np.degrees(np.sqrt(np.mean(error[moves] ** 2)))) for error in (heading, inclination)]


def opened(np, path):
    """A table of a trial; its columns by name and axes."""
    with gzip.open(path, "rt") as file:
        names = file.readline().strip().split(",")
        values = np.genfromtxt(file, delimiter=",")

    def columns(name, axes="xyz"):
        return np.ascontiguousarray(values[:, [names.index(f"{name}_{a}" if a else name) for a in axes]])

    return columns


def compare(_options):
    folder = common.data_set("broad_ahrs") / "derived"
    common.python_packages("vqf==2.1.2", "ahrs==0.4.0", "numpy")
    import ahrs
    import numpy as np
    import vqf

    def with_ahrs(kind, gains):
        return lambda gyr, acc, mag: kind(gyr=gyr, acc=acc, mag=mag, frequency=RATE, **gains).Q

    peers = {
        "VQF": lambda gyr, acc, mag: vqf.VQF(1 / RATE).updateBatch(gyr, acc, mag)["quat9D"],
        "Madgwick": with_ahrs(ahrs.filters.Madgwick, MADGWICK),
        "Mahony": with_ahrs(ahrs.filters.Mahony, MAHONY),
    }
    program, body, worse = common.fusion(), [], []
    for name, (trial, variant) in TRIALS.items():
        columns = opened(np, folder / f"{trial}.csv.gz")
        cells, found = [name], {}
        for peer, run in peers.items():
            began = time.perf_counter()
            estimate = run(*(columns(kind) for kind in ("gyr", "acc", "mag")))
            taken = time.perf_counter() - began
            found[peer] = judged(np, columns, estimate)
            cells.append("{:.2f} / {:.2f}, {:.2f} s".format(*found[peer], taken))
        out = common.PEERS / "broad"
        design = common.ROOT / "configs" / "real" / "broad.toml"
        _, taken, _ = common.timed(program, "run", design, *variant, "--data", common.DATA, "--out", out)
        score = json.loads((out / "summary.json").read_text())["score"]
        ours = [score["heading_rmse_deg"], score["inclination_rmse_deg"]]
        cells.insert(1, "{:.2f} / {:.2f}, {:.2f} s".format(*ours, taken))
        for k, what in enumerate(("heading", "inclination")):
            best = min(found, key=lambda peer: found[peer][k])
            if found[best][k] < ours[k] - 0.005:
                worse.append(f"{name}: {what} {ours[k]:.2f}°, {best} {found[best][k]:.2f}°")
        body.append(cells)
    versions = [f"{package} {importlib.metadata.version(package)}" for package in ("vqf", "ahrs")]
    text = f"{', '.join(versions)}; {common.machine()}. Heading / inclination [deg], RMS while the unit moves, and the time.\n\n"
    text += common.table(["trial of BROAD", "ours", *peers], body)
    return text + "\nWhere a peer is better: " + ("; ".join(worse) or "nowhere") + ".\n"
