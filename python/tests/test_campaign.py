"""Campaigns: any split, any order, any number of workers, a worker killed: the same bytes."""

import os
import pickle
import random
import signal
import threading
import time
from concurrent.futures import ProcessPoolExecutor, ThreadPoolExecutor
from multiprocessing import get_context

import fusion
import pytest
from fusion._campaign import _cuts, part

from conftest import RECORDED, SIMULATED

RUNS = 24


@pytest.fixture(scope="module")
def whole():
    return fusion.Design(SIMULATED).montecarlo(RUNS)


def test_any_split_in_any_order_gives_the_same_bytes(whole):
    design = fusion.Design(SIMULATED)
    shuffle = random.Random(3)
    for _ in range(5):
        cuts = sorted({0, RUNS, *(shuffle.randrange(1, RUNS) for _ in range(6))})
        parts = [part(design, first, last, 1, threads=2) for first, last in zip(cuts, cuts[1:])]
        shuffle.shuffle(parts)
        assert fusion.merge(parts).to_csv() == whole.to_csv()


def test_an_executor_gives_the_same_bytes(whole):
    design, told = fusion.Design(SIMULATED), []
    with ThreadPoolExecutor(2) as executor:
        by_threads = design.montecarlo(RUNS, executor=executor, chunk=5, progress=lambda done, all: told.append((done, all)))
    with ProcessPoolExecutor(2, mp_context=get_context("spawn")) as executor:
        by_processes = design.montecarlo(RUNS, executor=executor)
    assert by_threads.to_csv() == by_processes.to_csv() == whole.to_csv()
    assert told[-1] == (RUNS, RUNS) and told == sorted(told)
    assert len(by_processes) == RUNS
    assert list(by_processes.to_pandas()["run"]) == list(range(RUNS))


@pytest.mark.parametrize("runs, workers", [(1, 2), (3, 8), (24, 2), (1000, 2), (100_000, 64)])
def test_parts_shrink_so_that_all_workers_end_together(runs, workers):
    cuts = _cuts(range(7, 7 + runs), None, workers)
    sizes = [last - first for first, last in zip(cuts, cuts[1:])]
    assert cuts[0] == 7 and cuts[-1] == 7 + runs and min(sizes) >= 1
    # A worker that takes the last part ends at most so much later than the others.
    assert sizes[-1] <= max(1, runs / workers / 64)
    # Each part costs a message: their number depends on the workers, not on the runs.
    assert len(sizes) <= 40 * workers
    assert set(_cuts(range(10), 4, workers)) == {0, 4, 8, 10}


def test_a_campaign_tells_its_progress_and_stops_by_an_exception(whole):
    design, told = fusion.Design(SIMULATED), []
    again = design.montecarlo(RUNS, chunk=10, progress=lambda done, all: told.append((done, all)))
    assert again.to_csv() == whole.to_csv() and told == [(10, RUNS), (20, RUNS), (24, RUNS)]

    def stop(done, all):
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        design.montecarlo(RUNS, chunk=1, progress=stop)


def test_ranges_are_parts_of_a_campaign(whole):
    design = fusion.Design(SIMULATED)
    ranges = [design.montecarlo(range(first, first + 8)) for first in (16, 0, 8)]
    assert [len(campaign) for campaign in ranges] == [8, 8, 8]
    assert list(ranges[0].to_pandas()["run"]) == list(range(16, 24))
    assert fusion.merge(campaign.part() for campaign in ranges).to_csv() == whole.to_csv()


def test_a_run_that_fails_is_a_row_with_its_reason(whole):
    assert whole.failed == {} and set(whole.to_pandas()["error"]) == {None}
    nowhere = fusion.Design(RECORDED, data="/nowhere")
    # A range is a part, also without a result: it is merged with the others.
    ranges = [nowhere.montecarlo(range(2, 3)), nowhere.montecarlo(range(2))]
    merged = fusion.merge(campaign.part() for campaign in ranges)
    assert list(merged.failed) == list(merged.to_pandas()["run"]) == [0, 1, 2] and len(merged) == 3
    assert all("design.toml:40:8: `imu.csv` cannot be read" in reason for reason in merged.failed.values())
    assert list(merged.to_pandas()["error"]) == list(merged.failed.values())
    with pytest.raises(fusion.FusionError, match="all runs have failed.*design.toml:40:8"):
        nowhere.montecarlo(3)


def test_parts_that_do_not_belong_together_are_refused():
    design = fusion.Design(SIMULATED)
    first = part(design, 0, 2, 1)
    with pytest.raises(fusion.FusionError, match="part 1.*seed"):
        fusion.merge([first, part(design, 2, 4, 2)])
    with pytest.raises(fusion.FusionError, match="part 1.*design"):
        fusion.merge([first, part(fusion.Design(SIMULATED, set={"sensor.position.noise": "2 m"}), 2, 4, 1)])
    with pytest.raises(fusion.FusionError, match="part 1"):
        fusion.merge([first, first])
    with pytest.raises(fusion.FusionError, match="part 0"):
        fusion.merge([first[:-9]])
    with pytest.raises(fusion.FusionError):
        fusion.merge([first, part(design, 3, 4, 1)])
    with pytest.raises(ValueError, match="runs"):
        design.montecarlo(0)
    with pytest.raises(TypeError, match="cannot be interpreted as an integer"):
        design.montecarlo(2.5)


def test_a_worker_of_dask_that_is_killed_changes_nothing(whole):
    distributed = pytest.importorskip("distributed")
    design = fusion.Design(SIMULATED)
    with distributed.LocalCluster(
        n_workers=2, threads_per_worker=1, processes=True, dashboard_address=None, host="127.0.0.1"
    ) as cluster:
        with distributed.Client(cluster) as client:
            assert design.montecarlo(RUNS, executor=client).to_csv() == whole.to_csv()
            # Workers that compute for some seconds; one of them is killed.
            longer = fusion.Design(SIMULATED.replace('duration = "10 s"', 'duration = "400 s"'))
            expected = longer.montecarlo(RUNS).to_csv()
            victims = list(client.run(os.getpid).values())
            killed = []

            def kill():
                time.sleep(0.3)
                os.kill(victims[0], signal.SIGKILL)
                killed.append(time.monotonic())

            thread = threading.Thread(target=kill)
            thread.start()
            result = longer.montecarlo(RUNS, executor=client, chunk=1)
            ended = time.monotonic()
            thread.join()
            assert killed and killed[0] < ended, "the campaign ended before the kill"
            assert result.to_csv() == expected


def test_a_worker_reads_a_design_once_and_refuses_another_one(tmp_path):
    file = tmp_path / "design.toml"
    file.write_text(SIMULATED)
    design = fusion.Design(file)
    sent = pickle.dumps(design)
    assert pickle.loads(sent) is pickle.loads(sent)
    changed = fusion.Design(file, set={"sensor.position.noise": "3 m"})
    assert pickle.loads(pickle.dumps(changed)).hash == changed.hash != design.hash
    file.write_text(SIMULATED.replace('duration = "10 s"', 'duration = "20 s"'))
    with pytest.raises(fusion.FusionError, match="design.toml.*has changed since"):
        pickle.loads(sent)
