"""Tests identification from commands and positions."""

from __future__ import annotations

import ast
import json
import pickle
from pathlib import Path

import numpy as np
import pytest

import dynident

COUNT = 2 * np.pi / 4096
STIFFNESS, DAMPING, ARMATURE = 300.0, 25.0, 0.8
SERVO = {"servo": {"fit": {"alike": True, "step_s": 0.005}}}


def recorded(robot: dynident.Robot, phase: float, seconds: float = 12.0) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Times, positions in encoder counts, and commands at 50 Hz of an arm with two position servos."""
    t = np.arange(0.0, seconds, 0.02)
    joint = np.arange(robot.n)
    c = 0.5 * np.sin((1.3 + 0.4 * joint) * t[:, None] + phase) + 0.2 * np.sin(4.1 * t[:, None] + joint)
    h, parts = 0.002, 10
    q, dq = c[0].copy(), np.zeros(robot.n)
    rows = []
    for command in c:
        rows.append(q.copy())
        for _ in range(parts):
            # Implicit in the velocity of the drive, explicit in the bodies.
            inertia = robot.mass_matrix(q) + ARMATURE * np.eye(robot.n)
            bias = robot.inverse_dynamics(q, dq)
            matrix = inertia + (h * DAMPING + h * h * STIFFNESS) * np.eye(robot.n)
            dq = np.linalg.solve(matrix, inertia @ dq + h * (STIFFNESS * (command - q) - bias))
            q = q + h * dq
    return t, np.round(np.array(rows) / COUNT) * COUNT, c


@pytest.fixture(scope="module")
def logs(planar: dynident.Robot) -> list[dynident.Log]:
    made = []
    for phase, role in [(0.0, "identify"), (1.0, "validate")]:
        t, q, c = recorded(planar, phase)
        made.append(dynident.Log.from_arrays(t, q, command=c, name=f"phase {phase:.0f}", role=role))
    return made


@pytest.fixture(scope="module")
def model(planar: dynident.Robot, logs: list[dynident.Log]) -> dynident.ServoModel:
    return dynident.identify_servos(planar, logs, drive=SERVO)


def test_commands_to_drives(model: dynident.ServoModel, planar: dynident.Robot) -> None:
    assert model.ok, model.problems
    assert model.joint_names == planar.joint_names == list(model.drives)
    # Rounding to counts has an error of 0.29 counts.
    (errors,) = model.validation_error.values()
    assert max(errors.values()) < COUNT, errors
    (commands,) = model.command_error.values()
    assert min(commands[joint] / errors[joint] for joint in planar.joint_names) > 20.0
    assert list(model.validation_error) == ["phase 1"] and list(model.training_error) == ["phase 0"]
    for values in model.drives.values():
        stiffness, damping = values["stiffness"], values["damping"]
        # Positions determine ratios.
        assert damping.value / stiffness.value == pytest.approx(DAMPING / STIFFNESS, rel=0.03)
        assert stiffness.half_width_95_at_scale < stiffness.half_width_95 < stiffness.half_width_95_before
        assert stiffness.determined and stiffness.unit == "Nm/rad"
    assert "mass" in model.bodies[planar.body_names[0]]


def test_undetermined_values_are_named(model: dynident.ServoModel) -> None:
    assert not model.scale.determined and "[[payload]]" in model.scale.anchor
    open_values = [
        f"{name} of {owner}"
        for owners in (model.drives, model.bodies)
        for owner, values in owners.items()
        for name, value in values.items()
        if not value.determined
    ]
    assert open_values and sorted(open_values) == sorted(model.not_determined)


def test_results_are_saved_loaded_and_pickled(model: dynident.ServoModel, tmp_path: Path) -> None:
    model.save(tmp_path)
    assert sorted(path.name for path in tmp_path.iterdir()) == ["identified.urdf", "report.html", "result.json"]
    assert json.loads((tmp_path / "result.json").read_text()) == model.result
    for again in (dynident.ServoModel.load(tmp_path), pickle.loads(pickle.dumps(model))):
        assert again.drives == model.drives and again.to_urdf() == model.to_urdf() and again.report == model.report
    damping = model.result["drives"][0]["damping"]
    assert f'damping="{damping!r}"' in model.to_urdf()
    with pytest.raises(dynident.ResultError, match="not MJCF"):
        model.to_mjcf()
    assert "held out phase 1" in repr(model) and "stiffness" in model._repr_html_()


def test_drives_are_exported(model: dynident.ServoModel) -> None:
    assert model.export("urdf") == model.to_urdf()
    with pytest.raises(dynident.ResultError, match="not MJCF"):
        model.export("mjcf")
    with pytest.raises(dynident.ResultError, match="isaac-lab, mjcf, urdf"):
        model.export("c")
    module = ast.parse(model.export("isaac-lab"))
    functions = {one.name for one in module.body if isinstance(one, ast.FunctionDef)}
    assert {"implicit", "delayed"} <= functions
    numbers = {one.value for one in ast.walk(module) if isinstance(one, ast.Constant)}
    for drive in model.result["drives"]:
        assert any(isinstance(one, float) and one == pytest.approx(drive["stiffness"], rel=1e-4) for one in numbers)


def test_the_table_has_all_values(model: dynident.ServoModel) -> None:
    pytest.importorskip("pandas")
    table = model.to_pandas()
    joint = model.joint_names[0]
    assert table.loc[(joint, "stiffness"), "value"] == model.drives[joint]["stiffness"].value
    assert len(table) == sum(len(values) for values in (*model.drives.values(), *model.bodies.values()))


def test_the_result_does_not_depend_on_threads(planar: dynident.Robot, logs: list[dynident.Log]) -> None:
    drive = {"servo": {"fit": {"step_s": 0.01, "iterations": 2}}}
    study = dynident.study(planar, logs, drive=drive)
    with pytest.warns(dynident.ProblemWarning, match="did not settle"):
        found = [dynident.identify_servos(study, threads=threads) for threads in (1, 3)]
    assert found[0].drives == found[1].drives and found[0].bodies == found[1].bodies


def test_wrong_combinations_are_refused(
    planar: dynident.Robot, logs: list[dynident.Log], planar_logs: list[dynident.Log], tmp_path: Path
) -> None:
    with pytest.raises(dynident.StudyError, match="identify_servos"):
        dynident.identify(planar, logs)
    with pytest.raises(dynident.StudyError, match="command=c"):
        dynident.identify_servos(planar, planar_logs)
    with pytest.raises(dynident.StudyError, match="command=c"):
        dynident.identify_servos(planar, [])
    # Drives are stated, but one log has no commands.
    with pytest.raises(dynident.Error, match="command"):
        dynident.identify_servos(planar, [logs[0], planar_logs[1]], drive=SERVO)
    t, q, _ = recorded(planar, 0.0, 1.0)
    with pytest.raises(dynident.LogError, match="give tau, or command"):
        dynident.Log.from_arrays(t, q)
    with pytest.raises(dynident.Error, match="20|samples"):
        few = dynident.Log.from_arrays(t[:5], q[:5], command=q[:5])
        dynident.identify_servos(planar, few)
    (tmp_path / "result.json").write_text('{"schema": "dynident/result/1"}')
    with pytest.raises(dynident.ResultError, match="Model.load"):
        dynident.ServoModel.load(tmp_path)
    (tmp_path / "result.json").write_text("[]")
    with pytest.raises(dynident.ResultError, match="not a result"):
        dynident.ServoModel.load(tmp_path)
