"""Sensors in Python give what the same sensor in Rust gives."""

import fusion
import numpy as np
import pytest

from conftest import RECORDED

WITH_DEPTH = """
[sensor.height]
type = "height"
source = "baro"
noise = "0.5 m"

[source.baro]
type = "csv"
path = "baro.csv"
time.column = "t"
channels.height = { columns = ["h"], unit = "m" }
"""

IN_PYTHON = WITH_DEPTH.replace('type = "height"', 'type = "python"\nfunction = "FUNCTION"').replace("channels.height", "channels.FUNCTION")

A, E2 = 6378137.0, 6.69437999014e-3


@fusion.sensor(reads={"position": "geodetic"}, unit="m")
def height_in_python(place):
    return place[2]


@fusion.sensor(reads={"position": "geodetic"}, unit="m", jacobian=lambda place: [[0, 0, -1]], name="given")
def height_with_its_jacobian(place):
    return place[2]


@fusion.sensor(
    reads={"attitude": "attitude", "velocity": "velocity", "gyro_bias": "vector", "position": "geodetic"}, dim=2, unit="m/s"
)
def of_all_kinds(c, v, bias, place):
    forward = c.T @ v
    return forward[0] + 10 * bias[1], np.linalg.norm(v) * np.cos(place[0])


def baro(rows):
    t = rows["gnss"]["t"]
    return {"t": t, "h": 50.0 + 0.5 * np.sin(t)}


def test_a_height_in_python_gives_the_estimates_of_the_one_in_rust(rows):
    rows = {**rows, "baro": baro(rows)}
    ours = fusion.Design(RECORDED + WITH_DEPTH).run(rows)
    assert (ours.innovations["height"].verdict == "accepted").sum() > 20
    for name in ("height_in_python", "given"):
        theirs = fusion.Design(RECORDED + IN_PYTHON.replace("FUNCTION", name)).run(rows)
        # A central difference of a linear function is exact but for rounding: 1e-16 of 50 m over a step of 6 mm.
        for quantity in ("position", "velocity", "attitude"):
            sigma = ours.sigma[quantity].mean()
            difference = np.abs(theirs.estimates[quantity] - ours.estimates[quantity]).max()
            assert difference < 1e-6 * sigma, (name, quantity)
    assert height_in_python.jacobian_is == "numeric" and height_with_its_jacobian.jacobian_is == "given"
    assert height_in_python([0, 0, 7]) == 7


def test_every_kind_of_quantity_is_read(rows):
    t = rows["gnss"]["t"]
    speeds = {"t": t, "a": 0 * t, "b": 0 * t}
    text = RECORDED + IN_PYTHON.replace("FUNCTION", "of_all_kinds").replace('["h"]', '["a", "b"]').replace('unit = "m"', 'unit = "m/s"').replace('"0.5 m"', '"0.05 m/s"')
    without = fusion.Design(RECORDED).run(rows)
    result = fusion.Design(text).run({**rows, "baro": speeds})
    # A speed of zero at rest makes the velocity better known.
    assert result.sigma["velocity"][-1, 0] < 0.8 * without.sigma["velocity"][-1, 0]
    nis = result.innovations["height"].nis
    assert np.isfinite(nis).all() and nis.mean() < 2


def test_mistakes_are_told():
    text = RECORDED + IN_PYTHON.replace("FUNCTION", "not_there")
    with pytest.raises(fusion.DesignError, match="no function `not_there` is declared by `@fusion.sensor`"):
        fusion.Design(text)
    with pytest.raises(ValueError, match="`position`: the kind `place` is unknown; possible: geodetic"):
        fusion.sensor(reads={"position": "place"})(lambda place: 0.0)
    with pytest.raises(ValueError, match="give the unit of SI"):
        fusion.sensor(reads={"position": "geodetic"}, unit="km")(lambda place: 0.0)


def test_a_wrong_jacobian_is_shown_and_not_used(rows, monkeypatch):
    fusion.sensor(reads={"position": "geodetic"}, unit="m", jacobian=lambda place: [[0, 0, 1]], name="wrong")(lambda place: place[2])
    shown = []
    monkeypatch.setattr("sys.unraisablehook", lambda told: shown.append(str(told.exc_value)))
    result = fusion.Design(RECORDED + IN_PYTHON.replace("FUNCTION", "wrong")).run({**rows, "baro": baro(rows)})
    assert set(result.innovations["height"].verdict) == {"undefined"}
    assert "the Jacobian of `wrong` has 1.000000e0 in row 0, axis 2; differences give -1.0" in shown[0]


def test_an_exception_leaves_the_measurement_out_and_is_shown(rows, monkeypatch):
    @fusion.sensor(reads={"position": "geodetic"}, unit="m")
    def fails(place):
        raise RuntimeError("no chart of this place")

    shown = []
    monkeypatch.setattr("sys.unraisablehook", lambda told: shown.append(str(told.exc_value)))
    result = fusion.Design(RECORDED + IN_PYTHON.replace("FUNCTION", "fails")).run({**rows, "baro": baro(rows)})
    assert set(result.innovations["height"].verdict) == {"undefined"}
    assert shown and set(shown) == {"no chart of this place"}
    assert len(result.estimates) > 1000


def test_a_sensor_that_asks_the_navigator_that_calls_it_has_an_error(rows, monkeypatch):
    asked = {}

    @fusion.sensor(reads={"position": "geodetic"}, unit="m")
    def asks(place):
        return asked["navigator"].solution["position"][2]

    shown = []
    monkeypatch.setattr("sys.unraisablehook", lambda told: shown.append(str(told.exc_value)))
    nav = asked["navigator"] = fusion.Navigator(fusion.Design(RECORDED + IN_PYTHON.replace("FUNCTION", "asks")))
    imu, gnss = rows["imu"], rows["gnss"]
    nav.feed("gnss", 0.0, [0.63, 2.26, 50.0])
    axes = np.column_stack([imu[name] for name in ("gx", "gy", "gz", "ax", "ay", "az")])
    table = axes * np.repeat([np.pi / 180, 9.80665], 3)
    nav.feed("imu", imu["t"][:2900], table[:2900])
    nav.feed("baro", 29.0, [50.0])
    nav.feed("imu", imu["t"][2900:], table[2900:])
    assert shown and "this filter is at work" in shown[0]
    assert nav.solution is not None
