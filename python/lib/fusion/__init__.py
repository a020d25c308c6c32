"""Navigation filters composed from model blocks declared in TOML.

>>> import fusion
>>> d = fusion.Design(simulated)
>>> r = d.run()
>>> r.estimates["velocity"].shape
(101, 3)
>>> bool((r.sigma["velocity"] > 0).all())
True

A `Design` is run over its data (`run`), over many seeds (`montecarlo`), or tuned (`tune`). A `Navigator` is fed row by
row. Numbers are SI, angles are radians; times are seconds of the log. `fusion.plot` draws results.
"""

from __future__ import annotations

from ._fusion import DataError, DesignError, FusionError, __version__

# True for type checkers only: `typing` takes longer to import than this package.
TYPE_CHECKING = False
if TYPE_CHECKING:
    from typing import Any

    from . import plot, types
    from ._campaign import Campaign, merge
    from ._design import Design, Tuned
    from ._fleet import Fleet
    from ._navigator import Navigator
    from ._result import Result
    from ._sensor import sensor

__all__ = [
    "Campaign",
    "DataError",
    "Design",
    "DesignError",
    "Fleet",
    "FusionError",
    "Navigator",
    "Result",
    "Tuned",
    "merge",
    "plot",
    "sensor",
    "types",
    "__version__",
]


#: The modules of the names that are imported when they are used (PEP 562).
_MODULES = {
    "Campaign": "_campaign",
    "Design": "_design",
    "Fleet": "_fleet",
    "Navigator": "_navigator",
    "Result": "_result",
    "Tuned": "_design",
    "merge": "_campaign",
    "sensor": "_sensor",
}


def __getattr__(name: str) -> Any:
    from importlib import import_module

    if name in ("plot", "types"):
        return import_module(f"fusion.{name}")
    if name in _MODULES:
        found = globals()[name] = getattr(import_module(f"fusion.{_MODULES[name]}"), name)
        return found
    raise AttributeError(f"module 'fusion' has no attribute {name!r}")


def __dir__() -> list[str]:
    return sorted(__all__)
