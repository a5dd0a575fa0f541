"""Recordings: arrays, pandas tables, files."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from os import PathLike, fspath
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
import numpy.typing as npt

from ._native import LogError

if TYPE_CHECKING:
    import pandas as pd

Role = Literal["identify", "validate"]
Channel = str | Sequence[str | int] | Mapping[str, Any]


@dataclass(frozen=True, eq=False)
class Log:
    """One recording: samples in memory or a file, with the meaning of its columns and its role.

    Create it with ``Log.from_arrays``, ``Log.from_pandas`` or ``Log.read``. Joints are in the robot's order unless the
    robot was loaded with ``joints``. The file is not read until a job needs it.
    """

    name: str
    """Name in results and messages."""
    format: Mapping[str, Any] = field(default_factory=dict)
    """Meaning of the columns: the keys of ``[format]`` of a study."""
    role: Role = "identify"
    """Whether the log is used for the fit or for validation."""
    payload: str | None = None
    """Name of the payload during the recording."""
    file: str | None = None
    """The file; None for samples in memory."""
    columns: Mapping[str, npt.NDArray[np.float64]] | None = None
    """Samples in memory by column; None for a file."""
    part: Mapping[str, Any] = field(default_factory=dict)
    """Selected rows: ``rows``, ``fraction``, ``time_range_s``, ``drop_rows``, ``drop_time_s`` of ``[[log]]``."""

    @classmethod
    def from_arrays(
        cls,
        time_s: npt.ArrayLike | None,
        q: npt.ArrayLike,
        tau: npt.ArrayLike | None = None,
        *,
        command: npt.ArrayLike | None = None,
        dq: npt.ArrayLike | None = None,
        ddq: npt.ArrayLike | None = None,
        temperature_c: npt.ArrayLike | None = None,
        rate_hz: float | None = None,
        name: str = "log",
        role: Role = "identify",
        payload: str | None = None,
        **format: Any,
    ) -> Log:
        """Creates a log from arrays in SI units: ``q`` and ``tau`` of shape ``(samples, n)``, rad and Nm (m and N).

        For a robot that reports no torque, give the commanded positions ``command`` instead of ``tau``, rad (m).
        ``time_s`` of shape ``(samples,)`` in seconds, or None with ``rate_hz``. ``dq`` and ``ddq`` (rad/s, rad/s²) are
        compared with the derivatives of the positions but not used in the fit. Further keyword arguments are keys of
        ``[format]``, such as ``torque={"unit": "A", "scale": 11.4}`` or ``missing="drop"``.

        >>> import numpy as np, dynident
        >>> t = np.arange(0.0, 2.0, 0.01)
        >>> dynident.Log.from_arrays(t, np.sin(t)[:, None], np.cos(t)[:, None]).samples
        200
        """
        columns: dict[str, npt.NDArray[np.float64]] = {}
        if (time_s is None) == (rate_hz is None):
            raise LogError(f"{name}: give either time_s or rate_hz")
        if tau is None and command is None:
            raise LogError(f"{name}: give tau, or command for a robot that reports no torque")
        channels: dict[str, Any] = {}
        if time_s is None:
            channels["rate_hz"] = rate_hz
        else:
            columns["t_s"] = np.asarray(time_s, dtype=np.float64).reshape(-1)
            channels["time"] = {"column": "t_s"}
        groups = [
            ("position", "q", q),
            ("torque", "tau", tau),
            ("velocity", "dq", dq),
            ("acceleration", "ddq", ddq),
            ("temperature", "temperature", temperature_c),
            ("command", "command", command),
        ]
        for key, symbol, values in groups:
            if values is None:
                continue
            table = np.asarray(values, dtype=np.float64)
            if table.ndim == 1:
                table = table[:, None]
            if table.ndim != 2:
                raise LogError(f"{name}: {key} has the shape {table.shape}, not (samples, joints)")
            names = [f"{symbol}{joint + 1}" for joint in range(table.shape[1])]
            columns.update({column: table[:, joint] for joint, column in enumerate(names)})
            channels[key] = {"columns": names}
        for key, value in format.items():
            own = channels.get(key)
            channels[key] = {**own, **value} if isinstance(own, dict) and isinstance(value, Mapping) else value
        return cls(name=name, format=channels, role=role, payload=payload, columns=columns)

    @classmethod
    def from_pandas(
        cls,
        table: pd.DataFrame,
        position: Channel,
        torque: Channel | None = None,
        *,
        time: str | Mapping[str, Any] | None = None,
        name: str = "log",
        role: Role = "identify",
        payload: str | None = None,
        **format: Any,
    ) -> Log:
        """Creates a log from a data frame. ``position`` and ``torque`` name its columns: a list, a pattern such as
        ``"q{1..6}"``, or a mapping with units as in ``[format]``: ``{"columns": "q{1..6}_deg", "unit": "deg"}``.

        ``time`` names the column with seconds, or is ``{"column": "t", "unit": "ms"}``. Without it the index is the
        time if it is numeric or a date; otherwise give ``rate_hz``. Further keyword arguments are keys of ``[format]``,
        such as ``command="target{1..6}"`` in place of ``torque``.
        """
        channels = _channels(position, torque, time, format)
        columns: dict[str, npt.NDArray[np.float64]] = {}
        for column in table.columns:
            values = table[column]
            if values.dtype.kind in "fiub":
                columns[str(column)] = np.ascontiguousarray(values.to_numpy(dtype=np.float64, na_value=np.nan))
        if "time" not in channels and "rate_hz" not in channels:
            index = table.index.to_numpy()
            if index.dtype.kind == "M":
                seconds = (index - index[0]) / np.timedelta64(1, "s")
            elif index.dtype.kind == "f":
                seconds = index
            else:
                raise LogError(f"{name}: give time (the column with seconds) or rate_hz")
            columns["index_s"] = np.asarray(seconds, dtype=np.float64)
            channels["time"] = {"column": "index_s"}
        return cls(name=name, format=channels, role=role, payload=payload, columns=columns)

    @classmethod
    def read(
        cls,
        file: str | PathLike[str],
        position: Channel,
        torque: Channel | None = None,
        *,
        time: str | Mapping[str, Any] | None = None,
        name: str | None = None,
        role: Role = "identify",
        payload: str | None = None,
        **format: Any,
    ) -> Log:
        """Creates a log from a file in any supported format (CSV, Parquet, MCAP, rosbag2, MAT, HDF5, npy, ...). The
        content determines the format; ``dynident.log_contents(file)`` lists the channels. Columns as in
        ``from_pandas``.
        """
        path = fspath(file)
        stem = path.replace("\\", "/").rstrip("/").rsplit("/", 1)[-1].rsplit(".", 1)[0]
        channels = _channels(position, torque, time, format)
        return cls(name=name or stem, format=channels, role=role, payload=payload, file=path)

    @property
    def samples(self) -> int | None:
        """Number of samples in memory; None for a file."""
        return None if self.columns is None else len(next(iter(self.columns.values())))

    def validating(self) -> Log:
        """The same log with the role ``validate``."""
        return replace(self, role="validate")

    def rows(self, first: int, end: int) -> Log:
        """The rows from ``first`` up to but excluding ``end``, 0-based."""
        return replace(self, part={**self._other_parts(), "rows": [first, end]}, name=f"{self.name} [{first}:{end}]")

    def fraction(self, begin: float, end: float) -> Log:
        """The rows between two fractions of the log, such as ``log.fraction(0.0, 0.65)``."""
        return replace(
            self,
            part={**self._other_parts(), "fraction": [begin, end]},
            name=f"{self.name} [{100 * begin:.0f} % .. {100 * end:.0f} %]",
        )

    def _other_parts(self) -> dict[str, Any]:
        return {key: value for key, value in self.part.items() if key not in ("rows", "fraction", "time_range_s")}

    def _section(self) -> dict[str, Any]:
        """``[[log]]`` of a study."""
        section: dict[str, Any] = {
            "file": self.file or self.name,
            "name": self.name,
            "role": self.role,
            "format": dict(self.format),
            **self.part,
        }
        if self.payload is not None:
            section["payload"] = self.payload
        return section

    def _samples(self) -> tuple[str, tuple[list[str], list[npt.NDArray[np.float64]]]] | None:
        if self.columns is None:
            return None
        return self.name, (list(self.columns), list(self.columns.values()))

    def __repr__(self) -> str:
        where = self.file if self.columns is None else f"{self.samples} samples"
        return f"Log({self.name!r}, {where}, {self.role})"


def _channels(
    position: Channel, torque: Channel | None, time: str | Mapping[str, Any] | None, further: Mapping[str, Any]
) -> dict[str, Any]:
    channels: dict[str, Any] = {"position": _group(position)}
    if torque is not None:
        channels["torque"] = _group(torque)
    if time is not None:
        channels["time"] = {"column": time} if isinstance(time, str) else dict(time)
    for key, value in further.items():
        is_group = key in ("velocity", "acceleration", "temperature", "command")
        channels[key] = _group(value) if is_group else value
    return channels


def _group(channel: Channel) -> dict[str, Any]:
    return dict(channel) if isinstance(channel, Mapping) else {"columns": channel}
