"""An identified model."""

from __future__ import annotations

import hashlib
import html
import json
from collections.abc import Iterable
from dataclasses import dataclass
from functools import cached_property
from os import PathLike, fspath
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
import numpy.typing as npt

from . import _picture
from ._native import FittedModel, ResultError, Robot, Study, StudyError, Watch, _residuals, _write_files
from ._page import Page

if TYPE_CHECKING:
    from collections.abc import Sequence

    import pandas as pd
    from matplotlib.figure import Figure

    from ._log import Log

Array = npt.NDArray[np.float64]

DESCRIPTIONS = ("identified.urdf", "identified.toml", "identified.xml", "identified.sdf")
"""Files of the robot description with the identified values: URDF, D-H table, MJCF, SDF."""


STUDY = "study.json"
"""The study of a saved model, with the robot description; without the samples of logs in memory."""

INERTIAL = ("m", "mx", "my", "mz", "Ixx", "Ixy", "Ixz", "Iyy", "Iyz", "Izz")


@dataclass(frozen=True, eq=False)
class Residuals:
    """Measured and predicted torque of a log over time, filtered as in the fit; see ``Model.residuals``.

    >>> import numpy as np
    >>> from dynident import Residuals
    >>> Residuals(np.arange(3) / 10, np.ones((3, 2)), np.full((3, 2), 0.5), True)
    Residuals(3 rows of 2 joints, rms 0.5 Nm)
    """

    time_s: Array
    """Times, s after the first row of the log, shape ``(rows,)``. Rows at the ends are left out by the filter."""
    measured: Array
    """Measured torque, Nm (N), shape ``(rows, n)``; NaN where the log has a gap."""
    predicted: Array
    """Predicted torque, of the same shape."""
    complete: bool
    """Whether all rows of the log are included; the rows of very long logs are not."""

    @property
    def residual(self) -> Array:
        """``measured - predicted``."""
        return self.measured - self.predicted

    def __repr__(self) -> str:
        rows, joints = self.measured.shape
        return f"Residuals({rows} rows of {joints} joints, rms {np.sqrt(np.nanmean(self.residual**2)):.3g} Nm)"


class Model:
    """An identified dynamic model with error bars and validation, the result of ``identify``.

    ``result`` has the complete contents of ``result.json``. Pickled models do not contain the samples of the fit.

    >>> import dynident
    >>> given = dynident.example()
    >>> model = dynident.identify(given.robot, given.logs)
    >>> model
    Model('ur10', ... base parameters, held out test: ... %)
    >>> print(model.summary().splitlines()[0])
    ur10: no problem found
    """

    def __init__(self, native: FittedModel) -> None:
        self._native = native
        self._further_problems: list[str] = []

    def _with_problems(self, problems: Iterable[str]) -> Model:
        """The model with problems that its result does not contain."""
        self._further_problems = list(problems)
        return self

    @classmethod
    def load(
        cls,
        folder: str | PathLike[str],
        study: Study | str | PathLike[str] | None = None,
        *,
        allow_command: bool = False,
    ) -> Model:
        """Loads a model from a folder written by ``save`` or ``dynident identify``. ``study`` is not needed for a folder
        of ``save``, or if the unchanged study file is next to the folder, in it, or in the working folder.

        >>> import dynident, tempfile
        >>> given, folder = dynident.example(), tempfile.mkdtemp()
        >>> model = dynident.identify(given.robot, given.logs)
        >>> model.save(folder)
        >>> dynident.Model.load(folder).result == model.result
        True
        """
        place = Path(folder)

        def text(name: str) -> str | None:
            return (place / name).read_text(encoding="utf-8") if (place / name).is_file() else None

        if isinstance(study, Study):
            own = study
        elif study is not None:
            own = Study.load(study, allow_command=allow_command)
        else:
            own = _study_of(place, allow_command)
        json_text = (place / "result.json").read_text(encoding="utf-8")
        return cls(FittedModel.of(json_text, own, [text(name) for name in DESCRIPTIONS], text("report.html") or ""))

    @cached_property
    def result(self) -> dict[str, Any]:
        """``result.json`` as a dictionary; ``dynident schema result`` describes its keys."""
        found: dict[str, Any] = json.loads(self._native.json)
        return found

    @property
    def study(self) -> Study:
        """The study that was used for the fit."""
        return self._native.study

    @property
    def joint_names(self) -> list[str]:
        """Names of the joints, in the order of all vectors."""
        return self._native.joint_names

    @property
    def problems(self) -> list[str]:
        """Problems of the model, and of the iteration that found it; empty if no problem was found."""
        found: list[str] = self.result["problems"]
        return found + self._further_problems

    @property
    def ok(self) -> bool:
        """Whether no problem was found."""
        return not self.problems

    @property
    def names(self) -> list[str]:
        """The base parameters, as sums: ``Izz1 + 0.49 m2``."""
        return [one["expression"] for one in self.result["base_parameters"]]

    def _numbers(self, key: str) -> npt.NDArray[np.float64]:
        values = [one[key] for one in self.result["base_parameters"]]
        return np.array([np.nan if value is None else value for value in values], dtype=np.float64)

    @property
    def values(self) -> npt.NDArray[np.float64]:
        """The estimates of the base parameters, in the order of ``names``."""
        return self._numbers("value")

    @property
    def std(self) -> npt.NDArray[np.float64]:
        """Their standard deviations."""
        return self._numbers("std")

    @property
    def half_width_95(self) -> npt.NDArray[np.float64]:
        """Half widths of their 95 % intervals."""
        return self._numbers("half_width_95")

    @property
    def covariance(self) -> npt.NDArray[np.float64]:
        """Their covariance, shape ``(base parameters, base parameters)``."""
        return np.array(self.result["base_parameter_covariance"], dtype=np.float64)

    @property
    def bodies(self) -> dict[str, npt.NDArray[np.float64]]:
        """Physically consistent inertial parameters of each body in its frame: ``m, mx, my, mz, Ixx, Ixy, Ixz, Iyy,
        Iyz, Izz`` about the frame's origin, kg, kg m, kg m².
        """
        return {body["name"]: np.array(body["parameters"], dtype=np.float64) for body in self.result["bodies"]}

    @property
    def friction(self) -> dict[str, dict[str, float]]:
        """Friction, drive inertia and offset of each joint, by symbol."""
        return {
            joint["name"]: {term["symbol"]: term["value"] for term in joint["laws"]} for joint in self.result["joints"]
        }

    @property
    def validation_error_percent(self) -> dict[str, float | None]:
        """Relative torque error ``100 ‖τ - τ̂‖ / ‖τ‖`` of the exported model on each held-out log, in %."""

        def error(log: dict[str, Any]) -> float | None:
            found: float | None = (log["physical"] or log)["relative_error_percent"]
            return found

        return {log["log"]: error(log) for log in self.result["validation"]}

    @property
    def report(self) -> Page:
        """The report page; a notebook shows it."""
        return Page(self._native.report)

    def summary(self) -> str:
        """The result as text: verdict, held-out errors, bodies, friction and the least accurate parameters.

        >>> import dynident
        >>> given = dynident.example()
        >>> print(dynident.identify(given.robot, given.logs).summary())
        ur10: no problem found
        held out: test ... %
        ...
        """
        lines = [f"{self.result['name']}: {'no problem found' if self.ok else f'{len(self.problems)} problem(s)'}"]
        lines += [f"PROBLEM: {text}" for text in self.problems]
        for log, error in self.validation_error_percent.items():
            lines.append(f"held out: {log} {'-' if error is None else f'{error:.2f}'} %")
        lines += ["", f"{'body':24} {'mass, kg':>10} {'centre of mass, m':>27}"]
        for name, body in self.bodies.items():
            centre = body[1:4] / body[0] if body[0] > 0.0 else np.full(3, np.nan)
            lines.append(f"{name:24} {body[0]:10.4g} {' '.join(f'{x:8.4f}' for x in centre):>27}")
        lines += ["", f"{'joint':24} friction, drive inertia, offset"]
        for name, terms in self.friction.items():
            lines.append(f"{name:24} {', '.join(f'{symbol} = {value:.4g}' for symbol, value in terms.items()) or '-'}")
        known = [one for one in self.result["base_parameters"] if one["excited"] and one["value"]]
        worst = sorted(known, key=lambda one: -abs(one["half_width_95"] / one["value"]))[:5]
        lines += ["", "least accurate base parameters (95 %)"]
        lines += [f"{one['expression']}: {one['value']:.4g} ± {one['half_width_95']:.2g} {one['unit']}" for one in worst]
        return "\n".join(lines)

    def predict(self, q: npt.ArrayLike, dq: npt.ArrayLike | None = None, ddq: npt.ArrayLike | None = None) -> Array:
        """Computes the torques of a motion including friction and drive inertia, Nm (N): the inverse dynamics of the
        identified robot. Shapes ``(..., n)``, samples in chronological order.

        >>> import dynident, numpy as np
        >>> given = dynident.example()
        >>> model = dynident.identify(given.robot, given.logs)
        >>> model.predict(np.zeros(6)).shape
        (6,)
        """
        return self._native.torque(q, dq, ddq)

    def mass_matrix(self, q: npt.ArrayLike) -> Array:
        """Mass matrices with drive inertia, kg m² (kg m, kg), shape ``(..., n, n)``: the derivative of ``predict`` with
        respect to the acceleration.

        >>> import dynident, numpy as np
        >>> given = dynident.example()
        >>> M = dynident.identify(given.robot, given.logs).mass_matrix(np.zeros(6))
        >>> bool(np.allclose(M, M.T)), bool((np.linalg.eigvalsh(M) > 0.0).all())
        (True, True)
        """
        q = np.asarray(q, dtype=np.float64)
        bias = self.predict(q)
        units = np.eye(q.shape[-1])
        return np.stack([self.predict(q, None, np.broadcast_to(one, q.shape)) - bias for one in units], axis=-1)

    def forward_dynamics(self, q: npt.ArrayLike, dq: npt.ArrayLike, tau: npt.ArrayLike) -> Array:
        """Accelerations for given drive torques, with friction and drive inertia, rad/s² (m/s²), shape ``(..., n)``: the
        inverse of ``predict``.

        >>> import dynident, numpy as np
        >>> given = dynident.example()
        >>> model = dynident.identify(given.robot, given.logs)
        >>> tau = model.predict(np.zeros(6), np.ones(6), np.full(6, 2.0))
        >>> bool(np.allclose(model.forward_dynamics(np.zeros(6), np.ones(6), tau), 2.0))
        True
        """
        rest = np.asarray(tau, dtype=np.float64) - self.predict(q, dq)
        found: Array = np.linalg.solve(self.mass_matrix(q), rest[..., None])[..., 0].astype(np.float64)
        return found

    def residuals(
        self, logs: Log | Iterable[Log] | Study | None = None, *, threads: int | None = None
    ) -> dict[str, Residuals]:
        """Measured and predicted torque over time of logs (or of the logs of a study), by log, filtered as in the fit.
        By default these are the held-out logs of the study. The held-out error has its own band, so it may differ from
        the error of these values.

        >>> import dynident
        >>> given = dynident.example()
        >>> found = dynident.identify(given.robot, given.logs).residuals()["test"]
        >>> found.measured.shape == found.residual.shape
        True
        """
        from ._study import with_logs

        whole = self.study if logs is None else logs if isinstance(logs, Study) else with_logs(self.study, logs)
        return {
            name: Residuals(time_s, measured, predicted, not cut)
            for name, time_s, cut, measured, predicted in _residuals(self._native, whole, threads)
        }

    def predict_with_band(
        self, q: npt.ArrayLike, dq: npt.ArrayLike | None = None, ddq: npt.ArrayLike | None = None
    ) -> tuple[npt.NDArray[np.float64], npt.NDArray[np.float64]]:
        """Computes the torques as in ``predict`` and the half width of the 95 % band of the filtered torque,
        ``t sqrt(w V wᵀ + σ²)``. The filter is that of the fit.
        """
        return self._native.predict(q, dq, ddq)

    def online(
        self,
        *,
        rate_hz: float,
        forgetting_s: float | None = 15.0,
        correlation_s: float | None = None,
        collision_s: float | None = None,
        payload_s: float | None = None,
        contact_alarms_per_hour: float | None = None,
        drift_alarms_per_hour: float | None = None,
        half_window: int | None = None,
    ) -> Watch:
        """Creates a monitor that detects contact, payload and drift, sample by sample; see ``Watch``.

        ``forgetting_s`` is the half-life of the sample weights. None keeps all samples and disables drift detection.
        ``correlation_s`` (1) is the correlation time of the residuals. ``collision_s`` (0.02) and ``payload_s`` (2) are
        the time constants of collision and payload detection. ``contact_alarms_per_hour`` (0.05) and
        ``drift_alarms_per_hour`` (0.1) are the accepted false alarm rates. Missing derivatives are computed from
        ``half_window`` (10) samples on each side.
        """
        return self._native.online(
            rate_hz,
            forgetting_s,
            correlation_s,
            collision_s,
            payload_s,
            contact_alarms_per_hour,
            drift_alarms_per_hour,
            half_window,
        )

    def robot(self) -> Robot:
        """A robot with the identified bodies. Raises ``ResultError`` if no robot description can contain them."""
        return Robot.from_urdf(self.to_urdf())

    def export(self, form: str) -> str:
        """Exports the model as ``c``, ``cpp``, ``rust``, ``python``, ``matlab``, ``casadi``, ``jax``, ``pinocchio``,
        ``mjcf``, ``urdf``, ``sdf``, ``ros2-yaml`` or ``json``. A comment lists the parts that the format cannot
        represent.
        """
        return self._native.export(form)[0]

    def to_urdf(self) -> str:
        """The user's URDF with the identified values; for other formats a generated URDF of the same robot."""
        return self._native.descriptions[0] or self.export("urdf")

    def to_mjcf(self) -> str:
        """The user's MJCF with the identified values, or a generated MJCF of the same robot."""
        return self._native.descriptions[2] or self.export("mjcf")

    def to_sdf(self) -> str:
        """The user's SDF with the identified values, or a generated SDF of the same robot."""
        return self._native.descriptions[3] or self.export("sdf")

    def to_c(self) -> str:
        """A C99 header: inverse dynamics, gravity, mass matrix, friction, forward dynamics."""
        return self.export("c")

    def to_simulator(self) -> dict[str, Any]:
        """Armature, damping, frictionloss, delay and actuator gain of every joint with error bars, as defined by MuJoCo
        and similar simulators: ``dynident export --to simulator`` as a dictionary.
        """
        found: dict[str, Any] = json.loads(self._native.simulator()[0])
        return found

    def to_simulator_table(self) -> str:
        """The values of ``to_simulator`` as a Markdown table."""
        return self._native.simulator()[1]

    def to_payload(self, controller: str, name: str | None = None) -> str:
        """An estimated payload in the format of a controller: ``"ur"`` (a line of URScript), ``"franka"`` (JSON),
        ``"kuka"`` (LOAD_DATA) or ``"abb"`` (loaddata). ``name`` selects one of several payloads.
        """
        return self._native.payload(controller, name)[0]

    @property
    def functions(self) -> list[str]:
        """Parts of the study that were Python functions, each with the name of the function."""
        found: list[str] = self.result["method"].get("functions", [])
        return found

    def to_pandas(self, what: Literal["parameters", "bodies", "friction"] = "parameters") -> pd.DataFrame:
        """A table of the base parameters, the bodies (ten inertial parameters, SI), or the friction of the joints.

        >>> import dynident
        >>> given = dynident.example()
        >>> model = dynident.identify(given.robot, given.logs)
        >>> model.to_pandas("bodies").columns[:3].to_list(), len(model.to_pandas("friction"))
        (['m', 'mx', 'my'], 6)
        """
        import pandas as pd

        if what == "bodies":
            table = pd.DataFrame.from_dict(self.bodies, orient="index", columns=list(INERTIAL))
            return table.rename_axis("body")
        if what == "friction":
            # The symbols have the number of the joint at their end.
            short = {name: {symbol.rstrip("0123456789"): x for symbol, x in own.items()} for name, own in self.friction.items()}
            return pd.DataFrame.from_dict(short, orient="index").rename_axis("joint")
        if what == "parameters":
            return pd.DataFrame.from_records(self.result["base_parameters"]).set_index("expression")
        raise ValueError(f"what = {what!r}: give 'parameters', 'bodies' or 'friction'")

    def save(self, folder: str | PathLike[str]) -> None:
        """Writes ``result.json``, ``report.html`` and the updated robot description, as ``dynident identify`` does, and
        the study (without the samples of logs in memory), so that ``load`` needs only the folder.
        """
        study = self.study
        _, (sections, path, description, _, functions) = study.__reduce__()
        own = {"sections": json.loads(sections), "path": fspath(path), "robot": description and [description[0], fspath(description[1])]}
        texts = {
            # Python functions cannot be written.
            STUDY: None if functions else json.dumps(own, indent=2) + "\n",
            **dict(zip(DESCRIPTIONS, self._native.descriptions, strict=True)),
            "report.html": self._native.report,
            "result.json": json.dumps(self.result, indent=2) + "\n",
        }
        _write_files(fspath(folder), texts)

    def plot(
        self,
        figure: str,
        out: str | PathLike[str] | Sequence[str | PathLike[str]] | None = None,
        *,
        width_mm: float = 88.0,
        font_pt: float = 8.0,
        dpi: float = 300.0,
        threads: int | None = None,
    ) -> _picture.Picture:
        """Draws ``"residuals"``, ``"parameters"`` or ``"friction"`` for a paper, as ``dynident plot`` does.

        ``out`` is a file or several: ``.svg``, ``.pdf`` or ``.png`` for the picture, ``.csv`` for its data, ``.tex`` or
        ``.md`` for the table. ``dpi`` is the resolution of a PNG. PDF and PNG need a build with these forms, which the wheel is not. The residuals are those of the held-out logs, or of
        all logs if none is held out. Needs no other package.
        """
        return _picture.Picture(self._native.plot(figure, _picture.files(out), width_mm, font_pt, dpi, threads))

    def plot_parameters(self) -> Figure:
        """Plots the base parameters with 95 % intervals and their nominal values."""
        from ._plots import parameters

        return parameters(self)

    def plot_prediction(self, time_s: npt.ArrayLike, q: npt.ArrayLike, dq: npt.ArrayLike, ddq: npt.ArrayLike, tau: npt.ArrayLike | None = None) -> Figure:
        """Plots the torque of every joint over time with its 95 % band, and the measured torque if given."""
        from ._plots import prediction

        return prediction(self, time_s, q, dq, ddq, tau)

    def _repr_html_(self) -> str:
        result = self.result

        def row(cells: list[str], tag: str = "td") -> str:
            return "<tr>" + "".join(f"<{tag}>{html.escape(cell)}</{tag}>" for cell in cells) + "</tr>"

        verdict = "no problem found" if self.ok else f"{len(self.problems)} problem(s)"
        parts = [f"<b>{html.escape(result['name'])}</b>: {len(self.names)} base parameters, {verdict}"]
        parts += [f"<div style='color:#b00'>PROBLEM: {html.escape(problem)}</div>" for problem in self.problems]
        errors = self.validation_error_percent
        if errors:
            lines = [[log, "-" if error is None else f"{error:.2f} %"] for log, error in errors.items()]
            parts.append("<table>" + row(["held-out log", "error"], "th") + "".join(map(row, lines)) + "</table>")
        numbers = zip(self.names, self.values, self.half_width_95, self.result["base_parameters"], strict=True)
        lines = [
            [name, f"{value:.4g}", f"± {bar:.2g}" if one["excited"] else "nominal: not excited", one["unit"]]
            for name, value, bar, one in numbers
        ]
        parts.append(
            "<details><summary>base parameters (95 %)</summary><table>" + "".join(map(row, lines)) + "</table></details>"
        )
        return "".join(parts)

    def __getstate__(self) -> tuple[FittedModel, list[str]]:
        return self._native, self._further_problems

    def __setstate__(self, state: tuple[FittedModel, list[str]]) -> None:
        self._native, self._further_problems = state

    def __repr__(self) -> str:
        errors = ", ".join(
            f"{log}: {'-' if error is None else f'{error:.2f} %'}" for log, error in self.validation_error_percent.items()
        )
        verdict = "" if self.ok else f", {len(self.problems)} problem(s)"
        return f"Model({self.result['name']!r}, {len(self.names)} base parameters, held out {errors or 'nothing'}{verdict})"


def _study_of(folder: Path, allow_command: bool) -> Study:
    """The study of a result, from its folder or from the study file with the hash in the result."""
    if (folder / STUDY).is_file():
        try:
            own = json.loads((folder / STUDY).read_text(encoding="utf-8"))
            sections, robot = own["sections"], own["robot"]
            samples = [None] * len(sections.get("log", []))
            return Study._restore(json.dumps(sections), own["path"], None if robot is None else tuple(robot), samples)
        except (ValueError, KeyError, TypeError) as error:
            raise StudyError(f"{folder / STUDY}: not a study of Model.save ({error}): give the study") from None
    try:
        stated = json.loads((folder / "result.json").read_text(encoding="utf-8"))["provenance"]["study"]
    except (ValueError, KeyError, TypeError) as error:
        raise ResultError(f"{folder / 'result.json'}: not a result of identify ({error})") from None
    if stated is not None:
        name = Path(stated["file"]).name
        for place in (folder / name, folder.absolute().parent / name, Path(name)):
            if place.is_file() and hashlib.sha256(place.read_bytes()).hexdigest() == stated["sha256"]:
                return Study.load(place, allow_command=allow_command)
    wanted = "" if stated is None else f" ({stated['file']})"
    raise StudyError(
        f"{folder}: the study{wanted} of the result is not in this folder, next to it or in the working folder, or was "
        "changed: give it, Model.load(folder, study)"
    )
