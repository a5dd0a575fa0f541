"""Many logs and robots: reduces logs to factors on each machine, merges the factors and compares the robots.

>>> from dynident import fleet
>>> factors = fleet.merged(lambda name: fleet.reduce(arm, logs[name], arm=name, **stated), logs)     # on="ray" on a cluster
>>> list(fleet.identify_each(factors))
['left', 'right']
"""

from __future__ import annotations

import json
import warnings
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
from ._native import Error, Factors, Robot, Study
from ._progress import Progress

if TYPE_CHECKING:
    import pandas as pd

__all__ = [
    "Drift",
    "Factors",
    "Failed",
    "FleetWarning",
    "LostWorkers",
    "ReducedLog",
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
    """A log that was reduced to factors.

    >>> from dynident import fleet
    >>> [log.name for log in fleet.logs(factors)]
    ['one', 'two']
    """

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

    >>> from dynident import fleet
    >>> one = fleet.reduce(arm, logs["left"], arm="left", **stated)
    >>> len(one)
    1
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

    >>> from dynident import fleet
    >>> len(fleet.merge([factors, factors]))
    2
    """
    return Factors.merged(list(parts))


def save(factors: Factors, path: str | PathLike[str]) -> None:
    """Writes factors to a file atomically.

    >>> import tempfile
    >>> from dynident import fleet
    >>> fleet.save(factors, tempfile.mkdtemp() + "/week.factors")
    """
    place = Path(path)
    beside = place.with_name(place.name + ".part")
    beside.write_bytes(factors.to_bytes())
    beside.replace(place)


def load(path: str | PathLike[str]) -> Factors:
    """Reads factors. Raises ``ResultError`` if the file was changed or is damaged.

    >>> import tempfile
    >>> from dynident import fleet
    >>> path = tempfile.mkdtemp() + "/week.factors"
    >>> fleet.save(factors, path)
    >>> fleet.load(path).to_bytes() == factors.to_bytes()
    True
    """
    return Factors.from_bytes(Path(path).read_bytes())


def logs(factors: Factors) -> list[ReducedLog]:
    """The logs in the factors, sorted by robot, time and name.

    >>> from dynident import fleet
    >>> [(log.name, log.arm) for log in fleet.logs(factors)]
    [('one', 'left'), ('two', 'right')]
    """

    def when(seconds: float | None) -> datetime | None:
        return None if seconds is None else datetime.fromtimestamp(seconds, timezone.utc)

    return [ReducedLog(name, arm, when(at), sha256, rows) for name, arm, at, sha256, rows in factors._logs]


def by_arm(factors: Factors) -> dict[str, Factors]:
    """Splits factors by robot; logs without a robot are under ``""``.

    >>> from dynident import fleet
    >>> list(fleet.by_arm(factors))
    ['left', 'right']
    """
    places: dict[str, list[int]] = {}
    for place, (_, arm, *_) in enumerate(factors._logs):
        places.setdefault(arm or "", []).append(place)
    return {arm: factors._at(own) for arm, own in places.items()}


def windows(factors: Factors, days: float = 7.0) -> dict[datetime, Factors]:
    """Splits factors into successive time windows, keyed by the mean time of the logs. Logs without a time are omitted.

    >>> from dynident import fleet
    >>> [at.day for at in fleet.windows(factors, days=7)]
    [5, 12]
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

    >>> from dynident import fleet
    >>> model = fleet.identify(factors, warn=False)
    >>> len(model.names)
    8
    """
    model = Model(_watched(progress, lambda hear: _native._identify_factors(factors, threads, hear)))
    return _warned(model) if warn else model


def errors(factors: Factors, model: Model) -> dict[str, float | None]:
    """Computes the relative torque error ``100 ‖τ - Wθ‖ / ‖τ‖`` of a model with the estimates θ for each log, in %. The
    value is exact and uses only factors. Use logs that were not used for the fit to validate the model.

    >>> from dynident import fleet
    >>> left, right = fleet.by_arm(factors).values()
    >>> fleet.errors(right, fleet.identify(left, warn=False))["two"] < 1.0
    True
    """
    found = _native._factors_errors(factors, model._native)
    return {name: error for (name, *_), error in zip(factors._logs, found, strict=True)}


def _identify_quietly(factors: Factors) -> Model:
    return identify(factors, threads=1, progress=False, warn=False)


def identify_each(factors: Factors, *, on: object = None, **options: Any) -> dict[str, Model]:
    """Identifies one model per robot. For ``on`` and ``options``, see ``each``. Problems of a model are listed in its
    ``problems``. With ``skip=True`` robots that failed are missing.

    >>> from dynident import fleet
    >>> factors = fleet.merge(fleet.reduce(arm, log, arm=name, **stated) for name, log in logs.items())
    >>> list(fleet.identify_each(factors))
    ['left', 'right']
    """
    arms = by_arm(factors)
    found = each(_identify_quietly, arms.values(), on=on, **options)
    return {arm: model for arm, model in zip(arms, found, strict=True) if isinstance(model, Model)}


class FleetWarning(UserWarning):
    """Items of a fleet were skipped.

    >>> import warnings
    >>> from dynident import fleet
    >>> with warnings.catch_warnings():
    ...     warnings.simplefilter("ignore", fleet.FleetWarning)
    ...     fleet.each(int, ["1", "one"], skip=True)
    [1, Failed('one', ValueError: invalid literal for int() with base 10: 'one')]
    """


class LostWorkers(Error):
    """An item stopped its worker in every attempt.

    >>> from dynident import fleet
    >>> raise fleet.LostWorkers("item 3 stopped its worker 4 times")
    Traceback (most recent call last):
    dynident.fleet.LostWorkers: item 3 stopped its worker 4 times
    """


@dataclass(frozen=True, eq=False)
class Failed:
    """An item without a result, in the place of the result; see ``each`` with ``skip=True``.

    >>> from dynident import fleet
    >>> fleet.Failed("log 3", "its worker was lost 4 times")
    Failed('log 3', its worker was lost 4 times)
    """

    item: object
    """The item."""
    reason: str
    """Why it has no result."""

    def __repr__(self) -> str:
        item = repr(self.item)
        return f"Failed({item if len(item) <= 80 else item[:77] + '...'}, {self.reason})"


def each(
    function: Callable[[Item], Found],
    items: Iterable[Item],
    *,
    on: object = None,
    retries: int = 3,
    skip: bool = False,
    progress: bool | Progress | None = False,
    resources: Mapping[str, Any] | None = None,
) -> list[Any]:
    """Computes ``[function(item) for item in items]`` in that order, on other processes and machines.

    ``on`` is None (sequential, in this process), ``"ray"`` or ``"dask"`` (the connected cluster, or one on this
    machine), a ``dask.distributed.Client``, or a ``concurrent.futures`` executor. Ray and Dask replace lost workers and
    repeat their items; the results do not change, because every job is deterministic. Items may be logs, seeds of
    ``design``, studies of ``simulate`` or whole iterations.

    An item that stops its worker (a crash, too little memory) is repeated ``retries`` times and then raises
    ``LostWorkers``. An exception of ``function`` is raised here without a retry. With ``skip`` both give a ``Failed`` in
    the place of the result, and a ``FleetWarning``. A process pool of ``concurrent.futures`` does not replace workers:
    after a crash all items that are not finished fail. ``progress`` is a display, or a callable that receives
    ``("items", done, all)``. ``resources`` are those of the engine for one item: ``{"num_cpus": 2}`` for Ray,
    ``{"GPU": 1}`` for Dask.

    >>> from dynident import fleet
    >>> fleet.each(abs, [-1, 2, -3])
    [1, 2, 3]
    """
    if retries < 0:
        raise ValueError(f"retries = {retries}: give 0 or more")
    todo = list(items)

    def run(hear: Progress | None) -> list[Any]:
        done = _Done(todo, hear, skip, retries)
        if on is None:
            for place, item in enumerate(todo):
                done.take(place, partial(function, item))
        elif on == "ray":
            _on_ray(function, todo, done, resources or {})
        elif isinstance(on, Executor):
            _on_executor(function, todo, done, on)
        else:
            _on_dask(function, todo, done, None if on == "dask" else on, resources or {})
        return done.found

    return _watched(progress, run)


class _Done:
    """Results in the order of the items."""

    def __init__(self, items: Sequence[object], hear: Progress | None, skip: bool, retries: int) -> None:
        self.items, self.hear, self.skip, self.retries = items, hear, skip, retries
        self.found: list[Any] = [None] * len(items)
        self.count = 0

    def take(self, place: int, result: Callable[[], object], lost: tuple[type[BaseException], ...] = ()) -> None:
        """Stores the result of an item. ``lost`` are the exceptions of the engine for a lost worker."""
        try:
            self.found[place] = result()
        except lost as error:
            kind = type(error).__name__
            reason = f"its worker was lost in {self.retries + 1} attempt(s) ({kind})"
            if not self.skip:
                raise LostWorkers(
                    f"item {place}, {Failed(self.items[place], reason)!r}: test it alone, or leave it out with skip=True"
                ) from error
            self._failed(place, reason)
        except Exception as error:
            if not self.skip:
                raise
            self._failed(place, f"{type(error).__name__}: {error}")
        self.count += 1
        if self.hear is not None:
            self.hear("items", self.count, len(self.items))

    def _failed(self, place: int, reason: str) -> None:
        self.found[place] = failed = Failed(self.items[place], reason)
        warnings.warn(f"item {place} was skipped: {failed!r}", FleetWarning, stacklevel=2)


def merged(
    function: Callable[[Item], Factors], items: Iterable[Item], *, on: object = None, batch: int = 16, **options: Any
) -> Factors:
    """Computes ``merge(each(function, items, on=on))``. A worker takes ``batch`` items at a time and merges their
    factors. This sends fewer and larger messages, for logs that are reduced in a few milliseconds. If a worker is lost,
    its whole batch is repeated. ``options`` are those of ``each``; with ``skip=True`` the items of a failed batch are
    repeated one by one, so that only failing items are left out.

    >>> from dynident import fleet
    >>> factors = fleet.merged(lambda name: fleet.reduce(arm, logs[name], arm=name, **stated), logs, batch=2)
    >>> len(factors)
    2
    """
    if batch < 1:
        raise ValueError(f"batch = {batch}: give at least 1")
    todo = list(items)
    parts = [todo[begin : begin + batch] for begin in range(0, len(todo), batch)]
    with warnings.catch_warnings():
        # A failed batch is not yet a failed item.
        if batch > 1:
            warnings.simplefilter("ignore", FleetWarning)
        found = each(partial(_merged_here, function), parts, on=on, **options)
    good = [one for one in found if not isinstance(one, Failed)]
    again = [item for part, one in zip(parts, found, strict=True) if isinstance(one, Failed) for item in part]
    if again and batch > 1:
        good += [one for one in each(function, again, on=on, **options) if not isinstance(one, Failed)]
    return merge(good)


def _merged_here(function: Callable[[Item], Factors], items: Sequence[Item]) -> Factors:
    return merge([function(item) for item in items])


def _on_executor(function: Callable[[Item], Found], items: Sequence[Item], done: _Done, executor: Executor) -> None:
    from concurrent.futures import BrokenExecutor

    futures = [executor.submit(function, item) for item in items]
    done.retries = 0
    for place, future in enumerate(futures):
        done.take(place, future.result, (BrokenExecutor,))


def _on_ray(
    function: Callable[[Item], Found], items: Sequence[Item], done: _Done, resources: Mapping[str, Any]
) -> None:
    import ray

    if not ray.is_initialized():
        ray.init(include_dashboard=False, log_to_driver=False)

    def run(item: Item) -> Found:
        return function(item)

    # Tasks of lost workers are retried; exceptions of the function are not retried.
    task = ray.remote(**{"max_retries": done.retries, "retry_exceptions": False, **resources})(run)
    most = max(2, 4 * int(ray.cluster_resources().get("CPU", 1)))
    running: dict[Any, int] = {}
    for place, item in enumerate(items):
        if len(running) >= most:
            _collect(running, done)
        running[task.remote(item)] = place
    while running:
        _collect(running, done)


def _collect(running: dict[Any, int], done: _Done) -> None:
    """Waits for one task. Only a few tasks run at once, so that few results are stored until the last task ends."""
    import ray
    from ray.exceptions import NodeDiedError, OutOfMemoryError, WorkerCrashedError

    finished, _ = ray.wait(list(running))
    for reference in finished:
        lost = (WorkerCrashedError, OutOfMemoryError, NodeDiedError)
        done.take(running.pop(reference), partial(ray.get, reference), lost)


def _on_dask(
    function: Callable[[Item], Found], items: Sequence[Item], done: _Done, client: Any, resources: Mapping[str, Any]
) -> None:
    from distributed import Client, as_completed, default_client
    from distributed.scheduler import KilledWorker

    own = None
    if client is None:
        try:
            client = default_client()
        except ValueError:
            client = own = Client(processes=True, dashboard_address=None)

    def allow(failures: int, dask_scheduler: Any = None) -> int:
        before, dask_scheduler.allowed_failures = dask_scheduler.allowed_failures, failures
        return int(before)

    # A lost worker does not mean that all of its items failed, so the scheduler repeats items often. An item that is
    # still lost is repeated alone, which shows whether it stops its workers.
    before = client.run_on_scheduler(allow, max(done.retries, 20))
    further = {"resources": dict(resources)} if resources else {}
    try:
        futures = client.map(function, items, pure=False, **further)
        places = {future.key: place for place, future in enumerate(futures)}
        suspicious = []
        for future in as_completed(futures):
            if isinstance(future.exception(), KilledWorker):
                suspicious.append(places[future.key])
            else:
                done.take(places[future.key], future.result)
        client.run_on_scheduler(allow, done.retries)
        for place in sorted(suspicious):
            done.take(place, client.submit(function, items[place], pure=False, **further).result, (KilledWorker,))
    finally:
        client.run_on_scheduler(allow, before)
        if own is not None:
            own.close()


@dataclass(frozen=True, eq=False)
class Spread:
    """Differences between the robots of a fleet.

    >>> from dynident import fleet
    >>> fleet.spread(models).unlike
    []
    """

    names: list[str]
    """The base parameters."""
    result: dict[str, Any]
    """For each parameter ``mean``, ``mean_std``, ``between_std`` (standard deviation between robots, without the
    estimation error), ``tail`` and ``differs``. For each robot ``deviation`` (of every parameter, in standard
    deviations expected for a robot like the others), ``worst``, ``tail`` and ``is_unlike``.
    """

    def __repr__(self) -> str:
        return f"Spread({len(self.result['members'])} robots, unlike: {', '.join(self.unlike) or 'none'})"

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
    """Changes of the parameters of one robot over time.

    >>> from dynident import fleet
    >>> fleet.drift(weeks).drifting
    []
    """

    names: list[str]
    """The base parameters."""
    result: list[dict[str, Any] | None]
    """For each parameter ``slope`` (per day), ``slope_std``, ``half_width_95``, ``scatter``, ``tail``, ``drifts``."""

    def __repr__(self) -> str:
        return f"Drift(drifting: {', '.join(self.drifting) or 'none'})"

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

    >>> from dynident import fleet
    >>> found = fleet.spread(models)
    >>> found.unlike, found.differing
    ([], [])
    """
    names, values, std = _table(models)
    found = json.loads(_native._spread([str(name) for name in models], values, std, false_alarm))
    return Spread(names, found)


def drift(models: Mapping[datetime, Model], *, false_alarm: float = 0.01) -> Drift:
    """Fits a line over time to each parameter of one robot, from at least three models (see ``windows``), and finds
    parameters that change. ``false_alarm`` is the probability that any parameter of an unchanged robot is reported.

    >>> from dynident import fleet
    >>> fleet.drift(weeks, false_alarm=0.01).drifting
    []
    """
    names, values, std = _table(models)
    days = [(_seconds(at) or 0.0) / 86_400.0 for at in models]
    found = json.loads(_native._drift([str(at) for at in models], values, std, days, false_alarm))
    return Drift(names, found["parameters"])
