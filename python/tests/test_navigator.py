"""The filter inside a program."""

import threading

import fusion
import numpy as np
import pytest

from conftest import REPOSITORY

EMBEDDED = REPOSITORY / "examples" / "embed.toml"
G = -9.794


def rows(first=0, last=3000):
    t = 0.01 * np.arange(first, last)
    random = np.random.default_rng(first)
    return t, np.array([0, 0, 0, 0, 0, G]) + 1e-4 * random.standard_normal((t.size, 6))


def started():
    nav = fusion.Navigator(EMBEDDED)
    for second in range(30):
        nav.feed("gnss", float(second), [0.63, 2.26, 50.0])
        nav.feed("imu", *rows(100 * second, 100 * second + 100))
    return nav


def test_rows_in_arrays_are_rows_one_by_one():
    nav, single = started(), fusion.Navigator(EMBEDDED)
    for second in range(30):
        single.feed("gnss", float(second), [0.63, 2.26, 50.0])
        for time, row in zip(*rows(100 * second, 100 * second + 100)):
            single.feed("imu", time, row)
    assert nav.solution == single.solution
    assert nav.checkpoint() == single.checkpoint()
    assert nav.solution["time"] == pytest.approx(29.99)
    assert nav.health[0] == "good", nav


def test_the_solution_after_each_row_is_that_of_a_filter_fed_row_by_row():
    nav, single = fusion.Navigator(EMBEDDED), fusion.Navigator(EMBEDDED)
    t, imu = rows(0, 2000)
    for each in (nav, single):
        each.feed("gnss", 0.0, [0.63, 2.26, 50.0])
    after = nav.feed("imu", t, imu, solutions=True)
    assert after["time"].shape == (2000,) and after["sigma_velocity"].shape == (2000, 3)
    for k in range(t.size):
        single.feed("imu", t[k], imu[k])
        if single.solution is None:
            assert np.isnan(after["time"][k]) and np.all(np.isnan(after["position"][k]))
        else:
            assert all(np.array_equal(after[name][k], value) for name, value in single.solution.items())
    assert np.isnan(after["time"][0]) and after["time"][-1] == t[-1]
    assert nav.feed("imu", t[-1:] + 0.01, imu[-1:]) is None


def test_it_tells_what_it_needs_and_what_it_has():
    nav = fusion.Navigator(EMBEDDED)
    assert nav.solution is None and nav.states is None and nav.predict(1.0) is None
    assert set(nav.waits_for) == {"initial.level", "initial.fix"}
    assert nav.streams["gnss"] == {"position": slice(0, 3)}
    nav = started()
    values, sigma = nav.states["gyro_bias"]
    assert values.shape == sigma.shape == (3,) and np.all(sigma > 0)
    # Without rows, the uncertainty grows.
    now, later = nav.predict(30.0), nav.predict(40.0)
    assert later["sigma_position"][0] > now["sigma_position"][0]


def test_a_checkpoint_goes_on_with_the_same_bits():
    nav = started()
    other = fusion.Navigator(EMBEDDED)
    other.restore(nav.checkpoint())
    for each in (nav, other):
        each.feed("imu", *rows(3000, 3500))
    assert nav.solution == other.solution
    with pytest.raises(fusion.DataError):
        other.restore(b"not a checkpoint")


def test_impossible_rows_are_refused_with_their_number():
    nav = started()
    t, table = rows(3000, 3010)
    table[4] = 1e12
    with pytest.raises(fusion.DataError, match="^row 4: stream `imu`, channel `angular_rate`"):
        nav.feed("imu", t, table)
    with pytest.raises(fusion.DataError, match="no stream is called `lidar`; there are: `imu`, `gnss`"):
        nav.feed("lidar", 0.0, [1])
    with pytest.raises(fusion.DataError, match="row 0: .*6"):
        nav.feed("imu", [31.0], np.zeros((1, 5)))
    with pytest.raises(fusion.DataError, match="not a stamp"):
        nav.feed("imu", np.nan, np.zeros(6))
    with pytest.raises(ValueError, match=r"time has the shape \(3,\) and rows \(2, 6\)"):
        nav.feed("imu", np.arange(3.0), np.zeros((2, 6)))


def test_threads_take_turns():
    nav = started()
    read = []

    def reader():
        for _ in range(200):
            read.append(nav.solution["time"])

    threads = [threading.Thread(target=reader) for _ in range(3)]
    for thread in threads:
        thread.start()
    nav.feed("imu", *rows(3000, 20_000))
    for thread in threads:
        thread.join()
    assert len(read) == 600 and all(np.isfinite(read))
    assert nav.solution["time"] == pytest.approx(199.99)
