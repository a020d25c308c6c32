"""Campaigns, also over many processes."""

from __future__ import annotations

import os
from operator import index

from . import _fusion

# True for type checkers only: `typing` takes longer to import than this package.
TYPE_CHECKING = False
if TYPE_CHECKING:
    from collections.abc import Callable, Iterable
    from typing import Any

    import pandas

    from ._design import Design

WIDTH = 100
#: The first parts are this share of a worker's runs, and the last ones this: the parts shrink, so that all workers end at
#: nearly the same time.
FIRST, LAST = 1 / 4, 1 / 64


class Campaign:
    """The runs of a campaign, in order of their numbers."""

    def __init__(self, native: _fusion.Campaign):
        self._native = native

    def part(self) -> bytes:
        """The campaign as bytes, lossless, for `merge` and for ``fusion merge``."""
        return self._native.part()

    @property
    def failed(self) -> dict[int, str]:
        """The runs that failed, with the reason. They have no part in the figures."""
        return dict(self._native.failed())

    def to_csv(self) -> str:
        """The text of runs.csv."""
        return self._native.csv()

    def to_pandas(self) -> pandas.DataFrame:
        """A DataFrame with a row for each run, as runs.csv. Only a failed run has text in ``error``."""
        import csv
        import io

        import pandas

        names, *rows = csv.reader(io.StringIO(self.to_csv()))
        table = {name: _numbers(cells) for name, cells in zip(names, zip(*rows))}
        table["error"] = [row[-1] or None for row in rows]
        return pandas.DataFrame(table)

    def __len__(self) -> int:
        return len(self._native)

    def __repr__(self) -> str:
        return self._native.page(WIDTH)

    def _repr_html_(self) -> str:
        return self._native.html()


def merge(parts: Iterable[bytes]) -> Campaign:
    """The campaign that parts make, in any order.

    Raises `FusionError` for parts of different designs, seeds, versions or platforms, and for runs that are missing or there
    twice.
    """
    return Campaign(_fusion.merge([bytes(part) for part in parts], 0))


def part(design: "Design", first: int, last: int, seed: int, threads: int = 1) -> bytes:
    """The runs `first` to `last` of a campaign as bytes, without the last: the work of one worker."""
    return design._native.montecarlo(first, last, seed, threads).part()


def campaign(
    design: "Design",
    runs: int | range,
    seed: int,
    executor: Any,
    chunk: int | None,
    threads: int,
    progress: Callable[[int, int], None] | None,
) -> Campaign:
    numbers = runs if isinstance(runs, range) else range(index(runs))
    if len(numbers) == 0 or numbers.step != 1:
        raise ValueError("runs: a positive number, or a range with step 1")
    if executor is None:
        # In pieces, so that Ctrl-C stops it and its progress is known; each keeps all cores busy.
        size = chunk or max(len(numbers) // 20, 4 * (threads or os.cpu_count() or 1))
        pieces: list[bytes] = []
        for first in numbers[::size]:
            last = min(first + size, numbers.stop)
            pieces.append(part(design, first, last, seed, threads))
            if progress is not None:
                progress(last - numbers.start, len(numbers))
        return _joined(pieces, runs, numbers.start)
    cuts = _cuts(numbers, chunk, _workers(executor))
    futures = [executor.submit(part, design, first, last, seed) for first, last in zip(cuts, cuts[1:])]
    done, parts = 0, []
    try:
        for (first, last), future in zip(zip(cuts, cuts[1:]), futures):
            parts.append(future.result())
            done += last - first
            if progress is not None:
                progress(done, len(numbers))
    except BaseException:
        for future in futures:
            future.cancel()
        raise
    return _joined(parts, runs, numbers.start)


def _cuts(numbers: range, chunk: int | None, workers: int) -> list[int]:
    """The ends of the parts, and the first number before them."""
    least = max(1, int(LAST * len(numbers) / workers))
    cuts = [numbers.start]
    while cuts[-1] < numbers.stop:
        size = chunk or max(least, int(FIRST * (numbers.stop - cuts[-1]) / workers))
        cuts.append(min(cuts[-1] + size, numbers.stop))
    return cuts


def _joined(parts: list[bytes], runs: int | range, first: int) -> Campaign:
    joined = Campaign(_fusion.merge(parts, first))
    failed = joined.failed
    # A range is a part of a campaign: without a result it still belongs to the whole.
    if len(failed) == len(joined) and not isinstance(runs, range):
        raise _fusion.FusionError(f"all runs have failed, the first one for this reason: {next(iter(failed.values()))}")
    return joined


def _numbers(cells: tuple[str, ...]) -> list[Any]:
    """The numbers of a column; an empty cell is NaN. Words stay words."""
    for convert in (int, lambda cell: float(cell or "nan")):
        try:
            return [convert(cell) for cell in cells]
        except ValueError:
            pass
    return list(cells)


def _workers(executor: Any) -> int:
    """The number of workers of an executor, as far as it tells."""
    if hasattr(executor, "nthreads"):  # a client of Dask
        return max(1, int(sum(executor.nthreads().values())))
    return max(1, int(getattr(executor, "_max_workers", 1)))
