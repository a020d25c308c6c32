"""The notebooks run."""

import pytest

from conftest import REPOSITORY

nbformat = pytest.importorskip("nbformat")
nbclient = pytest.importorskip("nbclient")

NOTEBOOKS = REPOSITORY / "python" / "notebooks"


@pytest.fixture(autouse=True)
def _inline(monkeypatch):
    """A notebook shows its pictures, also if other tests use another backend."""
    monkeypatch.setenv("MPLBACKEND", "module://matplotlib_inline.backend_inline")


def run(name, tmp_path):
    notebook = nbformat.read(NOTEBOOKS / name, as_version=4)
    assert not any(cell.get("outputs") for cell in notebook.cells), "outputs are not kept"
    nbclient.NotebookClient(notebook, timeout=300, resources={"metadata": {"path": str(NOTEBOOKS)}}).execute()
    pictures = [
        output["data"]["image/png"]
        for cell in notebook.cells
        for output in cell.get("outputs", [])
        if "image/png" in output.get("data", {})
    ]
    nbformat.write(notebook, tmp_path / name)
    return notebook, pictures


def test_from_a_log_to_a_tuned_filter(data, tmp_path, monkeypatch):
    monkeypatch.setenv("FUSION_DATA", str(data))
    notebook, pictures = run("log-to-filter.ipynb", tmp_path)
    assert len(pictures) == 3
    (judged,) = (cell for cell in notebook.cells if "def judged" in cell.source)
    assert "tuned" in judged.outputs[0]["text"]


def test_a_new_sensor(data, tmp_path, monkeypatch):
    monkeypatch.setenv("FUSION_DATA", str(data))
    notebook, pictures = run("new-sensor.ipynb", tmp_path)
    assert len(pictures) == 1
    texts = "".join(output.get("text", "") for cell in notebook.cells for output in cell.get("outputs", []))
    assert "used" in texts and "fn h<D: Real>" in texts


def test_a_campaign_on_dask(tmp_path):
    pytest.importorskip("distributed")
    _, pictures = run("campaign.ipynb", tmp_path)
    assert len(pictures) == 2


def test_beside_others(data, tmp_path, monkeypatch):
    for peer in ("ahrs", "filterpy", "gtsam", "vqf"):
        pytest.importorskip(peer)
    monkeypatch.setenv("FUSION_DATA", str(data))
    notebook, _ = run("beside-others.ipynb", tmp_path)
    robots, units = (
        {line[:22].strip(): line[22:].split() for line in output["text"].splitlines()[1:]}
        for cell in notebook.cells
        for output in cell.get("outputs", [])
        if output.get("name") == "stdout"
    )
    # The same equations have the same errors, but for the place of the noise within a step.
    ours, theirs = (float(robots[name][0]) for name in ("fusion, error_state", "filterpy, EKF"))
    assert abs(ours - theirs) < 0.02 * theirs
    # A filter finds the most probable path if its chart suits the problem; 5 %: the path is smoothed, the filter is not.
    ours, theirs = (float(robots[name][0]) for name in ("fusion, invariant", "gtsam, iSAM2"))
    assert abs(ours - theirs) < 0.05 * theirs
    assert len(units) == 5
