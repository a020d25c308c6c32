"""Noises from innovations."""

import pickle
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context

import fusion
from fusion._design import _Searches

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


def test_a_worker_decodes_the_logs_of_its_searches_once():
    design = fusion.Design(WORLD)
    work = _Searches(design, ["sensor.position.noise"], [{}], 0.0, 10, [])
    sent = pickle.dumps(work)
    assert pickle.loads(sent).logs is pickle.loads(sent).logs
    other = pickle.dumps(_Searches(design, ["sensor.position.noise"], [{}], 0.0, 20, []))
    assert pickle.loads(other).logs is not pickle.loads(sent).logs
