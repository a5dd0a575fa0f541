"""Columns and time of pandas data frames."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from ._native import LogError

if TYPE_CHECKING:
    import pandas as pd

Array = npt.NDArray[np.float64]


def seconds(values: pd.Index | pd.Series) -> Array | None:
    """Seconds of dates (from the first one) or durations; None for other values."""
    import pandas as pd

    index = pd.Index(values)
    if isinstance(index, pd.PeriodIndex):
        index = index.to_timestamp()
    if isinstance(index, pd.DatetimeIndex):
        known = index.dropna()
        index = index - known[0] if len(known) else pd.TimedeltaIndex([pd.NaT] * len(index))
    if isinstance(index, pd.TimedeltaIndex):
        return np.array(index.total_seconds(), dtype=np.float64)
    return None


def columns_of(table: pd.DataFrame, log: str, wanted: Iterable[str], time: Any) -> dict[str, Array]:
    """The numeric columns by name. Dates and durations are seconds."""
    columns: dict[str, Array] = {}
    others: dict[str, str] = {}
    stated = time if isinstance(time, Mapping) else {}
    for place, label in enumerate(table.columns):
        name, values = str(label), table.iloc[:, place]
        if name in columns or name in others:
            raise LogError(
                f"{log}: two columns are named `{name}`: rename one, or keep the first of each name with "
                "table.loc[:, ~table.columns.duplicated()]"
            )
        if getattr(values.dtype, "kind", "O") in "fiub":
            columns[name] = np.array(values.to_numpy(dtype=np.float64, na_value=np.nan))
        elif (found := seconds(values)) is not None:
            if name == stated.get("column") and stated.get("unit", "s") != "s":
                raise LogError(f"{log}: column `{name}` contains dates or durations, which have a unit: omit unit")
            columns[name] = found
        else:
            others[name] = str(values.dtype)
    for name in wanted:
        if name in others:
            fix = "pandas.to_datetime(..)" if name == stated.get("column") else "pandas.to_numeric(..)"
            raise LogError(f"{log}: column `{name}` has the type {others[name]}, which is not a number: convert it with {fix}")
    return columns


def index_s(table: pd.DataFrame, log: str, has_unit: bool) -> Array:
    """The index as time: seconds, or numbers in a stated unit."""
    import pandas as pd

    index = table.index
    if isinstance(index, pd.MultiIndex):
        raise LogError(f"{log}: the index has several levels: use table.reset_index(), and give the column of the time")
    found = seconds(index)
    kind = getattr(index.dtype, "kind", "O")
    if found is not None:
        if has_unit:
            raise LogError(f"{log}: the index contains dates or durations, which have a unit: omit time")
        return found
    if kind == "f" or (kind in "iu" and has_unit):
        return np.array(index.to_numpy(dtype=np.float64))
    if kind in "iu":
        raise LogError(
            f"{log}: the index contains whole numbers: give its unit, such as time={{'unit': 'ms'}}, the column of the "
            "time (time='t'), or rate_hz"
        )
    raise LogError(f"{log}: the index is no time: convert it with pandas.to_datetime(..), or give time or rate_hz")
