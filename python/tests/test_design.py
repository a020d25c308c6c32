"""Designs and their mistakes."""

import pickle

import fusion
import pytest

from conftest import REPOSITORY, SIMULATED


def test_a_mistake_has_its_place_and_a_help():
    with pytest.raises(fusion.DesignError) as raised:
        fusion.Design(SIMULATED.replace("sensor.position]", "sensor.position]\nlever_rm = [0, 0, 1]", 1))
    error = raised.value
    assert (error.file, error.column) == ("design.toml", 1)
    line = SIMULATED.replace("sensor.position]", "sensor.position]\nlever_rm", 1).splitlines().index("lever_rm") + 1
    assert error.line == line
    assert "lever_rm" in error.message
    assert "did you mean `lever_arm`?" in str(error)
    assert [mistake["severity"] for mistake in error.mistakes] == ["error"]


def test_all_mistakes_are_listed():
    wrong = SIMULATED.replace('0.2 deg/sqrt(h)', '0.2 deg').replace("gnss_position", "gnss_postion")
    with pytest.raises(fusion.DesignError) as raised:
        fusion.Design(wrong)
    assert len(raised.value.mistakes) >= 2


def test_a_file_that_is_not_there_is_named():
    with pytest.raises(fusion.FusionError, match="nowhere.toml"):
        fusion.Design("nowhere.toml")


def test_values_are_set_as_in_toml():
    design = fusion.Design(SIMULATED, set={"sensor.position.noise": ["1 m", 2, "3 m"], "sensor.position.enabled": True})
    assert design.hash != fusion.Design(SIMULATED).hash
    assert "seed 5" in str(fusion.Design(SIMULATED).with_changes({"run.seed": 5}).run())
    with pytest.raises(fusion.DesignError, match="sensor.postion"):
        fusion.Design(SIMULATED, set={"sensor.postion.noise": "1 m"})


def test_variants_and_backends_are_selected():
    path = REPOSITORY / "configs" / "ins-gps.toml"
    design = fusion.Design(path, variant="position-only", backend="iekf")
    assert "iterated" in design.backend
    assert design.sensors == ["position"]
    with pytest.raises(fusion.DesignError, match="position-only"):
        fusion.Design(path, variant="position-onli")


def test_a_design_survives_the_way_to_another_process():
    design = fusion.Design(SIMULATED, set={"sensor.position.noise": "2 m"}, backend="ukf")
    again = pickle.loads(pickle.dumps(design))
    assert (again.hash, again.backend) == (design.hash, design.backend)
