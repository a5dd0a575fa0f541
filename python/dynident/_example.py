"""The built-in example: an arm with simulated recordings."""

from __future__ import annotations

import tempfile
from dataclasses import dataclass
from os import PathLike, fspath
from pathlib import Path

from . import _native
from ._log import Log
from ._native import Robot, Study


@dataclass(frozen=True, eq=False)
class Example:
    """An arm with two recordings; see ``example``.

    >>> import dynident
    >>> dynident.example().robot.dof
    6
    """

    robot: Robot
    """The arm, a UR10; its recordings have other masses and friction."""
    logs: list[Log]
    """A recording for the fit and one for validation."""
    study: Study
    """The same as a study."""
    folder: Path | None
    """The folder with the files; None without one."""

    def __repr__(self) -> str:
        names = ", ".join(log.name for log in self.logs)
        return f"Example({self.robot.name!r}, logs {names}{'' if self.folder is None else f', in {fspath(self.folder)}'})"


def example(folder: str | PathLike[str] | None = None) -> Example:
    """Gives a robot with two simulated recordings, as ``dynident init`` writes them. It needs no file. With ``folder``,
    which must be new or empty, the files stay there.

    >>> import dynident
    >>> given = dynident.example()
    >>> given
    Example('ur10', logs train, test)
    >>> given.logs[0].q.shape
    (1251, 6)
    """
    if folder is not None:
        return _written(Path(folder), True)
    with tempfile.TemporaryDirectory() as scratch:
        return _written(Path(scratch) / "example", False)


def _written(folder: Path, stays: bool) -> Example:
    if _native._command(["dynident", "init", fspath(folder), "--quiet"]) != 0:
        raise _native.Error(f"{folder}: the example cannot be written there: give a new or an empty folder")
    robot = Robot.load(folder / "ur10.urdf")
    q, tau = "q{1..6}_rad", "tau{1..6}_Nm"
    logs = [
        Log.read(folder / "train.csv", q, tau, time="t_s", name="train"),
        Log.read(folder / "test.csv", q, tau, time="t_s", name="test", role="validate"),
    ]
    if stays:
        return Example(robot, logs, Study.load(folder / "study.toml"), folder)
    # Nothing of the files is needed later.
    logs = [log.in_memory() for log in logs]
    robot = Robot.from_urdf(robot.text)
    from ._study import study

    return Example(robot, logs, study(robot, logs), None)
