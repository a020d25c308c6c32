"""Tables of Python as the rows of a source."""

from __future__ import annotations

from collections.abc import Mapping

# True for type checkers only: `typing` takes longer to import than this package.
TYPE_CHECKING = False
if TYPE_CHECKING:
    from typing import Any


def columns(source: str, table: Any) -> dict[str, Any]:
    """A dict of arrays of f64 or i64, or of lists of text, of a DataFrame, an Arrow table or a dict.

    Arrays of f64 and i64 are not copied. An array with two axes becomes the columns ``name[0]``, ``name[1]`` and so on.
    """
    found: dict[str, Any] = {}
    for name, values in _named(source, table):
        for name, column in _split(source, name, values):
            found[name] = _column(source, name, column)
    if not found:
        raise TypeError(f"source `{source}`: the table has no columns")
    return found


def _named(source: str, table: Any) -> list[tuple[str, Any]]:
    if isinstance(table, Mapping):
        return list(table.items())
    if hasattr(table, "column_names"):  # Arrow
        return [(name, table.column(name)) for name in table.column_names]
    if hasattr(table, "columns"):  # pandas, polars
        return [(str(name), table[name]) for name in table.columns]
    if hasattr(table, "dtype") and table.dtype.names:  # a structured array of numpy
        return [(name, table[name]) for name in table.dtype.names]
    if hasattr(table, "__arrow_c_stream__"):
        import pyarrow

        return _named(source, pyarrow.table(table))
    raise TypeError(
        f"source `{source}`: {type(table).__name__} is not a table. Give a DataFrame of pandas or polars, an Arrow table, "
        "a structured array or a dict of arrays"
    )


def _array(values: Any) -> Any:
    import numpy as np

    if hasattr(values, "to_numpy"):
        return values.to_numpy()
    return np.asarray(values)


def _split(source: str, name: str, values: Any) -> list[tuple[str, Any]]:
    array = _array(values)
    if array.ndim == 1:
        return [(name, array)]
    if array.ndim == 2:
        return [(f"{name}[{k}]", array[:, k]) for k in range(array.shape[1])]
    raise TypeError(f"source `{source}`, column `{name}`: an array with {array.ndim} axes; 1 and 2 are possible")


def _column(source: str, name: str, array: Any) -> Any:
    import numpy as np

    kind = array.dtype.kind
    if array.dtype == np.float64 or array.dtype == np.int64:
        return array if array.dtype.isnative else array.astype(array.dtype.newbyteorder("="))
    if kind == "f":
        return array.astype(np.float64)
    if kind in "iub":
        return array.astype(np.int64)
    if kind == "M":  # dates: text, as a text file has them
        return np.datetime_as_string(array.astype("datetime64[ns]"), timezone="naive").tolist()
    if kind in "OUST":
        return ["" if value is None or value != value else str(value) for value in array.tolist()]
    raise TypeError(f"source `{source}`, column `{name}`: cells of the type {array.dtype} are not numbers")
