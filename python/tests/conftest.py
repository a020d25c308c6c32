"""What all tests share."""

import os
from pathlib import Path

import numpy as np
import pytest

REPOSITORY = Path(__file__).parents[2]

#: A vehicle that drives straight, with an inertial unit and a receiver.
SIMULATED = (REPOSITORY / "python" / "tests" / "simulated.toml").read_text()

#: The same filter over two sources.
RECORDED = (REPOSITORY / "python" / "tests" / "recorded.toml").read_text()


@pytest.fixture(scope="session")
def rows():
    """Rows of a unit [deg/s, g] and of a receiver [deg, m] at rest, as arrays."""
    t = 0.01 * np.arange(3001)
    random = np.random.default_rng(1)
    imu = {"t": t}
    for axis, mean in zip("xyz", (0, 0, 0)):
        imu["g" + axis] = mean + 0.01 * random.standard_normal(t.size)
    for axis, mean in zip("xyz", (0, 0, -0.9987)):
        imu["a" + axis] = mean + 1e-4 * random.standard_normal(t.size)
    s = t[::50]
    gnss = {"t": s, "lat": 36.1 + 1e-5 * random.standard_normal(s.size), "lon": 129.5 + 0 * s, "h": 50 + 0 * s}
    return {"imu": imu, "gnss": gnss}


@pytest.fixture(scope="session")
def data():
    """The folder of the recorded logs, which are no part of the project."""
    folder = Path(os.environ.get("FUSION_DATA", REPOSITORY.parent / "shared" / "data"))
    if not folder.is_dir():
        pytest.skip(f"no recorded logs at {folder}")
    return folder
