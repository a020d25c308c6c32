"""One design over many logs."""

from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context

import fusion
import numpy as np
import pytest

from conftest import RECORDED

pandas = pytest.importorskip("pandas")

REFERENCE = """
[source.truth]
type = "csv"
path = "truth.csv"
time.column = "t"
channels.position = { latitude = "lat", longitude = "lon", height = "h", unit = "deg" }

[reference]
source = "truth"
"""


def test_each_log_has_a_row_and_a_failed_one_its_reason(rows, tmp_path):
    design = fusion.Design(RECORDED + REFERENCE)
    truth = {**rows["gnss"], "lat": 36.1 + 0 * rows["gnss"]["t"]}
    noisy = {**rows["gnss"], "lat": rows["gnss"]["lat"] + 1e-4 * np.sin(rows["gnss"]["t"])}
    folder = tmp_path / "log"
    folder.mkdir()
    for name, table in {**rows, "truth": truth}.items():
        pandas.DataFrame(table).to_csv(folder / f"{name}.csv", index=False)
    logs = {
        "arrays": {**rows, "truth": truth},
        "noisy": {**rows, "gnss": noisy, "truth": truth},
        "folder": folder,
        "absent": tmp_path / "nowhere",
    }
    told = []
    fleet = design.run_many(logs, progress=lambda done, all: told.append((done, all)))
    assert told == [(1, 4), (2, 4), (3, 4), (4, 4)]
    assert list(fleet.failed) == ["absent"] and "imu.csv" in fleet.failed["absent"]
    table = fleet.to_pandas()
    assert table.loc["arrays", "horizontal_rms"] == table.loc["folder", "horizontal_rms"]
    assert list(fleet.worst(2).index) == ["absent", "noisy"]
    assert fleet.quantiles((1.0,)).loc[1.0, "horizontal_rms"] == table.loc["noisy", "horizontal_rms"]
    assert "4 logs; 1 failed" in repr(fleet)
    with ProcessPoolExecutor(2, mp_context=get_context("spawn")) as executor:
        assert design.run_many(logs, executor=executor).rows == fleet.rows
    with pytest.raises(ValueError, match="at least one"):
        design.run_many({})
