"""The examples of the documentation give what they say."""

import doctest
import importlib
import pkgutil
import re

import fusion
import pytest

from conftest import REPOSITORY, SIMULATED

MODULES = ["fusion", *(f"fusion.{module.name}" for module in pkgutil.iter_modules(fusion.__path__) if module.name != "_fusion")]
NAMES = {"simulated": SIMULATED, "embedded": REPOSITORY / "examples" / "embed.toml"}


@pytest.mark.parametrize("name", MODULES)
def test_the_examples_of(name):
    if name == "fusion.plot":
        pytest.importorskip("matplotlib")
    failed, _ = doctest.testmod(importlib.import_module(name), extraglobs=NAMES)
    assert failed == 0


def test_there_are_examples():
    finder = doctest.DocTestFinder()
    counts = [len(test.examples) for name in ("fusion", "fusion._navigator") for test in finder.find(importlib.import_module(name))]
    assert sum(counts) > 5


def test_everything_public_is_described():
    for name in fusion.__all__:
        if name.startswith("_"):
            continue
        thing = getattr(fusion, name)
        assert thing.__doc__, name
        if isinstance(thing, type) and not issubclass(thing, Exception):
            for inner, value in vars(thing).items():
                if not inner.startswith("_") and (callable(value) or isinstance(value, (property, classmethod))):
                    assert value.__doc__, f"{name}.{inner}"


def test_the_examples_of_the_book(monkeypatch):
    monkeypatch.chdir(REPOSITORY)
    page = (REPOSITORY / "book" / "src" / "python.md").read_text(encoding="utf-8")
    examples = "\n".join(re.findall(r"^```python\n(.*?)^```", page, re.M | re.S))
    test = doctest.DocTestParser().get_doctest(examples, {}, "python.md", None, None)
    assert len(test.examples) > 15
    assert doctest.DocTestRunner().run(test).failed == 0
