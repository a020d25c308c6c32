"""Runs: their arrays, their tables, and rows in place of files."""

import subprocess
import sys
import threading

import fusion
import numpy as np
import pytest

from conftest import RECORDED, REPOSITORY, SIMULATED

FOLDERS = (".", "backends", "published", "series", "templates")
CONFIGS = [path for folder in FOLDERS for path in sorted((REPOSITORY / "configs" / folder).glob("*.toml"))]
RECORDED_CONFIGS = sorted((REPOSITORY / "configs" / "real").glob("*.toml"))


def read(path):
    """A CSV file as an array; an empty cell is NaN."""
    return np.genfromtxt(path, delimiter=",", skip_header=1, encoding="utf-8")


def equals_the_file(design, folder, **options):
    result = design.run(out=folder, **options)
    with open(folder / "estimates.csv", encoding="utf-8") as file:
        header = file.readline().strip()
    assert ",".join(result.estimates.columns) == header
    written, expected = result.estimates.written(), read(folder / "estimates.csv")
    assert np.array_equal(written, expected, equal_nan=True)
    return result


@pytest.mark.parametrize("path", CONFIGS, ids=lambda path: path.stem)
def test_the_arrays_are_those_of_the_file(path, tmp_path):
    design = fusion.Design(path)
    # The whole sea trial takes long; all designs have started by then.
    shorter = design.with_changes({"run.stop": "600 s"} if design.is_simulated else {})
    result = equals_the_file(shorter, tmp_path / "out")
    assert len(result.estimates) > 10


@pytest.mark.parametrize("path", RECORDED_CONFIGS, ids=lambda path: path.stem)
def test_the_arrays_of_recorded_logs_are_those_of_the_file(path, data, tmp_path):
    design = fusion.Design(path, data=data)
    assert len(equals_the_file(design, tmp_path / "out").estimates) > 10


def test_arrays_are_views_of_one_table_and_agree_with_the_table():
    result = fusion.Design(SIMULATED).run()
    velocity = result.estimates["velocity"]
    assert velocity.base is not None and np.shares_memory(velocity, result.estimates["position"].base)
    frame = result.to_pandas()
    assert list(frame.columns) == result.estimates.columns
    assert np.array_equal(frame[["vn_mps", "ve_mps", "vd_mps"]], velocity)
    assert np.array_equal(frame["yaw_deg"], np.degrees(result.estimates["attitude"][:, 2]))
    assert np.array_equal(frame["sigma_n_m"], result.sigma["position"][:, 0])
    assert np.array_equal(frame["gyro_bias_z"], result.estimates["gyro_bias"][:, 2])
    assert np.array_equal(frame["sigma_gyro_bias_x"], result.sigma["gyro_bias"][:, 0])
    with pytest.raises(KeyError, match="'speed' is not there; there are: position"):
        result.estimates["speed"]


def test_other_libraries_take_the_estimates():
    pyarrow, polars, xarray = (pytest.importorskip(name) for name in ("pyarrow", "polars", "xarray"))
    result = fusion.Design(SIMULATED).run()
    frame = result.to_pandas()
    assert np.array_equal(result.to_polars().to_numpy(), frame.to_numpy())
    assert np.array_equal(pyarrow.table(result).to_pandas().to_numpy(), frame.to_numpy())
    assert np.array_equal(polars.DataFrame(pyarrow.table(result)).to_numpy(), frame.to_numpy())
    dataset = result.to_xarray()
    assert isinstance(dataset, xarray.Dataset)
    assert np.array_equal(dataset["sigma_velocity"], result.sigma["velocity"])


def test_innovations_errors_and_the_page_are_those_of_the_summary():
    result = fusion.Design(SIMULATED).run()
    told = result.innovations["position"]
    assert told.residual.shape == told.sigma.shape == (len(told), 3)
    sensor = next(s for s in result.summary["sensors"] if s["name"] == "position")
    assert (told.verdict == "accepted").sum() == sensor["accepted"]
    assert np.all(told.nis > 0) and np.all(np.diff(told.time) > 0)
    errors = result.errors.position
    rms = np.sqrt((errors**2).mean(axis=0))
    assert np.allclose(rms, result.score["position"]["rms"], rtol=1e-12)
    assert result.summary["score"]["horizontal_rms"] == result.score["horizontal_rms"]
    assert "position" in str(result) and "<table" in result._repr_html_()
    assert result.health[-1][1] == "good"


def test_seeds_differ_and_repeat():
    design = fusion.Design(SIMULATED)
    one, again, other = (design.run(seed=seed).estimates["velocity"] for seed in (1, 1, 2))
    assert np.array_equal(one, again) and not np.array_equal(one, other)


def test_a_smoothed_run_has_both_estimates():
    result = fusion.Design(SIMULATED).run(smooth="whole")
    assert len(result.smoothed) == len(result.estimates)
    assert np.median(result.smoothed.sigma["velocity"]) < np.median(result.sigma["velocity"])
    with pytest.raises(ValueError, match="None, \"never\", \"whole\""):
        fusion.Design(SIMULATED).run(smooth="later")


def same(one, other):
    return np.array_equal(one.estimates.written(), other.estimates.written(), equal_nan=True)


def test_tables_of_any_library_give_the_run_over_files(rows, tmp_path):
    pandas, polars, pyarrow = (pytest.importorskip(name) for name in ("pandas", "polars", "pyarrow"))
    for name, columns in rows.items():
        pandas.DataFrame(columns).to_csv(tmp_path / f"{name}.csv", index=False)
    design = fusion.Design(RECORDED)
    over_files = fusion.Design(RECORDED, data=tmp_path).run()
    assert len(over_files.estimates) > 1000
    makers = [
        dict,
        pandas.DataFrame,
        polars.DataFrame,
        pyarrow.table,
        lambda columns: {name: values.tolist() for name, values in columns.items()},
        # Every second element of another array: strides.
        lambda columns: {name: np.repeat(values, 2)[::2] for name, values in columns.items()},
        lambda columns: np.rec.fromarrays(list(columns.values()), names=list(columns)),
    ]
    for make in makers:
        run = design.run({name: make(columns) for name, columns in rows.items()})
        assert same(run, over_files), make


def test_rows_of_two_axes_are_columns_with_numbers(rows):
    imu = rows["imu"]
    table = {"t": imu["t"], "g": np.stack([imu[k] for k in ("gx", "gy", "gz")], 1), "a": np.stack([imu[k] for k in ("ax", "ay", "az")], 1)}
    columns = {
        "source.imu.channels.angular_rate.columns": ["g[0]", "g[1]", "g[2]"],
        "source.imu.channels.specific_force.columns": ["a[0]", "a[1]", "a[2]"],
    }
    assert same(fusion.Design(RECORDED, set=columns).run({**rows, "imu": table}), fusion.Design(RECORDED).run(rows))


def test_wrong_rows_are_errors_that_name_them(rows):
    design = fusion.Design(RECORDED)
    with pytest.raises(fusion.DataError, match="no source `radar`; it has: imu, gnss"):
        design.run({**rows, "radar": rows["imu"]})
    with pytest.raises(TypeError, match="source `imu`: int is not a table"):
        design.run({**rows, "imu": 3})
    with pytest.raises(TypeError, match="source `imu`, column `gx`: cells of the type complex128"):
        design.run({**rows, "imu": {**rows["imu"], "gx": np.zeros(3, complex)}})
    with pytest.raises(fusion.DesignError, match="column `gx` has 3 rows, the longest one has 3001"):
        design.run({**rows, "imu": {**rows["imu"], "gx": np.zeros(3)}})
    with pytest.raises(fusion.DataError, match="it has: none: give it a table"):
        fusion.Design(SIMULATED).run({"imu": rows["imu"]})
    missing = {name: values for name, values in rows["imu"].items() if name != "gz"}
    with pytest.raises(fusion.DesignError, match="gz"):
        design.run({**rows, "imu": missing})


def test_a_row_without_a_number_is_named(rows):
    imu = {**rows["imu"], "gx": rows["imu"]["gx"].copy()}
    imu["gx"][500] = np.inf
    with pytest.raises(fusion.DesignError, match="501"):
        fusion.Design(RECORDED).run({**rows, "imu": imu})


def test_other_threads_run_meanwhile_and_an_exception_of_progress_stops_the_run():
    design = fusion.Design(REPOSITORY / "configs" / "ins-gps.toml")
    counted, stop = [0], threading.Event()

    def count():
        while not stop.is_set():
            counted[0] += 1

    thread = threading.Thread(target=count)
    thread.start()
    try:
        design.run()
    finally:
        stop.set()
        thread.join()
    # A thread that waits for the interpreter for the whole run counts at most some switches of 5 ms.
    assert counted[0] > 10_000

    class Enough(Exception):
        pass

    def enough():
        raise Enough

    with pytest.raises(Enough):
        design.run(progress=enough)


def test_control_c_stops_a_run():
    code = f"""
import _thread, threading, fusion
design = fusion.Design({str(REPOSITORY / "configs" / "uri-r-sea-trial.toml")!r})
threading.Timer(0.5, _thread.interrupt_main).start()
try:
    for _ in range(1000):
        design.run()
except KeyboardInterrupt:
    print("stopped")
"""
    ran = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=60)
    assert ran.stdout.strip() == "stopped", ran.stderr


def test_the_import_brings_no_other_package():
    code = "import sys; before = set(sys.modules); import fusion; print('numpy' in set(sys.modules) - before, 'matplotlib' in sys.modules)"
    ran = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=60)
    assert ran.stdout.split() == ["False", "False"], ran.stderr


def test_dates_are_read_as_in_a_file(rows, tmp_path):
    pandas = pytest.importorskip("pandas")
    calendar = {"source.gnss.time": {"column": "t", "calendar": "utc", "epoch": "2026-01-01T00:00:00Z"}}
    design = fusion.Design(RECORDED, set=calendar)
    gnss = pandas.DataFrame(rows["gnss"])
    gnss["t"] = pandas.to_datetime("2026-01-01") + pandas.to_timedelta(gnss["t"], unit="s")
    zoned = gnss.assign(t=gnss["t"].dt.tz_localize("UTC"))
    expected = fusion.Design(RECORDED).run(rows)
    for table in (gnss, zoned):
        assert same(design.run({**rows, "gnss": table}), expected)
