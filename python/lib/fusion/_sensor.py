"""Sensors whose model is a function of Python."""

from __future__ import annotations

from . import _fusion

# True for type checkers only: `typing` takes longer to import than this package.
TYPE_CHECKING = False
if TYPE_CHECKING:
    from collections.abc import Callable, Mapping
    from typing import Any, TypeVar

    F = TypeVar("F", bound=Callable[..., Any])


def sensor(
    *,
    reads: Mapping[str, str],
    dim: int = 1,
    unit: str = "",
    jacobian: Callable[..., Any] | None = None,
    name: str | None = None,
) -> Callable[[F], F]:
    """Declares a function h(x) as a sensor, to try a model before it is written in Rust.

    A design uses it as ``type = "python"`` with ``function = "NAME"``; the channel of its source has the same name. The
    function stays what it was. It works in SI, returns a number or `dim` numbers, and is called for each update, so that a
    run is slow. A process that loads the design has to declare it first, also a worker of a campaign.

    Parameters
    ----------
    reads
        The quantities that it reads, with their kinds, in the order of the arguments: ``geodetic`` (latitude, longitude
        [rad], height [m]), ``position``, ``velocity``, ``vector`` (three numbers each), ``attitude`` (the matrix from body
        to north-east-down), ``scalar``, ``angle``.
    dim
        How many numbers it returns.
    unit
        The unit of these numbers in SI, such as ``"m/s"``; also of the noise.
    jacobian
        A function of the same arguments that returns the derivative, of shape (dim, axes): metres north, east, down for
        ``geodetic``, a small rotation about the axes of the body for ``attitude``, otherwise the numbers themselves. Without
        it, central differences are used; ``function.jacobian_is`` says which. A given one is compared with them, once.
    name
        The name for designs; by default that of the function.

    If the function raises, or returns a number that is not finite, the measurement is not used, and Python shows why.

    >>> import numpy as np
    >>> @sensor(reads={"velocity": "velocity"}, unit="m/s")
    ... def speed_over_ground(v):
    ...     return np.hypot(v[0], v[1])
    >>> speed_over_ground.jacobian_is
    'numeric'
    """

    def declare(function: F) -> F:
        called = name or function.__name__
        native = None if jacobian is None else _rows(jacobian)
        _fusion.declare_sensor(called, list(reads.items()), dim, unit, _numbers(called, function, dim), native)
        setattr(function, "jacobian_is", "numeric" if jacobian is None else "given")
        return function

    return declare


def _numbers(name: str, function: Callable[..., Any], dim: int) -> Callable[..., list[float]]:
    import numpy as np

    def h(*values: Any) -> list[float]:
        z = np.atleast_1d(np.asarray(function(*map(np.array, values)), dtype=np.float64))
        if z.shape != (dim,):
            raise ValueError(f"{name} returns the shape {z.shape}; ({dim},) is declared")
        numbers: list[float] = z.tolist()
        return numbers

    return h


def _rows(function: Callable[..., Any]) -> Callable[..., list[list[float]]]:
    import numpy as np

    def jacobian(*values: Any) -> list[list[float]]:
        rows: list[list[float]] = np.atleast_2d(np.asarray(function(*map(np.array, values)), dtype=np.float64)).tolist()
        return rows

    return jacobian
