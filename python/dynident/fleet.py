"""Many logs and robots: reduces logs to factors on each machine, merges the factors and compares the robots.

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
    """A log that was reduced to factors."""

    name: str
    """Name of the log."""
    arm: str | None
    """The robot on which the log was recorded."""
    recorded_at: datetime | None
    """When, UTC."""
    sha256: str
    """Hash of the samples; logs with the same hash are the same log."""
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
    """Reduces the training logs of a study to factors. Their size is a few kilobytes per joint and segment, independent
    of the length of the log.

    All logs need the same settings. State cut-off and friction, or give ``like``, a model identified from a few of the
    logs; its cut-off, friction and lag are then used. ``arm`` and ``recorded_at`` (UTC if without a time zone, or
    seconds since 1970) identify the log. ``segments`` is the number of segments per log: error bars from few logs need
    many segments, with hundreds of logs one is enough. For other arguments, see ``dynident.identify``. The default is
    one thread, because a fleet job uses one worker per processor.
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
    """Merges factors. The result is bit-identical for any order of the logs, and duplicate logs are ignored.

    Raises ``ResultError`` if the factors belong to different robots or settings.
    """
    return Factors.merged(list(parts))


def save(factors: Factors, path: str | PathLike[str]) -> None:
    """Writes factors to a file atomically."""
    place = Path(path)
    beside = place.with_name(place.name + ".part")
    beside.write_bytes(factors.to_bytes())
    beside.replace(place)


def load(path: str | PathLike[str]) -> Factors:
    """Reads factors. Raises ``ResultError`` if the file was changed or is damaged."""
    return Factors.from_bytes(Path(path).read_bytes())


def logs(factors: Factors) -> list[ReducedLog]:
    """The logs in the factors, sorted by robot, time and name."""

    def when(seconds: float | None) -> datetime | None:
        return None if seconds is None else datetime.fromtimestamp(seconds, timezone.utc)

    return [ReducedLog(name, arm, when(at), sha256, rows) for name, arm, at, sha256, rows in factors._logs]


def by_arm(factors: Factors) -> dict[str, Factors]:
    """Splits factors by robot; logs without a robot are under ``""``."""
    places: dict[str, list[int]] = {}
    for place, (_, arm, *_) in enumerate(factors._logs):
        places.setdefault(arm or "", []).append(place)
    return {arm: factors._at(own) for arm, own in places.items()}


def windows(factors: Factors, days: float = 7.0) -> dict[datetime, Factors]:
    """Splits factors into successive time windows, keyed by the mean time of the logs. Logs without a time are omitted.
    """
    if not days > 0.0:
        raise ValueError(f"days = {days}: give a positive length")
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
    """Identifies one model from all logs of ``factors``, as ``dynident.identify`` does with stated cut-off, friction
    and lag. Results that need samples are missing: delays, torque over time and held-out errors (see ``errors``).
    """
    model = Model(_watched(progress, lambda hear: _native._identify_factors(factors, threads, hear)))
    return _warned(model) if warn else model


def errors(factors: Factors, model: Model) -> dict[str, float | None]:
    """Computes the relative torque error ``100 ‖τ - Wθ‖ / ‖τ‖`` of a model with the estimates θ for each log, in %. The
    value is exact and uses only factors. Use logs that were not used for the fit to validate the model.
    """
    found = _native._factors_errors(factors, model._native)
    return {name: error for (name, *_), error in zip(factors._logs, found, strict=True)}


def _identify_quietly(factors: Factors) -> Model:
    return identify(factors, threads=1, progress=False, warn=False)


def identify_each(factors: Factors, *, on: object = None) -> dict[str, Model]:
    """Identifies one model per robot. For ``on``, see ``each``. Problems of a model are listed in its ``problems``."""
    arms = by_arm(factors)
    return dict(zip(arms, each(_identify_quietly, arms.values(), on=on), strict=True))


def each(function: Callable[[Item], Found], items: Iterable[Item], *, on: object = None) -> list[Found]:
    """Computes ``[function(item) for item in items]`` in that order, on other processes and machines.

    ``on`` is None (sequential, in this process), ``"ray"`` or ``"dask"`` (the connected cluster, or one on this
    machine), a ``dask.distributed.Client``, or a ``concurrent.futures`` executor. Ray and Dask replace lost workers and
    repeat their items; the results do not change, because every job is deterministic. An exception of ``function`` is
    raised here without a retry. Items may be logs, seeds of ``design``, studies of ``simulate`` or whole iterations.
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
    """Computes ``merge(each(function, items, on=on))``. A worker takes ``batch`` items at a time and merges their
    factors. This sends fewer and larger messages, for logs that are reduced in a few milliseconds. If a worker is lost,
    its whole batch is repeated.
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

    # Tasks of lost workers are retried without limit; exceptions of the function are not retried.
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
    """Waits for one task. Only a few tasks run at once, so that few results are stored until the last task ends."""
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
        # A lost worker does not mean that its item failed.
        with dask.config.set({"distributed.scheduler.allowed-failures": 1000}):
            return list(client.gather(client.map(function, items, pure=False)))
    finally:
        if own is not None:
            own.close()


@dataclass(frozen=True, eq=False)
class Spread:
    """Differences between the robots of a fleet."""

    names: list[str]
    """The base parameters."""
    result: dict[str, Any]
    """For each parameter ``mean``, ``mean_std``, ``between_std`` (standard deviation between robots, without the
    estimation error), ``tail`` and ``differs``. For each robot ``deviation`` (of every parameter, in standard
    deviations expected for a robot like the others), ``worst``, ``tail`` and ``is_unlike``.
    """

    @property
    def unlike(self) -> list[str]:
        """Robots that are not like the others."""
        return [robot["name"] for robot in self.result["members"] if robot["is_unlike"]]

    @property
    def differing(self) -> list[str]:
        """Parameters that differ between robots by more than their error bars; outlier robots are excluded."""
        found = zip(self.names, self.result["parameters"], strict=True)
        return [name for name, one in found if one is not None and one["differs"]]

    def why(self, robot: str) -> str | None:
        """The parameter with the largest deviation of each robot."""
        (own,) = (one for one in self.result["members"] if one["name"] == robot)
        return None if own["worst"] is None else self.names[own["worst"]]

    def to_pandas(self) -> pd.DataFrame:
        """One row for each parameter."""
        import pandas

        rows = [{} if one is None else one for one in self.result["parameters"]]
        return pandas.DataFrame(rows, index=pandas.Index(self.names, name="parameter"))


@dataclass(frozen=True, eq=False)
class Drift:
    """Changes of the parameters of one robot over time."""

    names: list[str]
    """The base parameters."""
    result: list[dict[str, Any] | None]
    """For each parameter ``slope`` (per day), ``slope_std``, ``half_width_95``, ``scatter``, ``tail``, ``drifts``."""

    @property
    def drifting(self) -> list[str]:
        """Parameters that change over time."""
        return [name for name, one in zip(self.names, self.result, strict=True) if one is not None and one["drifts"]]


def _table(models: Mapping[Any, Model]) -> tuple[list[str], npt.NDArray[np.float64], npt.NDArray[np.float64]]:
    """Names, values and standard deviations of the parameters; zero in place of values that are not finite."""
    if not models:
        raise ValueError("no models: give at least three")
    names = next(iter(models.values())).names
    for name, model in models.items():
        if model.names != names:
            raise ValueError(f"the model of {name} has different base parameters: identify all models from factors of one study")
    std = np.nan_to_num(np.array([model.std for model in models.values()]), nan=0.0, posinf=0.0)
    return names, np.nan_to_num(np.array([model.values for model in models.values()])), std


def spread(models: Mapping[str, Model], *, false_alarm: float = 0.01) -> Spread:
    """Compares the models of at least three robots. Finds parameters that differ by more than their error bars, and
    outlier robots. ``false_alarm`` is the probability that any robot, or any parameter, of identical robots is
    reported. Equations and sources: ``dynident-estimation``, ``fleet``.
    """
    names, values, std = _table(models)
    found = json.loads(_native._spread([str(name) for name in models], values, std, false_alarm))
    return Spread(names, found)


def drift(models: Mapping[datetime, Model], *, false_alarm: float = 0.01) -> Drift:
    """Fits a line over time to each parameter of one robot, from at least three models (see ``windows``), and finds
    parameters that change. ``false_alarm`` is the probability that any parameter of an unchanged robot is reported.
    """
    names, values, std = _table(models)
    days = [(_seconds(at) or 0.0) / 86_400.0 for at in models]
    found = json.loads(_native._drift([str(at) for at in models], values, std, days, false_alarm))
    return Drift(names, found["parameters"])
