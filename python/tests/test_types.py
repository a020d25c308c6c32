"""The types of tables."""

import sys

import fusion
import pytest
from fusion import types

from conftest import REPOSITORY, SIMULATED


def test_the_types_are_made_of_the_schemas():
    sys.path.insert(0, str(REPOSITORY / "python"))
    try:
        import tables
    finally:
        sys.path.pop(0)
    written = (REPOSITORY / "python" / "lib" / "fusion" / "types.py").read_text()
    assert tables.written() == written, "python/lib/fusion/types.py is old: `python python/tables.py` writes it"


def test_a_result_has_the_keys_of_its_type():
    result = fusion.Design(SIMULATED).run()
    assert result.summary.keys() == types.Summary.__annotations__.keys()
    assert result.score.keys() == types.SummaryScore.__annotations__.keys()


def test_tables_and_paths_set_the_same_values():
    paths = {"sensor.position.noise": "2 m", "run.seed": 7, "sensor.position.gate": {"type": "nis", "probability": 0.99}}
    nested = {"run": {"seed": 7}, "sensor": {"position": {"noise": "2 m", "gate": {"type": "nis", "probability": 0.99}}}}
    assert fusion.Design(SIMULATED, set=nested).hash == fusion.Design(SIMULATED, set=paths).hash
    assert fusion.Design(SIMULATED).with_changes(nested).hash == fusion.Design(SIMULATED, set=paths).hash


def test_a_type_checker_knows_the_keys(tmp_path):
    api = pytest.importorskip("mypy.api")
    lines = [
        ("d.with_changes({'sensor': {'gnss': {'noise': '2 m', 'gate': 'none'}}, 'run': {'seed': 3}})", None),
        ("d.with_changes({'sensor.gnss.noise': [1.0, '2 m', 3]})", None),
        ("d.with_changes({'sensor': {'gnss': {'niose': '2 m'}}})", "incompatible type"),
        ("d.with_changes({'run': {'seed': [3]}})", "incompatible type"),
        ("d.with_changes({'sensor.gnss.noise': object()})", "incompatible type"),
        ("rms: float | None = d.run().summary['score']['horizontal_rms']", "is not indexable"),
        ("kernel: str = d.run().summary['kernel']", None),
        ("d.run().summary['kernal']", 'has no key "kernal"'),
    ]
    program = tmp_path / "program.py"
    program.write_text("\n".join(["import fusion", "d = fusion.Design('a.toml')", *(line for line, _ in lines)]))
    out, _, _ = api.run(["--strict", "--cache-dir", str(tmp_path / "cache"), str(program)])
    for number, (line, problem) in enumerate(lines, 3):
        told = [message for message in out.splitlines() if f"program.py:{number}: error" in message]
        assert [problem in message for message in told] == ([] if problem is None else [True]), f"{line}\n{out}"
