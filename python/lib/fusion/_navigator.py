"""The filter inside a program."""

from __future__ import annotations

from . import _fusion
from ._design import Design

# True for type checkers only: `typing` takes longer to import than this package.
TYPE_CHECKING = False
if TYPE_CHECKING:
    import os
    from typing import Any


class Navigator:
    """A filter that is fed row by row. It has no clock and no thread: its results depend on its rows only.

    >>> import fusion, numpy as np
    >>> nav = fusion.Navigator(embedded)
    >>> nav.streams["imu"]
    {'angular_rate': slice(0, 3, None), 'specific_force': slice(3, 6, None)}
    >>> t = 0.01 * np.arange(2001)
    >>> nav.feed("gnss", 0.0, [0.63, 2.26, 50.0])
    >>> nav.feed("imu", t, np.tile([0, 0, 0, 0, 0, -9.8], (t.size, 1)))
    >>> nav.health
    ('good', [])
    """

    def __init__(self, design: Design | str | os.PathLike[str]):
        design = design if isinstance(design, Design) else Design(design)
        self._native = _fusion.Navigator(design._native)

    @property
    def streams(self) -> dict[str, dict[str, slice]]:
        """The streams that it expects, with the columns of each channel in a row."""
        streams = self._native.streams()
        return {
            name: {channel: slice(first, first + width) for channel, first, width in channels} for name, channels in streams
        }

    def feed(self, stream: str, time: Any, rows: Any, *, solutions: bool = False) -> dict[str, Any] | None:
        """Feeds rows of a stream: times [s] of shape (n,) and numbers of shape (n, width), in SI with angles in radians.

        A single row has a number as time and one axis. NaN is a missing value. Other threads of Python run meanwhile.

        With `solutions`, returns the `solution` after each row: arrays of shape (n,) for `time` and (n, 3) for the others.
        They are NaN where the filter has not started, or has no such quantity.

        Raises
        ------
        DataError
            A row has an impossible value, or the stream does not exist. The rows before it have been used.
        """
        import numpy as np

        times = np.atleast_1d(np.ascontiguousarray(time, dtype=np.float64))
        table = np.ascontiguousarray(rows, dtype=np.float64)
        if table.ndim == 1:
            table = table.reshape(len(times), -1)
        if table.ndim != 2 or times.ndim != 1 or len(table) != len(times):
            raise ValueError(f"time has the shape {times.shape} and rows {table.shape}: (n,) and (n, width) are expected")
        return self._native.feed(stream, times, table, solutions)

    def finish(self) -> None:
        """Uses the rows that are held back for late ones."""
        self._native.finish()

    @property
    def solution(self) -> dict[str, Any] | None:
        """Time, position (latitude, longitude [rad], height [m]), velocity north, east, down [m/s], attitude (roll, pitch,
        yaw [rad]), each with its 1σ; `None` before the filter has started."""
        return self._native.solution()

    def predict(self, time: float) -> dict[str, Any] | None:
        """The solution at a later time [s] if no row comes until then. The filter does not change."""
        return self._native.predict(time)

    @property
    def states(self) -> dict[str, tuple[Any, Any]] | None:
        """Each state with its values as stored and its 1σ; `None` before the filter has started."""
        import numpy as np

        belief = self._native.belief()
        return None if belief is None else {name: (np.array(x), np.array(sigma)) for name, x, sigma in belief[1]}

    @property
    def health(self) -> tuple[str, list[str]]:
        """The state of the health, and its reasons."""
        return self._native.health()

    @property
    def waits_for(self) -> dict[str, str]:
        """What the filter still needs before it starts: by initialiser."""
        return dict(self._native.waits_for())

    def checkpoint(self) -> bytes:
        """The memory of the filter. `restore` in another process continues from it with the same bits."""
        return self._native.checkpoint()

    def restore(self, checkpoint: bytes) -> None:
        """Continues from a checkpoint of the same design."""
        self._native.restore(checkpoint)

    def __repr__(self) -> str:
        state, reasons = self.health
        return f"<fusion.Navigator {state}{': ' if reasons else ''}{', '.join(reasons)}>"
