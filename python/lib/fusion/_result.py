"""Results of a run."""

from __future__ import annotations

from collections.abc import Mapping
from types import SimpleNamespace

# True for type checkers only: `typing` takes longer to import than this package.
TYPE_CHECKING = False
if TYPE_CHECKING:
    from collections.abc import Iterator, KeysView
    from typing import Any

    import numpy as np
    import pandas
    import polars
    import xarray
    from numpy.typing import NDArray

    from . import _fusion
    from .types import Summary, SummaryFinding, SummaryScore

    Array = NDArray[np.float64]

WIDTH = 100
_SOLUTION = {"position": 1, "local_position": 4, "velocity": 7, "attitude": 10}
# The 1σ of a position is in metres, also that of latitude and longitude.
_SIGMA = {"position": 16, "local_position": 16, "velocity": 19, "attitude": 22}


class Columns(Mapping):  # type: ignore[type-arg]
    """Arrays by name: views of one table, in SI with angles in radians. `time` has the time of each row [s]."""

    def __init__(self, table: Array, places: dict[str, tuple[int, int]]):
        self._table = table
        self._places = places

    @property
    def time(self) -> Array:
        """The time of each row [s]."""
        return self._table[:, 0]

    def __getitem__(self, name: str) -> Array:
        try:
            first, width = self._places[name]
        except KeyError:
            raise KeyError(f"{name!r} is not there; there are: {', '.join(self._places)}") from None
        return self._table[:, first] if width == 1 else self._table[:, first : first + width]

    def __iter__(self) -> Iterator[str]:
        return iter(self._places)

    def __len__(self) -> int:
        return len(self._places)

    def __repr__(self) -> str:
        return f"<{len(self._table)} rows of {', '.join(self._places)}>"


class Table:
    """Estimates: a row for each epoch, `run.output_rate` of them in a second.

    ``table["position"]`` has latitude, longitude [rad] and height [m]; ``local_position`` metres north, east, down of the
    origin; ``velocity`` north, east, down [m/s]; ``attitude`` roll, pitch, yaw [rad]. Further states have their names.
    `sigma` has the 1σ of each: of a position in metres north, east, down.
    """

    def __init__(self, native: _fusion.Finished, taken: _fusion._Taken):
        self._native = native
        self._rows, self._names, filled, self._degrees, further = taken
        values = {name: (first, 3) for name, first in _SOLUTION.items() if filled[first]}
        sigmas = {name: (first, 3) for name, first in _SIGMA.items() if name in values}
        at = 25
        for name, width, sigma_width in further:
            values[name] = (at, width)
            sigmas[name] = (at + width, sigma_width)
            at += width + sigma_width
        self.values = Columns(self._rows, values)
        self.sigma = Columns(self._rows, sigmas)

    @property
    def time(self) -> Array:
        """The time of each row [s]."""
        return self.values.time

    def __getitem__(self, name: str) -> Array:
        return self.values[name]

    def __iter__(self) -> Iterator[str]:
        return iter(self.values)

    def keys(self) -> KeysView[str]:
        """The names of its arrays."""
        return self.values.keys()

    def __len__(self) -> int:
        return len(self._rows)

    def __repr__(self) -> str:
        return f"<fusion estimates: {len(self)} rows of {', '.join(self.values)}>"

    @property
    def columns(self) -> list[str]:
        """The names of the columns of estimates.csv."""
        return list(self._names)

    def written(self) -> Array:
        """The table of estimates.csv, with its units and its digits: equal to the file, number by number."""
        return self._native.written(self._rows)

    def _in_file_units(self) -> Array:
        import numpy as np

        table = self._rows.copy()
        table[:, self._degrees] = np.degrees(table[:, self._degrees])
        return table

    def to_pandas(self) -> pandas.DataFrame:
        """A DataFrame with the columns and units of estimates.csv, in full precision."""
        import pandas

        return pandas.DataFrame(self._in_file_units(), columns=self.columns, copy=False)

    def to_polars(self) -> polars.DataFrame:
        """The same as a DataFrame of polars."""
        import polars

        return polars.from_numpy(self._in_file_units(), schema=self.columns, orient="row")

    def to_xarray(self) -> xarray.Dataset:
        """A Dataset in SI: a variable for each array and its 1σ, over `time`."""
        import xarray

        variables = {}
        for prefix, arrays in (("", self.values), ("sigma_", self.sigma)):
            for name, array in arrays.items():
                axes = ["time"] if array.ndim == 1 else ["time", f"{prefix}{name}_axis"]
                variables[prefix + name] = (axes, array)
        return xarray.Dataset(variables, coords={"time": self.time})

    def __arrow_c_stream__(self, requested_schema: Any = None) -> Any:
        """The columns of estimates.csv for any library that reads Arrow; it needs pyarrow."""
        import pyarrow

        table = self._in_file_units()
        arrays = [pyarrow.array(table[:, k]) for k in range(table.shape[1])]
        return pyarrow.table(arrays, names=self.columns).__arrow_c_stream__(requested_schema)


class Innovations:
    """The measurements of a sensor, in the order of their use."""

    def __init__(self, name: str, rows: Array, verdicts: list[str]):
        self.name = name
        self._rows = rows
        self._verdicts = verdicts

    def __len__(self) -> int:
        return len(self._rows)

    @property
    def time(self) -> Array:
        """Time of validity [s]."""
        return self._rows[:, 0]

    @property
    def nis(self) -> Array:
        """Normalised innovation squared."""
        return self._rows[:, 1]

    @property
    def statistic(self) -> Array:
        """The statistic of the gate."""
        return self._rows[:, 2]

    @property
    def threshold(self) -> Array:
        """The limit of the gate for its statistic."""
        return self._rows[:, 3]

    @property
    def weight(self) -> Array:
        """The weight that the loss gave; 1 is full weight."""
        return self._rows[:, 4]

    @property
    def verdict(self) -> NDArray[np.str_]:
        """What became of each: ``accepted``, ``rejected``, ``reacquired``, ``undefined``, ``unusable``."""
        import numpy as np

        words: NDArray[np.str_] = np.array(self._verdicts).take(self._rows[:, 5].astype(int))
        return words

    @property
    def residual(self) -> Array:
        """Measurement minus prediction, of shape (n, m), in SI."""
        return self._rows[:, 6 : 6 + (self._rows.shape[1] - 6) // 2]

    @property
    def sigma(self) -> Array:
        """The predicted 1σ of each residual, of shape (n, m)."""
        return self._rows[:, 6 + (self._rows.shape[1] - 6) // 2 :]

    def __repr__(self) -> str:
        return f"<fusion innovations of {self.name}: {len(self)}>"


class Errors:
    """Estimate minus reference at each epoch of the reference, with the 1σ of both together.

    Position north, east, down [m], velocity [m/s], attitude roll, pitch, yaw [rad], of shape (n, 3). NaN is unknown.
    """

    def __init__(self, rows: Array):
        self._rows = rows
        self.time = rows[:, 0]
        self.position, position, self.velocity, velocity, self.attitude, attitude = (
            rows[:, first : first + 3] for first in range(1, 19, 3)
        )
        self.sigma = SimpleNamespace(position=position, velocity=velocity, attitude=attitude)

    def __len__(self) -> int:
        return len(self._rows)

    def __repr__(self) -> str:
        return f"<fusion errors at {len(self)} epochs of the reference>"


class Result:
    """The result of a run. In a notebook it shows the page of the command; ``print(result)`` prints it."""

    def __init__(self, native: _fusion.Finished):
        import json

        self._native = native
        #: The result as summary.json has it. `fusion.types.Summary` knows the keys of built-in sections.
        self.summary: Summary = json.loads(native.summary())
        taken = native.take()
        if taken is None:
            raise ValueError("the arrays of this run were taken before")
        estimates, smoothed, innovations, verdicts, errors, health = taken
        #: The estimates.
        self.estimates = Table(native, estimates)
        #: The estimates with later data, if the run was smoothed.
        self.smoothed = None if smoothed is None else Table(native, smoothed)
        #: The measurements of each sensor, by its name.
        self.innovations = {name: Innovations(name, rows, verdicts) for name, rows in innovations}
        #: The errors against the reference; `None` without one.
        self.errors = Errors(errors) if len(errors) else None
        #: The changes of the health: time [s], state, reasons.
        self.health: list[tuple[float, str, list[str]]] = health

    @property
    def sigma(self) -> Columns:
        """The 1σ of the estimates, by name."""
        return self.estimates.sigma

    @property
    def score(self) -> SummaryScore | None:
        """The score against the reference, as summary.json has it."""
        return self.summary.get("score")

    @property
    def findings(self) -> list[SummaryFinding]:
        """The findings of advice: rule, subject, evidence, advice, edits."""
        return self.summary.get("findings") or []

    def to_pandas(self) -> pandas.DataFrame:
        """The estimates as a DataFrame: see `Table.to_pandas`."""
        return self.estimates.to_pandas()

    def to_polars(self) -> polars.DataFrame:
        """The estimates as a DataFrame of polars."""
        return self.estimates.to_polars()

    def to_xarray(self) -> xarray.Dataset:
        """The estimates as a Dataset."""
        return self.estimates.to_xarray()

    def __arrow_c_stream__(self, requested_schema: Any = None) -> Any:
        return self.estimates.__arrow_c_stream__(requested_schema)

    def page(self, whole: bool = True) -> str:
        """The page of the command as text; with ``whole=False`` the short one."""
        return self._native.page(whole, WIDTH)

    def __str__(self) -> str:
        return self.page(whole=False)

    def __repr__(self) -> str:
        rms = None if self.score is None else self.score["horizontal_rms"]
        told = "" if rms is None else f", horizontal RMS {rms:.3g} m"
        return f"<fusion.Result: {len(self.estimates)} estimates, {len(self.innovations)} sensors{told}>"

    def _repr_html_(self) -> str:
        return self._native.html()
