"""Noises from innovations."""

from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context

import fusion

from conftest import SIMULATED

WORLD = SIMULATED.replace('duration = "10 s"', 'duration = "300 s"')


def test_a_noise_that_is_declared_too_large_is_found():
    design = fusion.Design(WORLD, set={"sensor.position.noise": "3 m"})
    tuned = design.tune(params=["sensor.position.noise"])
    (found,) = tuned.found
    assert found["path"] == "sensor.position.noise" and found["is_identifiable"]
    # The world has 1 m.
    assert found["low"] < 1 / 3 < found["high"]
    assert tuned.is_better and tuned.gain > 0
    assert list(tuned.changes) == ["sensor.position.noise"], tuned.changes
    better = tuned.design.run(seed=7).score["nees_position"]["mean"]
    assert better > design.run(seed=7).score["nees_position"]["mean"]


def test_searches_from_several_starts_give_the_same_result_on_workers():
    design = fusion.Design(WORLD, set={"sensor.position.noise": "3 m"})
    starts = [{"sensor.position.noise": "0.1 m"}, {"sensor": {"position": {"noise": "30 m"}}}]
    alone = design.tune(params=["sensor.position.noise"], starts=starts)
    with ProcessPoolExecutor(2, mp_context=get_context("spawn")) as executor:
        spread = design.tune(params=["sensor.position.noise"], starts=starts, executor=executor)
    assert spread.found == alone.found and spread.gain == alone.gain
