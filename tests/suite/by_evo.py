"""Figures of evo that tests of trajectories are held against (evo 1.38.1).

    python3 by_evo.py                               the trajectory of src/score/trajectory/tests.rs
    python3 by_evo.py REFERENCE.tum ESTIMATE.tum    those of `cargo run --example tum`

The first three blocks are what `evo_ape tum` prints (with `-r trans_part` and `-r angle_deg`, without and with
`--align`), those of RPE what `evo_rpe tum --delta D --delta_unit m` prints (with and without `--all_pairs`). evo has no
option for an alignment about the vertical: its Umeyama alignment is called in the plane, and the heights are centred.
"""

import copy
import sys

import numpy as np
from evo.core import geometry, lie_algebra, metrics
from evo.core.trajectory import PoseTrajectory3D
from evo.core.units import Unit
from evo.tools import file_interface
from scipy.spatial.transform import Rotation


def made():
    k = np.arange(400)
    reference = np.array([20 * np.cos(0.02 * k), 15 * np.sin(0.03 * k), 2 * np.sin(0.05 * k)]).T
    angles = np.array([0.02 * k, 0.05 * np.cos(0.07 * k), 0.1 * np.sin(0.1 * k)]).T
    turned = Rotation.from_euler("ZYX", angles)
    motion = Rotation.from_euler("ZYX", [0.3, 0.0, 0.02])
    noise = np.array([0.05 * np.sin(1.3 * k), 0.04 * np.cos(2.1 * k), 0.03 * np.sin(0.7 * k)]).T
    estimate = motion.apply(reference * (1 + 1e-3 * k[:, None] / 400)) + [1.0, -2.0, 0.5] + noise
    small = Rotation.from_rotvec(0.01 * np.array([np.sin(0.9 * k), np.cos(0.4 * k), np.sin(0.2 * k)]).T)
    poses = [(estimate, motion * turned * small), (reference, turned)]
    return [PoseTrajectory3D(p, q.as_quat()[:, [3, 0, 1, 2]], 0.1 * k) for p, q in poses]


def show(name, metric):
    s = metric.get_all_statistics()
    keys = ["rmse", "mean", "median", "std", "min", "max"]
    print(f"{name}: {len(metric.error)}, [" + ", ".join(f"{s[key]:.12}" for key in keys) + "]")


def main():
    if len(sys.argv) > 1:
        reference, estimate = [file_interface.read_tum_trajectory_file(f) for f in sys.argv[1:3]]
    else:
        estimate, reference = made()
    aligned = copy.deepcopy(estimate)
    aligned.align(reference)
    r, t, _ = geometry.umeyama_alignment(estimate.positions_xyz.T[:2], reference.positions_xyz.T[:2])
    down = (reference.positions_xyz - estimate.positions_xyz)[:, 2].mean()
    yaw = copy.deepcopy(estimate)
    yaw.transform(lie_algebra.se3(np.block([[r, np.zeros((2, 1))], [np.zeros((1, 2)), 1.0]]), np.append(t, down)))
    parts = [("m", metrics.PoseRelation.translation_part), ("deg", metrics.PoseRelation.rotation_angle_deg)]
    for name, poses in [("none", estimate), ("yaw", yaw), ("se3", aligned)]:
        for unit, part in parts:
            ape = metrics.APE(part)
            ape.process_data((reference, poses))
            show(f"APE {name} {unit}", ape)
    for distance in [1.0, 10.0]:
        for pairs in [False, True]:
            for unit, part in parts:
                rpe = metrics.RPE(part, distance, Unit.meters, all_pairs=pairs)
                rpe.process_data((reference, estimate))
                show(f"RPE {distance} {'all' if pairs else 'consecutive'} {unit}", rpe)


main()
