"""Plots are drawn, and have what they show."""

import fusion
import numpy as np
import pytest

from conftest import RECORDED, REPOSITORY, SIMULATED

matplotlib = pytest.importorskip("matplotlib")
matplotlib.use("Agg")


def test_every_plot_is_drawn(tmp_path):
    result = fusion.Design(SIMULATED).run(smooth="whole")
    ax = fusion.plot.path(result)
    assert [line.get_label() for line in ax.lines] == ["estimate", "smoothed", "reference"]
    ax.figure.savefig(tmp_path / "path.png")
    for quantity in ("position", "velocity", "attitude"):
        axes = fusion.plot.errors(result, quantity, sigma=2)
        assert len(axes) == 3 and axes[0].get_ylabel().endswith("]")
    axes[0].figure.savefig(tmp_path / "errors.png")
    assert len(fusion.plot.innovations(result, "position")) == 3
    assert fusion.plot.states(result, "gyro_bias").get_title() == "gyro_bias"


def test_errors_without_a_reference_are_an_error(rows):
    with pytest.raises(ValueError, match="no reference"):
        fusion.plot.errors(fusion.Design(RECORDED).run(rows))


def test_errors_are_drawn_where_epochs_have_one_quantity_each(data):
    design = fusion.Design(REPOSITORY / "configs" / "real" / "rtklib-drive.toml", data=data)
    result = design.run()
    for quantity in ("position", "velocity"):
        (line,) = fusion.plot.errors(result, quantity)[0].lines
        assert len(line.get_xdata()) > 100 and not np.isnan(line.get_ydata()).any()
    assert "reference" in [line.get_label() for line in fusion.plot.path(result).lines]
