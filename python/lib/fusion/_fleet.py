"""One design over many logs."""

from __future__ import annotations

from collections.abc import Mapping
from os import PathLike, fspath

from . import _fusion

# True for type checkers only: `typing` takes longer to import than this package.
TYPE_CHECKING = False
if TYPE_CHECKING:
    from collections.abc import Callable
    from typing import Any

    import pandas

    from ._design import Design

#: The figures that the table shows first, if the logs have them; large ones are bad.
_FIGURES = ("horizontal_rms", "horizontal_p95", "horizontal_max", "height_rms", "heading_rms_deg", "drift_rms")


class Fleet:
    """The figures of a design on many logs: a row for each log, a failed run with its reason."""

    def __init__(self, rows: list[dict[str, Any]]):
        #: A dict for each log, in the order given: name, figures, ``health``, ``findings``, ``error``.
        self.rows = rows

    def __len__(self) -> int:
        return len(self.rows)

    @property
    def failed(self) -> dict[str, str]:
        """The logs whose run has failed, with the reason."""
        return {row["log"]: row["error"] for row in self.rows if row["error"] is not None}

    def to_pandas(self) -> pandas.DataFrame:
        """A DataFrame with a row for each log."""
        import pandas

        return pandas.DataFrame(self.rows).set_index("log")

    def quantiles(self, shares: tuple[float, ...] = (0.5, 0.9, 0.95, 1.0)) -> pandas.DataFrame:
        """Quantiles of every figure over the logs that have it."""
        return self.to_pandas().select_dtypes("number").quantile(list(shares))

    def worst(self, count: int = 5, figure: str | None = None) -> pandas.DataFrame:
        """The logs with the largest values of a figure, failed ones first."""
        table = self.to_pandas()
        figure = figure or next(name for name in _FIGURES if name in table)
        failed = table["error"].notna()
        ordered = table.assign(_failed=failed).sort_values(["_failed", figure], ascending=False)
        return ordered.drop(columns="_failed").head(count)

    def __repr__(self) -> str:
        good = sum(row["health"] == "good" for row in self.rows)
        told = [f"{len(self)} logs", f"{len(self.failed)} failed", f"{good} good at the end"]
        for figure in _FIGURES:
            values = sorted(row[figure] for row in self.rows if row.get(figure) is not None)
            if values:
                told.append(f"{figure} median {values[len(values) // 2]:.3g}, worst {values[-1]:.3g}")
        return f"<fusion.Fleet: {'; '.join(told)}>"


def judge(design: Design, log: str, data: Any) -> dict[str, Any]:
    """The row of a log, the work of one worker. `data` is a folder, or rows as for `Design.run`."""
    row: dict[str, Any] = {"log": log, "health": None, "findings": None, "error": None}
    try:
        if isinstance(data, (str, PathLike)):
            result = design.with_data(data).run()
        else:
            result = design.run(data)
    except (_fusion.FusionError, OSError, TypeError, ValueError) as error:
        return {**row, "error": str(error).strip()}
    score: Mapping[str, Any] = result.score or {}
    position = (score.get("position") or {}).get("rms") or [None, None, None]
    figures = {
        "epochs": len(result.estimates),
        "horizontal_rms": score.get("horizontal_rms"),
        "horizontal_p95": score.get("horizontal_p95"),
        "horizontal_max": score.get("horizontal_max"),
        "height_rms": position[2],
        "heading_rms_deg": score.get("heading_rmse_deg"),
        "drift_rms": score.get("drift_rms"),
    }
    for name in ("position", "velocity", "attitude"):
        nees = score.get(f"nees_{name}")
        figures[f"nees_{name}"] = nees["mean"] / nees["dof"] if nees else None
    for sensor in result.summary["sensors"]:
        nis = sensor["nis"]
        figures[f"nis_{sensor['name']}"] = nis["mean"] / nis["dof"] if nis else None
    state = result.health[-1][1] if result.health else None
    return {**row, **figures, "health": state, "findings": len(result.findings)}


def run_many(
    design: Design, logs: Mapping[str, Any], executor: Any, progress: Callable[[int, int], None] | None
) -> Fleet:
    if not logs:
        raise ValueError("logs: at least one")
    named = {name: fspath(data) if isinstance(data, PathLike) else data for name, data in logs.items()}
    rows: list[dict[str, Any]] = []
    if executor is None:
        for name, data in named.items():
            rows.append(judge(design, name, data))
            if progress is not None:
                progress(len(rows), len(named))
        return Fleet(rows)
    futures = [executor.submit(judge, design, name, data) for name, data in named.items()]
    try:
        for future in futures:
            rows.append(future.result())
            if progress is not None:
                progress(len(rows), len(futures))
    except BaseException:
        for future in futures:
            future.cancel()
        raise
    return Fleet(rows)
