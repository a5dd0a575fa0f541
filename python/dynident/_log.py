"""Recordings: arrays, pandas tables, files."""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from os import PathLike, fspath
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
import numpy.typing as npt

from . import _native
from ._native import LogError

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.figure import Figure

Role = Literal["identify", "validate"]
Channel = str | Sequence[str | int] | Mapping[str, Any]


@dataclass(frozen=True, eq=False)
class Log:
    """One recording: samples in memory or a file, with the meaning of its columns and its role.

    Create it with ``Log.from_arrays``, ``Log.from_pandas`` or ``Log.read``. Joints are in the robot's order unless the
    robot was loaded with ``joints``. The file is not read until a job needs it; arrays are copied.

    >>> import dynident
    >>> log = dynident.example().logs[0]
    >>> log
    Log('train', 1251 samples, identify)
    >>> log.q.shape, log.tau.shape, float(log.time_s[-1])
    ((1251, 6), (1251, 6), 20.0)
    """

    name: str
    """Name in results and messages."""
    format: Mapping[str, Any] = field(default_factory=dict)
    """Meaning of the columns: the keys of ``[format]`` of a study."""
    role: Role = "identify"
    """Whether the log is used for the fit or for validation."""
    payload: str | None = None
    """Name of the payload during the recording."""
    servo_gain: float | Sequence[float] | None = None
    """Position gain of the servos relative to ``stiffness``, of all joints or of each."""
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
        servo_gain: float | Sequence[float] | None = None,
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
            columns["t_s"] = np.array(time_s, dtype=np.float64).reshape(-1)
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
            # A copy, so that later changes of the caller's arrays change no log.
            table = np.array(values, dtype=np.float64, order="F")
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
        return cls(name=name, format=channels, role=role, payload=payload, servo_gain=servo_gain, columns=columns)

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
        servo_gain: float | Sequence[float] | None = None,
        **format: Any,
    ) -> Log:
        """Creates a log from a data frame. ``position`` and ``torque`` name its columns: a list, a pattern such as
        ``"q{1..6}"``, or a mapping with units as in ``[format]``: ``{"columns": "q{1..6}_deg", "unit": "deg"}``.

        ``time`` names the column with seconds, dates or durations, or is ``{"column": "t", "unit": "ms"}``. Without it the
        index is the time if it contains dates, durations or decimal numbers (seconds). For an index of whole numbers give
        its unit, ``time={"unit": "ms"}``; for a plain row number give ``rate_hz``. Further keyword arguments are keys of
        ``[format]``, such as ``command="target{1..6}"`` in place of ``torque``.

        >>> import numpy as np, pandas as pd, dynident
        >>> t = pd.date_range("2026-01-05", periods=500, freq="5ms", tz="UTC")
        >>> table = pd.DataFrame({"q1": np.sin(np.arange(500) / 50), "tau1": 1.0}, index=t)
        >>> log = dynident.Log.from_pandas(table, "q{1..1}", "tau{1..1}")
        >>> log.time_s[:3]
        array([0.   , 0.005, 0.01 ])
        """
        from ._tables import columns_of, index_s

        time_unit = None
        if isinstance(time, Mapping) and "column" not in time and "file" not in time:
            time_unit, time = dict(time), None
        channels = _channels(position, torque, time, format)
        wanted = [name for value in channels.values() if isinstance(value, Mapping) for name in _stated_names(value)]
        columns = columns_of(table, name, wanted, channels.get("time"))
        if time_unit is not None or ("time" not in channels and "rate_hz" not in channels):
            columns["index_s"] = index_s(table, name, has_unit=time_unit is not None)
            channels["time"] = {**(time_unit or {}), "column": "index_s"}
        return cls(name=name, format=channels, role=role, payload=payload, servo_gain=servo_gain, columns=columns)

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
        servo_gain: float | Sequence[float] | None = None,
        **format: Any,
    ) -> Log:
        """Creates a log from a file in any supported format (CSV, Parquet, MCAP, rosbag2, MAT, HDF5, npy, ...). The
        content determines the format; ``dynident.log_contents(file)`` lists the channels. Columns as in
        ``from_pandas``.

        >>> import dynident
        >>> log = dynident.Log.read("examples/ur10_simulated/train.csv", "q{1..6}_rad", "tau{1..6}_Nm", time="t_s")
        >>> log.q.shape
        (2501, 6)
        """
        path = fspath(file)
        stem = path.replace("\\", "/").rstrip("/").rsplit("/", 1)[-1].rsplit(".", 1)[0]
        channels = _channels(position, torque, time, format)
        return cls(name=name or stem, format=channels, role=role, payload=payload, servo_gain=servo_gain, file=path)

    @property
    def samples(self) -> int | None:
        """Number of samples in memory; None for a file."""
        return None if self.columns is None else len(next(iter(self.columns.values())))

    @cached_property
    def _arrays(self) -> tuple[npt.NDArray[np.float64], list[npt.NDArray[np.float64] | None]]:
        return _native._log_arrays(json.dumps(self._section(), default=list), self._samples())

    @property
    def time_s(self) -> npt.NDArray[np.float64]:
        """Times of the selected samples, s, shape ``(samples,)``. A file is read once."""
        return self._arrays[0]

    @property
    def q(self) -> npt.NDArray[np.float64]:
        """Positions in the order of the columns, rad (m), shape ``(samples, n)``, after unit, scale and offset."""
        return self._quantity(0, "positions")

    @property
    def tau(self) -> npt.NDArray[np.float64]:
        """Torques, Nm (N), shape ``(samples, n)``. Raises ``LogError`` for a log without torque."""
        return self._quantity(1, "torques")

    @property
    def dq(self) -> npt.NDArray[np.float64]:
        """Recorded velocities, rad/s (m/s), shape ``(samples, n)``. Raises ``LogError`` for a log without velocities."""
        return self._quantity(2, "recorded velocities")

    @property
    def command(self) -> npt.NDArray[np.float64]:
        """Commanded positions, rad (m), shape ``(samples, n)``. Raises ``LogError`` for a log without commands."""
        return self._quantity(3, "commands")

    def _quantity(self, place: int, what: str) -> npt.NDArray[np.float64]:
        found = self._arrays[1][place]
        if found is None:
            raise LogError(f"{self.name}: the log has no {what}")
        return found

    def in_memory(self) -> Log:
        """The same log with its samples in memory, in SI, so that the file is not needed any more.

        >>> import dynident
        >>> log = dynident.Log.read("examples/ur10_simulated/train.csv", "q{1..6}_rad", "tau{1..6}_Nm", time="t_s")
        >>> log.in_memory()
        Log('train', 2501 samples, identify)
        """
        time_s, (q, tau, dq, command) = self._arrays
        assert q is not None
        log = Log.from_arrays(time_s, q, tau, command=command, dq=dq, name=self.name, role=self.role)
        return replace(log, payload=self.payload, servo_gain=self.servo_gain)

    def plot(self) -> Figure:
        """Plots positions and torques (or commands) of every joint over time. Needs matplotlib.

        >>> import dynident
        >>> len(dynident.example().logs[0].plot().axes)
        12
        """
        from ._plots import recording

        return recording(self)

    def validating(self) -> Log:
        """The same log with the role ``validate``.

        >>> import dynident
        >>> dynident.example().logs[0].validating()
        Log('train', 1251 samples, validate)
        """
        return replace(self, role="validate")

    def rows(self, first: int, end: int) -> Log:
        """The rows from ``first`` up to but excluding ``end``, 0-based.

        >>> import dynident
        >>> dynident.example().logs[0].rows(0, 500).q.shape
        (500, 6)
        """
        return replace(self, part={**self._other_parts(), "rows": [first, end]}, name=f"{self.name} [{first}:{end}]")

    def fraction(self, begin: float, end: float) -> Log:
        """The rows between two fractions of the log.

        >>> import dynident
        >>> dynident.example().logs[0].fraction(0.0, 0.65).name
        'train [0 % .. 65 %]'
        """
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
        if self.servo_gain is not None:
            section["servo_gain"] = np.asarray(self.servo_gain, dtype=np.float64).tolist()
        return section

    def _samples(self) -> tuple[str, tuple[list[str], list[npt.NDArray[np.float64]]]] | None:
        if self.columns is None:
            return None
        return self.name, (list(self.columns), list(self.columns.values()))

    def __repr__(self) -> str:
        where = self.file if self.columns is None else f"{self.samples} samples"
        return f"Log({self.name!r}, {where}, {self.role})"


def _stated_names(group: Mapping[str, Any]) -> list[str]:
    """Names of columns in a group of channels, without patterns."""
    columns = group.get("columns", group.get("column", []))
    names = [columns] if isinstance(columns, str) else columns if isinstance(columns, (list, tuple)) else []
    return [name for name in names if isinstance(name, str) and "{" not in name]


def with_different_names(logs: Iterable[Log]) -> list[Log]:
    """The logs; a name that several have gets a number, because results list logs by name."""
    logs = list(logs)
    taken = {log.name for log in logs}
    found: list[Log] = []
    known: set[str] = set()
    for log in logs:
        name, count = log.name, 1
        while name in known or (count > 1 and name in taken):
            count += 1
            name = f"{log.name} ({count})"
        known.add(name)
        found.append(log if name == log.name else replace(log, name=name))
    return found


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
