"""Many logs, many robots: reduce logs where they lie, put the factors together, see how a fleet differs.

>>> from dynident import fleet                                                              # doctest: +SKIP
>>> factors = fleet.merged(reduce_one, paths, on="ray")                                     # doctest: +SKIP
>>> models = fleet.identify_each(factors, on="ray")                                         # doctest: +SKIP
>>> fleet.spread(models).unlike                                                             # doctest: +SKIP
['arm-17']
"""

from __future__ import annotations

import json
from collections.abc import Callable, Iterable, Mapping, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass
from datetime import datetime, timedelta, timezone
from functools import partial
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

import numpy as np
import numpy.typing as npt

from . import _native
from ._jobs import _study_of, _warned, _watched
from ._log import Log
from ._model import Model
from ._native import Factors, Robot, Study
from ._progress import Progress

if TYPE_CHECKING:
    import pandas as pd

__all__ = [
    "Drift",
    "Factors",
    "Spread",
    "by_arm",
    "drift",
    "each",
    "errors",
    "identify",
    "identify_each",
    "load",
    "logs",
    "merge",
    "merged",
    "reduce",
    "save",
    "spread",
    "windows",
]

Item = TypeVar("Item")
Found = TypeVar("Found")


@dataclass(frozen=True)
class ReducedLog:
    """A log of which factors are left."""

    name: str
    """What it is called."""
    arm: str | None
    """The robot that it was recorded on."""
    recorded_at: datetime | None
    """When, UTC."""
    sha256: str
    """Hash of its numbers: two logs with the same one are one log."""
    rows: int
    """Filtered rows."""


def reduce(
    study: Study | Robot | str | PathLike[str],
    logs: Log | Iterable[Log] | None = None,
    *,
    like: Model | None = None,
    arm: str | None = None,
    recorded_at: datetime | float | None = None,
    allow_command: bool = False,
    segments: int = 16,
    threads: int | None = 1,
    progress: bool | Progress | None = False,
    **sections: Any,
) -> Factors:
    """Reduces the training logs of a study to factors: some kilobytes for each joint and segment, however long the log.

    All logs must be read alike, so cut-off and friction are stated, or those of ``like``, a model that was identified
    from a few of them (its lag as well). ``arm`` and ``recorded_at`` (UTC where it names no zone, or seconds since 1970)
    say whose log it is; ``segments`` are kept of each log: error bars of few logs need many, of hundreds one will do.
    Other arguments as of ``dynident.identify``; one thread by default, for a fleet has a worker for each processor.
    """
    whole = _study_of(study, logs, sections, allow_command)
    seconds = _seconds(recorded_at)
    native = None if like is None else like._native
    return _watched(progress, lambda hear: _native._reduce(whole, native, arm, seconds, segments, threads, hear))


def _seconds(at: datetime | float | None) -> float | None:
    if isinstance(at, datetime):
        return (at if at.tzinfo else at.replace(tzinfo=timezone.utc)).timestamp()
    return at


def merge(parts: Iterable[Factors]) -> Factors:
    """All logs of several, the same to the last bit in whatever order they come and however often a log comes.

    Raises ``ResultError`` for factors of another robot or other settings.
    """
    return Factors.merged(list(parts))


def save(factors: Factors, path: str | PathLike[str]) -> None:
    """Writes factors into a file, whole or not at all."""
    place = Path(path)
    beside = place.with_name(place.name + ".part")
    beside.write_bytes(factors.to_bytes())
    beside.replace(place)


def load(path: str | PathLike[str]) -> Factors:
    """Reads factors; raises ``ResultError`` for a file that is not as it was written."""
    return Factors.from_bytes(Path(path).read_bytes())


def logs(factors: Factors) -> list[ReducedLog]:
    """The logs of factors, by robot, time, name."""

    def when(seconds: float | None) -> datetime | None:
        return None if seconds is None else datetime.fromtimestamp(seconds, timezone.utc)

    return [ReducedLog(name, arm, when(at), sha256, rows) for name, arm, at, sha256, rows in factors._logs]


def by_arm(factors: Factors) -> dict[str, Factors]:
    """The factors of each robot alone; logs that name none stand under ``""``."""
    places: dict[str, list[int]] = {}
    for place, (_, arm, *_) in enumerate(factors._logs):
        places.setdefault(arm or "", []).append(place)
    return {arm: factors._at(own) for arm, own in places.items()}


def windows(factors: Factors, days: float = 7.0) -> dict[datetime, Factors]:
    """The factors of successive windows of time, by the middle of the logs in each; logs without a time are left out."""
    if not days > 0.0:
        raise ValueError(f"days = {days}: give a length above zero")
    known = [(at, place) for place, (_, _, at, *_) in enumerate(factors._logs) if at is not None]
    if not known:
        return {}
    first = min(at for at, _ in known)
    found: dict[int, list[tuple[float, int]]] = {}
    for at, place in known:
        found.setdefault(int((at - first) // timedelta(days=days).total_seconds()), []).append((at, place))

    def middle(own: list[tuple[float, int]]) -> datetime:
        return datetime.fromtimestamp(float(np.mean([at for at, _ in own])), timezone.utc)

    return {middle(own): factors._at([place for _, place in own]) for _, own in sorted(found.items())}


def identify(
    factors: Factors, *, threads: int | None = None, progress: bool | Progress | None = None, warn: bool = True
) -> Model:
    """The model that explains all logs of ``factors``, as ``dynident.identify`` makes it of the logs with cut-off,
    friction and lag stated. What only samples show is missing: delays, torque over time, held-out errors (``errors``
    has those from factors).
    """
    model = Model(_watched(progress, lambda hear: _native._identify_factors(factors, threads, hear)))
    return _warned(model) if warn else model


def errors(factors: Factors, model: Model) -> dict[str, float | None]:
    """By log ``100 ‖τ - Wθ‖ / ‖τ‖`` of a model, θ its estimates: exact, from factors alone. Of logs that the model was
    not fitted to, this is its proof.
    """
    found = _native._factors_errors(factors, model._native)
    return {name: error for (name, *_), error in zip(factors._logs, found, strict=True)}


def _identify_quietly(factors: Factors) -> Model:
    return identify(factors, threads=1, progress=False, warn=False)


def identify_each(factors: Factors, *, on: object = None) -> dict[str, Model]:
    """One model for each robot. ``on`` as of ``each``; what stands against a model stands in its ``problems``."""
    arms = by_arm(factors)
    return dict(zip(arms, each(_identify_quietly, arms.values(), on=on), strict=True))


def each(function: Callable[[Item], Found], items: Iterable[Item], *, on: object = None) -> list[Found]:
    """``[function(item) for item in items]``, in that order, on other processes and machines.

    ``on`` is None (here, one after the other), ``"ray"`` or ``"dask"`` (the cluster that this process is connected to,
    or one on this machine), a ``dask.distributed.Client``, or a ``concurrent.futures`` executor. Workers that are lost
    are replaced and their items done again by Ray or Dask; as every job gives the same bits wherever it runs, no result
    shows it. What ``function`` raises is raised here and not tried again. Seeds of ``design``, studies of ``simulate``
    and whole iterations go through it as logs do.
    """
    todo = list(items)
    if on is None:
        return [function(item) for item in todo]
    if on == "ray":
        return _on_ray(function, todo)
    if isinstance(on, Executor):
        return list(on.map(function, todo))
    return _on_dask(function, todo, None if on == "dask" else on)


def merged(
    function: Callable[[Item], Factors], items: Iterable[Item], *, on: object = None, batch: int = 16
) -> Factors:
    """``merge(each(function, items, on=on))``, where a worker takes ``batch`` items at a time and merges what they give:
    fewer and larger messages, for logs whose reduction takes some milliseconds. Of a lost worker the whole batch is done
    again.
    """
    if batch < 1:
        raise ValueError(f"batch = {batch}: give at least 1")
    todo = list(items)
    parts = [todo[begin : begin + batch] for begin in range(0, len(todo), batch)]
    return merge(each(partial(_merged_here, function), parts, on=on))


def _merged_here(function: Callable[[Item], Factors], items: Sequence[Item]) -> Factors:
    return merge([function(item) for item in items])


def _on_ray(function: Callable[[Item], Found], items: Sequence[Item]) -> list[Found]:
    import ray

    if not ray.is_initialized():
        ray.init(include_dashboard=False, log_to_driver=False)
    def run(item: Item) -> Found:
        return function(item)

    # Lost workers are no failure, however many; what the function raises is.
    task = ray.remote(max_retries=-1, retry_exceptions=False)(run)
    most = max(2, 4 * int(ray.cluster_resources().get("CPU", 1)))
    found: list[Any] = [None] * len(items)
    running: dict[Any, int] = {}
    for place, item in enumerate(items):
        if len(running) >= most:
            _collect(running, found)
        running[task.remote(item)] = place
    while running:
        _collect(running, found)
    return found


def _collect(running: dict[Any, int], found: list[Any]) -> None:
    """Waits for one task; few are under way at once, so that no result waits in a store for the last one."""
    import ray

    done, _ = ray.wait(list(running))
    for reference in done:
        found[running.pop(reference)] = ray.get(reference)


def _on_dask(function: Callable[[Item], Found], items: Sequence[Item], client: Any) -> list[Found]:
    import dask
    from distributed import Client, default_client

    own = None
    if client is None:
        try:
            client = default_client()
        except ValueError:
            client = own = Client(processes=True, dashboard_address=None)
    try:
        # A worker that is lost is no failure of the item that it was at.
        with dask.config.set({"distributed.scheduler.allowed-failures": 1000}):
            return list(client.gather(client.map(function, items, pure=False)))
    finally:
        if own is not None:
            own.close()


@dataclass(frozen=True, eq=False)
class Spread:
    """How the robots of a fleet differ."""

    names: list[str]
    """The base parameters."""
    result: dict[str, Any]
    """By parameter ``mean``, ``mean_std``, ``between_std`` (from robot to robot, beyond the bars), ``tail``, ``differs``;
    by robot ``deviation`` (of every parameter, in standard deviations of what a robot like the others shows), ``worst``,
    ``tail``, ``is_unlike``.
    """

    @property
    def unlike(self) -> list[str]:
        """Robots that are not like the others."""
        return [robot["name"] for robot in self.result["members"] if robot["is_unlike"]]

    @property
    def differing(self) -> list[str]:
        """Parameters that differ from robot to robot beyond their bars, robots that are unlike set aside."""
        found = zip(self.names, self.result["parameters"], strict=True)
        return [name for name, one in found if one is not None and one["differs"]]

    def why(self, robot: str) -> str | None:
        """The parameter by which a robot is furthest off."""
        (own,) = (one for one in self.result["members"] if one["name"] == robot)
        return None if own["worst"] is None else self.names[own["worst"]]

    def to_pandas(self) -> pd.DataFrame:
        """One row for each parameter."""
        import pandas

        rows = [{} if one is None else one for one in self.result["parameters"]]
        return pandas.DataFrame(rows, index=pandas.Index(self.names, name="parameter"))


@dataclass(frozen=True, eq=False)
class Drift:
    """How the parameters of one robot change over time."""

    names: list[str]
    """The base parameters."""
    result: list[dict[str, Any] | None]
    """By parameter ``slope`` (a day), ``slope_std``, ``half_width_95``, ``scatter``, ``tail``, ``drifts``."""

    @property
    def drifting(self) -> list[str]:
        """Parameters that wander."""
        return [name for name, one in zip(self.names, self.result, strict=True) if one is not None and one["drifts"]]


def _table(models: Mapping[Any, Model]) -> tuple[list[str], npt.NDArray[np.float64], npt.NDArray[np.float64]]:
    """Names of the parameters, values and standard deviations; zero for a value that was not estimated."""
    if not models:
        raise ValueError("there is no model: give at least three")
    names = next(iter(models.values())).names
    for name, model in models.items():
        if model.names != names:
            raise ValueError(f"the model of {name} has other base parameters: identify all from factors of one study")
    std = np.nan_to_num(np.array([model.std for model in models.values()]), nan=0.0, posinf=0.0)
    return names, np.nan_to_num(np.array([model.values for model in models.values()])), std


def spread(models: Mapping[str, Model], *, false_alarm: float = 0.01) -> Spread:
    """Compares the models of several robots, at least three: which parameters differ beyond their bars, which robot is
    not like the others. ``false_alarm`` is the chance that any robot, or any parameter, of a fleet of equals is named.
    Equations and sources: ``dynident-estimation``, ``fleet``.
    """
    names, values, std = _table(models)
    found = json.loads(_native._spread([str(name) for name in models], values, std, false_alarm))
    return Spread(names, found)


def drift(models: Mapping[datetime, Model], *, false_alarm: float = 0.01) -> Drift:
    """Lays a line through each parameter of one robot's models over time, at least three (``windows`` makes their
    factors): which wander. ``false_alarm`` is the chance that any parameter of a robot that does not change is named.
    """
    names, values, std = _table(models)
    days = [(_seconds(at) or 0.0) / 86_400.0 for at in models]
    found = json.loads(_native._drift([str(at) for at in models], values, std, days, false_alarm))
    return Drift(names, found["parameters"])
