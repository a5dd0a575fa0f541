"""The jobs: check, identify, validate, design, simulate."""

from __future__ import annotations

import html
import json
import warnings
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from os import PathLike, fspath
from typing import Any, TypeVar

import numpy as np
import numpy.typing as npt

from . import _native
from ._log import Log
from ._model import Model
from ._native import Robot, Study, StudyError
from ._page import problem, table
from ._progress import Line, Progress, is_watched
from ._servo import ServoModel
from ._study import study as make_study
from ._study import with_logs

Found = TypeVar("Found")
Fitted = TypeVar("Fitted", Model, ServoModel)


class ProblemWarning(UserWarning):
    """A problem of a result. Read it before loading the model into a robot.

    >>> import dynident, warnings
    >>> with warnings.catch_warnings():
    ...     warnings.simplefilter("error", dynident.ProblemWarning)  # stops a script at a problem
    """


def _study_of(
    study: Study | Robot | str | PathLike[str], logs: Log | Iterable[Log] | None, sections: Any, allow_command: bool
) -> Study:
    if isinstance(study, Study):
        if sections:
            raise TypeError(f"{', '.join(sections)}: a Study already contains its sections: omit these arguments")
        return study if logs is None else with_logs(study, logs)
    if isinstance(study, Robot):
        return make_study(study, () if logs is None else logs, **sections)
    path = fspath(study)
    if logs is None and not sections and path.endswith(".toml"):
        return Study.load(path, allow_command=allow_command)
    return make_study(Robot.load(path, allow_command=allow_command), () if logs is None else logs, **sections)


def _watched(progress: bool | Progress | None, job: Callable[[Progress | None], Found]) -> Found:
    if progress is False or (progress is None and not is_watched()):
        return job(None)
    if callable(progress):
        return job(progress)
    line = Line()
    try:
        return job(line)
    finally:
        line.end()


def _warned(model: Fitted) -> Fitted:
    for problem in model.problems:
        warnings.warn(problem, ProblemWarning, stacklevel=3)
    return model


def identify(
    study: Study | Robot | str | PathLike[str],
    logs: Log | Iterable[Log] | None = None,
    *,
    allow_command: bool = False,
    threads: int | None = None,
    progress: bool | Progress | None = None,
    **sections: Any,
) -> Model:
    """Fits a dynamic model to recordings and tests it on the held-out recordings.

    ``study`` is a ``Study``, the path of one, or a robot (a ``Robot`` or the path of a robot description). A robot
    needs ``logs`` and sections, see ``dynident.study``. The result is bit-identical to that of ``dynident identify``
    for the same study, for any number of threads. Problems of the model are issued as ``ProblemWarning`` and listed in
    ``Model.problems``. ``progress`` enables the progress display; by default it is enabled on a terminal and in a
    notebook. A callable receives ``(stage, rows done, total rows or None)``. A robot file with xacro macros needs
    ``allow_command=True``: the program ``xacro`` expands them, and runs Python code of the file.

    Logs with commands in place of torque need ``identify_servos``.

    >>> import dynident
    >>> given = dynident.example()
    >>> model = dynident.identify(given.robot, given.logs)
    >>> model.ok, model.validation_error_percent["test"] < 3.0
    (True, True)

    Raises ``StudyError``, ``RobotError`` or ``LogError`` with the file, the position and the fix. Ctrl-C interrupts the
    fit.
    """
    whole = _study_of(study, logs, sections, allow_command)
    if whole._fits_commands:
        raise StudyError("the logs have commands in place of torque: use identify_servos, which fits drives and bodies")
    return _warned(Model(_watched(progress, lambda hear: _native._identify(whole, threads, hear))))


def identify_servos(
    study: Study | Robot | str | PathLike[str],
    logs: Log | Iterable[Log] | None = None,
    *,
    allow_command: bool = False,
    threads: int | None = None,
    progress: bool | Progress | None = None,
    **sections: Any,
) -> ServoModel:
    """Fits drives and bodies to logs of commands and positions, for robots that report no torque, and simulates the
    held-out logs.

    The logs have ``command`` in place of ``tau``: ``Log.from_arrays(t, q, command=c)``. Settings are the keys of
    ``[drive.servo]``: ``drive={"servo": {"fit": {"alike": True}}}``. The result is bit-identical to that of ``dynident
    identify`` for the same study. For the other arguments, warnings and errors, see ``identify``.

    >>> import dynident
    >>> given = dynident.example()
    >>> dynident.identify_servos(given.robot, given.logs)
    Traceback (most recent call last):
    dynident.StudyError: identify_servos needs logs with commands and without torque: ...
    """
    whole = _study_of(study, logs, sections, allow_command)
    if not whole._fits_commands:
        raise StudyError(
            "identify_servos needs logs with commands and without torque: give Log.from_arrays(..., command=c), "
            "use identify for logs with torque, or state drive={'servo': {}} for logs with both"
        )
    texts = _watched(progress, lambda hear: _native._identify_servos(whole, threads, hear))
    return _warned(ServoModel(*texts))


def check(
    study: Study | Robot | str | PathLike[str],
    logs: Log | Iterable[Log] | None = None,
    *,
    allow_command: bool = False,
    threads: int | None = None,
    progress: bool | Progress | None = None,
    **sections: Any,
) -> Check:
    """Tests whether study, robot and logs are consistent: units, signs, joint order, mounting, clock and more. Run it
    before you trust a fit. Each finding names the key to change. For the arguments, see ``identify``.

    >>> import dynident
    >>> given = dynident.example()
    >>> print(dynident.check(given.robot, given.logs))
    no mistake found in study, robot and logs...
    """
    whole = _study_of(study, logs, sections, allow_command)
    return Check(json.loads(_watched(progress, lambda hear: _native._check(whole, threads, hear))))


def validate(
    model: Model,
    logs: Log | Iterable[Log] | Study | None = None,
    *,
    threads: int | None = None,
    progress: bool | Progress | None = None,
) -> dict[str, Any]:
    """Tests an identified model on logs (or the logs of a study) that were not used for the fit. By default these are
    the held-out logs of its study. Returns ``dynident validate --json`` as a dictionary, with the error of every joint.

    >>> import dynident
    >>> given = dynident.example()
    >>> model = dynident.identify(given.robot, given.logs)
    >>> tested = dynident.validate(model, given.logs[1])
    >>> [log["log"] for log in tested["validation"]]
    ['test']
    """
    if logs is None:
        whole = model.study
    else:
        whole = logs if isinstance(logs, Study) else with_logs(model.study, logs)
    text = _watched(progress, lambda hear: _native._validate(model._native, whole, threads, hear))
    found: dict[str, Any] = json.loads(text)
    return found


@dataclass(frozen=True, eq=False)
class Check:
    """Result of ``check``.

    >>> import dynident
    >>> given = dynident.example()
    >>> dynident.check(given.robot, given.logs)
    Check(ok, 0 findings)
    """

    result: dict[str, Any]
    """``dynident check --json`` as a dictionary."""

    @property
    def findings(self) -> list[dict[str, Any]]:
        """All findings, the most severe first: ``level``, ``kind``, ``what``, ``evidence``, ``write``."""
        found: list[dict[str, Any]] = self.result["check"]["findings"]
        return found

    @property
    def ok(self) -> bool:
        """Whether no finding is a problem."""
        return all(finding["level"] != "problem" for finding in self.findings)

    def __str__(self) -> str:
        def line(finding: dict[str, Any]) -> str:
            write = "; ".join(change["line"] for change in finding["write"])
            return f"{finding['level']}: {finding['what']}: {finding['evidence']}" + (f" Write: {write}" if write else "")

        return "\n".join(map(line, self.findings)) or self._nothing()

    def _nothing(self) -> str:
        unexplained = self.result["check"].get("unexplained_percent")
        shares = "" if unexplained is None else f" ({unexplained:.1f} % of all torque is unexplained)"
        return f"no mistake found in study, robot and logs{shares}"

    def _repr_html_(self) -> str:
        if not self.findings:
            return html.escape(self._nothing())
        rows = [
            [one["level"], one["what"], one["evidence"], "; ".join(change["line"] for change in one["write"])]
            for one in self.findings
        ]
        return table(["level", "finding", "evidence", "write"], rows)

    def __repr__(self) -> str:
        return f"Check({'ok' if self.ok else 'problems'}, {len(self.findings)} findings)"


@dataclass(frozen=True, eq=False)
class Design:
    """A designed motion, ready to record.

    >>> import dynident
    >>> arm = dynident.Robot.load("robots/planar2r.urdf")
    >>> limits = [{"joint": name, "position": [-1.5, 1.5], "speed": 2.0} for name in arm.joint_names]
    >>> dynident.design(arm, design={"duration_s": 5.0, "limits": {"joints": limits}})
    Design(2 joints, ... samples in 5.0 s, within all limits)
    """

    result: dict[str, Any]
    """``design.json`` as a dictionary."""
    csv: str
    """``trajectory.csv``."""
    svg: str
    """Plot of position, velocity, acceleration and torque of every joint over time."""
    time_s: npt.NDArray[np.float64]
    """Times, shape ``(samples,)``."""
    q: npt.NDArray[np.float64]
    """Positions, rad (m), shape ``(samples, n)``."""
    dq: npt.NDArray[np.float64]
    """Velocities, rad/s (m/s), shape ``(samples, n)``."""
    ddq: npt.NDArray[np.float64]
    """Accelerations, rad/s² (m/s²), shape ``(samples, n)``."""

    @property
    def feasible(self) -> bool:
        """Whether all limits are satisfied; unchecked limits are listed in ``result["not_checked"]``."""
        return bool(self.result["feasible"])

    def _repr_svg_(self) -> str:
        return self.svg

    def __repr__(self) -> str:
        samples, joints = self.q.shape
        seconds = self.time_s[-1] - self.time_s[0] if samples else 0.0
        verdict = "within all limits" if self.feasible else "violates limits"
        return f"Design({joints} joints, {samples} samples in {seconds:.1f} s, {verdict})"


def design(
    study: Study | Robot | str | PathLike[str],
    *,
    rate_hz: float | None = None,
    allow_command: bool = False,
    threads: int | None = None,
    progress: bool | Progress | None = None,
    **sections: Any,
) -> Design:
    """Computes an optimal excitation trajectory within all limits. ``study`` is a ``Study``, the path of one, or a
    robot with sections (``design={...}``). ``rate_hz`` is the sample rate of the arrays. ``progress`` as in
    ``identify``; a callable receives ``(round of the search, evaluations, None)``.

    >>> import dynident
    >>> arm = dynident.Robot.load("robots/planar2r.urdf")
    >>> limits = [{"joint": name, "position": [-1.5, 1.5], "speed": 2.0} for name in arm.joint_names]
    >>> motion = dynident.design(arm, rate_hz=100.0, design={"duration_s": 5.0, "limits": {"joints": limits}})
    >>> motion.feasible, motion.q.shape
    (True, (501, 2))
    """
    whole = _study_of(study, None, sections, allow_command)
    text, csv, svg, time_s, (q, dq, ddq) = _watched(
        progress, lambda hear: _native._design(whole, rate_hz, threads, hear)
    )
    return Design(json.loads(text), csv, svg, time_s, q, dq, ddq)


@dataclass(frozen=True, eq=False)
class Simulation:
    """One run of a simulated robot.

    >>> import dynident
    >>> run = dynident.simulate("examples/iterate_paper_2r.toml")
    >>> run.q.shape == run.tau.shape, run.log()
    (True, Log('simulated', ... samples, identify))
    """

    truth: dict[str, Any]
    """``truth.json`` as a dictionary: the true values."""
    csv: str
    """The log in the format of the command."""
    time_s: npt.NDArray[np.float64]
    """Times, shape ``(samples,)``."""
    q: npt.NDArray[np.float64]
    """Measured positions, rad (m), shape ``(samples, n)``."""
    tau: npt.NDArray[np.float64]
    """Measured torques, Nm (N), shape ``(samples, n)``."""

    def log(self, name: str = "simulated", role: Any = "identify") -> Log:
        """The samples as a log.

        >>> import dynident
        >>> dynident.simulate("examples/iterate_paper_2r.toml").log(role="validate").role
        'validate'
        """
        return Log.from_arrays(self.time_s, self.q, self.tau, name=name, role=role)

    def __repr__(self) -> str:
        samples, joints = self.q.shape
        return f"Simulation({joints} joints, {samples} samples, {'done' if self.truth['done'] else 'stopped early'})"


def simulate(
    study: Study | Robot | str | PathLike[str],
    *,
    allow_command: bool = False,
    threads: int | None = None,
    **sections: Any,
) -> Simulation:
    """Simulates the robot of a study (``[simulation]``) on its trajectory (``[iteration] trajectory``, or ``[design]``)
    with its ``[controller]``.

    >>> import dynident
    >>> dynident.simulate("examples/iterate_paper_2r.toml").truth["done"]
    True
    """
    whole = _study_of(study, None, sections, allow_command)
    truth, csv = _native._simulate(whole, threads)
    header, _, body = csv.partition("\n")
    names = header.split(",")
    table = np.fromstring(body.replace("\n", ","), sep=",").reshape(-1, len(names)) if body else np.empty((0, len(names)))
    of = {
        symbol: table[:, [k for k, name in enumerate(names) if name.rstrip("0123456789") == symbol]]
        for symbol in ("q", "tau")
    }
    return Simulation(json.loads(truth), csv, table[:, names.index("t_s")], of["q"], of["tau"])


def log_contents(file: str | PathLike[str]) -> dict[str, Any]:
    """Format of a recording, and its channels with rates and ranges.

    >>> import dynident
    >>> found = dynident.log_contents("examples/ur10_simulated/train.csv")
    >>> found["format"], found["channels"][0]["name"]
    ('text', 't_s')
    """
    found: dict[str, Any] = json.loads(_native._log_contents(fspath(file)))
    return found
