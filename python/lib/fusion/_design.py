"""Designs."""

from __future__ import annotations

from collections.abc import Mapping
from os import fspath

from . import _fusion
from ._campaign import Campaign, campaign
from ._fleet import Fleet, run_many
from ._result import Result
from ._rows import columns

# True for type checkers only: `typing` takes longer to import than this package.
TYPE_CHECKING = False
if TYPE_CHECKING:
    import os
    from collections.abc import Callable, Iterable, Sequence
    from typing import Any, Union

    from numpy.typing import NDArray

    from .types import DesignTable

    Setting = Union[bool, float, str, Sequence["Setting"], NDArray[Any]]
    Changes = Union[Mapping[str, Setting], DesignTable]


class Design:
    """A filter with its data or its simulated world, as declared in TOML.

    Parameters
    ----------
    design
        The path of a file, or a text of TOML (a string with more than one line).
    variant
        Names of tables ``[variant.NAME]`` that are laid over the design, in this order.
    backend
        A backend in place of the table ``[filter]``: ``"ekf"``, ``"error_state"``, ``"iekf"`` and others.
    set
        Single values by their paths, ``{"sensor.gnss.noise": "2 m"}``, or as tables, ``{"sensor": {"gnss": {"noise": "2 m"}}}``,
        whose keys type checkers know (`fusion.types.DesignTable`). Units as in TOML; a number without unit is SI. A table with
        a ``type`` replaces its block.
    data
        Where relative paths of sources start, instead of at the folder of the file.

    Raises
    ------
    DesignError
        With all mistakes; ``file``, ``line``, ``column`` and ``help`` are those of the first one.
    """

    def __init__(
        self,
        design: str | os.PathLike[str],
        *,
        variant: str | Iterable[str] = (),
        backend: str | None = None,
        set: Changes | None = None,
        data: str | os.PathLike[str] | None = None,
    ):
        is_text = isinstance(design, str) and "\n" in design
        path, text = (".", str(design)) if is_text else (fspath(design), None)
        variants = [variant] if isinstance(variant, str) else list(variant)
        edits = _edits(set or {})
        self._native = _fusion.Design(path, text, variants, backend, edits, None if data is None else fspath(data))

    @classmethod
    def _of(cls, *arguments: Any) -> Design:
        made = cls.__new__(cls)
        made._native = _fusion.Design(*arguments)
        return made

    def __reduce__(self) -> tuple[Any, ...]:
        return (_once, (_sent, self.hash, (self.hash, *self._native.arguments())))

    @property
    def description(self) -> str:
        """The line ``run.description``."""
        return self._native.description

    @property
    def sources(self) -> list[str]:
        """The names of its sources: the keys of the rows that `run` takes."""
        return self._native.sources

    @property
    def sensors(self) -> list[str]:
        """The names of its sensors."""
        return self._native.sensors

    @property
    def is_simulated(self) -> bool:
        """Whether its data come from a simulated world."""
        return self._native.is_simulated

    @property
    def backend(self) -> str:
        """The backend: chart, update and form of the covariance."""
        return self._native.backend

    @property
    def hash(self) -> str:
        """A fingerprint of the design with its changes. Equal ones give equal results."""
        return self._native.hash

    def with_changes(self, set: Changes) -> Design:
        """The same design with further values, as the argument ``set`` of the constructor."""
        path, text, variants, backend, edits, data = self._native.arguments()
        return Design._of(path, text, variants, backend, edits + _edits(set), data)

    def run(
        self,
        rows: Mapping[str, Any] | None = None,
        *,
        seed: int | None = None,
        smooth: str | None = None,
        out: str | os.PathLike[str] | None = None,
        progress: Callable[[], None] | None = None,
    ) -> Result:
        """Runs the design over its sources, or over its simulated world.

        Parameters
        ----------
        rows
            Tables in place of the files of sources: DataFrames of pandas or polars, Arrow tables, dicts of arrays. They are
            decoded as the design declares, with its units, clocks, rotations and ``valid``. Arrays of float64 and int64 are
            not copied; do not change them during the run.
        seed
            The seed of simulated data and of declared faults, instead of the design's.
        smooth
            ``None``: as the design says; ``"never"``, ``"whole"``, ``"iterate"`` (maximum a posteriori).
        out
            A folder for the files of the command: estimates.csv, updates.csv, summary.json.
        progress
            Is called from time to time. An exception that it raises ends the run.

        Other threads of Python run meanwhile, and Ctrl-C stops the run.
        """
        tables = {name: columns(name, table) for name, table in (rows or {}).items()}
        tick = progress or _nothing
        return Result(self._native.run(tables, seed, smooth, None if out is None else fspath(out), tick))

    def montecarlo(
        self,
        runs: int | range = 100,
        *,
        seed: int = 1,
        executor: Any = None,
        chunk: int | None = None,
        threads: int = 0,
        progress: Callable[[int, int], None] | None = None,
    ) -> Campaign:
        """Runs the design with many seeds.

        The result does not depend on the number of threads, of workers, nor on how the runs are split.

        Parameters
        ----------
        runs
            Their number, or the range of their numbers: `merge` joins the parts (`Campaign.part`) of several ranges.
        seed
            The seed of the campaign; the seed of a run depends on it and on the number of the run.
        executor
            Any executor of ``concurrent.futures``, or a client of Dask: the runs are split among its workers. A part whose
            worker is lost is computed again by the executor, or raises its exception here.
        chunk
            Runs in each part; by default parts for an executor shrink, so that all workers end together.
        threads
            Without an executor: the number of threads; 0 for one per core.
        progress
            Is called with the number of runs done and of all.
        """
        return campaign(self, runs, seed, executor, chunk, threads, progress)

    def with_data(self, data: str | os.PathLike[str]) -> Design:
        """The same design with its logs in another folder."""
        path, text, variants, backend, edits, _ = self._native.arguments()
        return Design._of(path, text, variants, backend, edits, fspath(data))

    def run_many(
        self,
        logs: Mapping[str, Any],
        *,
        executor: Any = None,
        progress: Callable[[int, int], None] | None = None,
    ) -> Fleet:
        """Runs the design over many logs, for one table of figures. A run that fails is a row with its reason.

        Parameters
        ----------
        logs
            By name: a folder, where the paths of the sources start, or rows as for `run`.
        executor
            Any executor of ``concurrent.futures``, or a client of Dask. Its workers see the folders.
        progress
            Is called with the number of logs done and of all.
        """
        return run_many(self, logs, executor, progress)

    def tune(
        self,
        rows: Mapping[str, Any] | Iterable[Mapping[str, Any]] | None = None,
        *,
        params: Iterable[str] = (),
        settle: float = 0.0,
        folds: int = 4,
        most_runs: int = 1000,
        starts: Iterable[Changes] = (),
        executor: Any = None,
    ) -> Tuned:
        """Finds noises under which the innovations are most probable. It needs no reference.

        Parameters
        ----------
        rows
            As for `run`; a list of them for several logs.
        params
            Paths of the noises, such as ``"gyro.noise"`` and ``"sensor.*.noise"``. Without them: those of the process and of
            the sensors that measure.
        settle
            Rows count from this time after the alignment on [s].
        folds
            Parts of each log, each judged by what the others give.
        most_runs
            No iteration of a search begins after this number of its runs.
        starts
            Other values of the noises, as the argument ``set``, from which the search begins too. The best end counts.
        executor
            Any executor of ``concurrent.futures``, or a client of Dask: the searches from the starts run in parallel.
        """
        logs = [rows or {}] if rows is None or isinstance(rows, Mapping) else list(rows)
        tables = [{name: columns(name, table) for name, table in log.items()} for log in logs]
        params, others = list(params), [self.with_changes(start) for start in starts]
        work = _Searches(self, params, tables, settle, most_runs, others)
        searched = []
        if executor is not None and not others:
            raise ValueError("executor: it runs the searches from several starts, so give `starts` too")
        if executor is not None:
            futures = [executor.submit(work.end, number) for number in range(len(others) + 1)]
            searched = [end for future in futures for end in future.result()]
        return Tuned(self, self._native.tune(params, work.logs, settle, folds, most_runs, work.starts, searched))

    def __repr__(self) -> str:
        path, text, *_ = self._native.arguments()
        name = "text" if text is not None else str(path)
        return f"<fusion.Design {name}: {self.backend}; sensors {', '.join(self.sensors)}; design {self.hash}>"


class Tuned:
    """Noises that a log determines, and the design with them."""

    def __init__(self, design: Design, native: _fusion.Tuned):
        self._design = design
        self._native = native

    @property
    def found(self) -> list[dict[str, Any]]:
        """For each parameter: path, declared value, factor on it, 95 % interval of the factor, whether it is identifiable."""
        keys = ("path", "declared", "factor", "low", "high", "is_identifiable")
        return [dict(zip(keys, row, strict=True)) for row in self._native.found()]

    @property
    def is_better(self) -> bool:
        """Whether the found noises make hidden parts of the log more probable than the declared ones."""
        return self._native.is_better

    @property
    def is_sound(self) -> bool:
        """Whether the innovations are independent, so that the found values mean something."""
        return self._native.is_sound

    @property
    def gain(self) -> float:
        """The gain of ln L on hidden parts of the log."""
        return self._native.gain

    @property
    def changes(self) -> dict[str, Any]:
        """The changed values by path, as the argument ``set`` of `Design` takes them."""
        import json

        # A string, a number or an array of TOML is one of JSON.
        return {path: json.loads(value) for path, value in self._native.edits()}

    @property
    def design(self) -> Design:
        """The design with these values."""
        return self._design.with_changes(self.changes)

    def __repr__(self) -> str:
        rows = [f"{f['path']}: × {f['factor']:.3g} ({f['low']:.3g} to {f['high']:.3g})" for f in self.found]
        return "<fusion.Tuned\n  " + "\n  ".join(rows) + f"\n  gain {self.gain:.1f} nats on hidden parts>"


class _Searches:
    """The searches of `Design.tune`. A worker decodes the logs once for all that it does of them."""

    def __init__(
        self, design: Design, params: list[str], tables: Any, settle: float, most_runs: int, starts: list[Design]
    ):
        import os

        self._key = os.urandom(16).hex()
        self._arguments = (design, params, tables, settle, most_runs, starts)
        self.logs = design._native.logs(tables)
        self.starts = [start._native for start in starts]

    def __reduce__(self) -> tuple[Any, ...]:
        return (_once, (_Searches, self._key, self._arguments))

    def end(self, number: int) -> list[tuple[list[float], int]]:
        """The end of the search from the start of this number: the work of one worker."""
        design, params, _, settle, most_runs, _ = self._arguments
        return design._native.search(params, self.logs, settle, most_runs, self.starts, number)


def _sent(hash: str, *arguments: Any) -> Design:
    """The design of another process. Its file must not have changed since."""
    design = Design._of(*arguments)
    if design.hash != hash:
        path, text, *_ = arguments
        name = "the text" if text is not None else str(path)
        raise _fusion.FusionError(
            f"{name}: this worker reads the design {design.hash}, and the caller has {hash}. "
            "The file has changed since, or the worker has another version: read it again, and start the workers again"
        )
    return design


#: What this process has made of pickles, the last of each kind: many tasks bring the same work to a worker.
_made: dict[Any, tuple[str, Any]] = {}


def _once(make: Any, key: str, arguments: tuple[Any, ...]) -> Any:
    """What `make` makes of the arguments, made once for tasks that follow each other with the same key."""
    known, made = _made.get(make, (None, None))
    if known != key:
        made = make(*arguments)
        _made[make] = (key, made)
    return made


def _nothing() -> None:
    pass


def _edits(changes: Mapping[str, Any], above: str = "") -> list[str]:
    """Single values, `path=value` in TOML."""
    edits = []
    for key, value in changes.items():
        path = f"{above}{key}"
        # A table of names or of keys goes on; a block is written whole.
        is_table = isinstance(value, Mapping) and "." not in key and "type" not in value
        edits += _edits(value, f"{path}.") if is_table else [f"{path}={_toml(value)}"]
    return edits


def _toml(value: Any) -> str:
    """A value as TOML."""
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, str):
        return '"' + value.replace("\\", "\\\\").replace('"', '\\"') + '"'
    if isinstance(value, Mapping):
        return "{ " + ", ".join(f"{key} = {_toml(inner)}" for key, inner in value.items()) + " }"
    if hasattr(value, "tolist"):
        return _toml(value.tolist())
    if isinstance(value, (list, tuple)):
        return "[" + ", ".join(map(_toml, value)) + "]"
    return repr(value)
