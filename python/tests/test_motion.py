"""Tests design, simulation, and iteration with a Python function as robot."""

from __future__ import annotations

import json
import signal
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import dynident

DESIGN = {
    "family": {"kind": "fourier", "harmonics": 3},
    "duration_s": 6.0,
    "limits": {"joints": [{"joint": f"joint{k}", "position": [-1.5, 1.5], "speed": 2.0, "acceleration": 8.0} for k in (1, 2)]},
}


def test_design_and_simulate(planar: dynident.Robot) -> None:
    found = dynident.design(planar, design=DESIGN, rate_hz=200.0)
    assert found.feasible
    assert np.abs(found.dq).max() <= 2.0 + 1e-9
    # Sampled derivatives have second-order errors in the step of 5 ms.
    np.testing.assert_allclose(np.gradient(found.q, found.time_s, axis=0)[2:-2], found.dq[2:-2], atol=1e-2)
    assert found.svg.startswith("<svg")
    run = dynident.simulate(planar, design=DESIGN, simulation={"rate_hz": 500.0})
    assert run.truth["done"]
    assert run.q.shape == run.tau.shape == (run.truth["samples"], 2)
    again = dynident.identify(planar, run.log(), drive={"viscous": False, "coulomb": "none", "offset": False}, friction="stated")
    assert len(again.values) == len(planar.base_parameters)


class Arm:
    """The planar arm with other masses and friction and separate forward dynamics."""

    def __init__(self, robot: dynident.Robot) -> None:
        self.robot = robot
        self.runs = 0

    def __call__(self, run: dynident.Run) -> None:
        self.runs += 1
        period, inner = 1.0 / run.rate_hz, 4
        q, dq = run.q[0].copy(), run.dq[0].copy()
        for sample in range(run.samples):
            tau = run.torque(sample * period, q, dq)
            for _ in range(inner):
                ddq = self.robot.forward_dynamics(q, dq, tau - dq * [0.8, 0.4])
                dq = dq + ddq * period / inner
                q = q + dq * period / inner


ITERATION = {
    "model_free": {"kind": "joint-pd", "kp": [100.0, 40.0], "kd": [20.0, 8.0]},
    "rate_hz": 250.0,
    "max_runs": 4,
    "settled": {"tracking_tolerance": 5e-3},
    "rehearsal": {"uncertainty_percent": 20.0},
}
SECTIONS = {
    "design": DESIGN,
    "drive": {"viscous": True, "coulomb": "none", "offset": False},
    "controller": {"kind": "computed-torque", "kp": 100.0, "kd": 20.0},
    "iteration": ITERATION,
}


def test_a_function_is_a_robot(planar: dynident.Robot, root: Path, tmp_path: Path) -> None:
    text = (root / "robots" / "planar2r.urdf").read_text()
    truth = dynident.Robot.from_urdf(text)
    arm, heard = Arm(truth), []
    found = dynident.iterate(planar, tmp_path, robot=arm, heard=lambda run, error: heard.append((run, error)), **SECTIONS)
    assert arm.runs == len(found.runs) == len(heard)
    assert heard[-1][1] < 0.2 * heard[0][1], heard
    friction = found.model().friction
    assert friction["joint1"]["fv1"] == pytest.approx(0.8, rel=0.05)
    assert friction["joint2"]["fv2"] == pytest.approx(0.4, rel=0.05)
    # A second call continues; no run is repeated.
    dynident.iterate(planar, tmp_path, robot=arm, **SECTIONS)
    assert arm.runs == len(heard)


def test_what_a_robot_raises_is_raised(planar: dynident.Robot, tmp_path: Path) -> None:
    def broken(run: dynident.Run) -> None:
        run.torque(0.0, run.q[0], run.dq[0])
        raise ConnectionError("the cable is out")

    with pytest.raises(ConnectionError, match="the cable is out"):
        dynident.iterate(planar, tmp_path, robot=broken, **SECTIONS)
    assert json.loads((tmp_path / "iterations.json").read_text())["converged"] is False


def test_a_robot_that_leaves_its_envelope_is_stopped(planar: dynident.Robot, tmp_path: Path) -> None:
    asked = []

    def running_away(run: dynident.Run) -> None:
        for sample in range(run.samples):
            asked.append(sample)
            run.torque(sample / run.rate_hz, run.q[0] + 0.01 * sample, run.dq[0])

    found = dynident.iterate(planar, tmp_path, robot=running_away, **SECTIONS)
    assert not found.converged
    assert len(asked) < 100
    assert "envelope" in found.result["reason"]
    with pytest.raises(dynident.ResultError, match="no model was found"):
        found.model()


def test_a_program_needs_leave(root: Path, tmp_path: Path) -> None:
    study = dynident.Study.load(root / "examples" / "iterate_ur10_mujoco.toml")
    with pytest.raises(dynident.StudyError, match="allow_command=True"):
        dynident.iterate(study, tmp_path)


def test_mujoco_is_a_robot(planar: dynident.Robot, root: Path, tmp_path: Path) -> None:
    mujoco = pytest.importorskip("mujoco")
    from dynident.mujoco import MujocoRobot

    model = mujoco.MjModel.from_xml_path(str(root / "robots" / "planar2r.urdf"))
    model.opt.timestep = 1e-3
    model.dof_damping[:] = 0.8, 0.4
    # The robot description has Coulomb friction; `coulomb = "none"` removes it.
    model.dof_frictionloss[:] = 0.0
    found = dynident.iterate(planar, tmp_path, robot=MujocoRobot(model, noise=1e-6), **SECTIONS)
    friction = found.model().friction
    assert friction["joint1"]["fv1"] == pytest.approx(0.8, rel=0.05)
    assert found.runs[-1]["max_tracking_error_rad"]


INTERRUPTED = """
import json, sys, time
sys.path.insert(0, {tests!r})
import numpy as np
import dynident
from test_motion import SECTIONS

stopped = []

def robot(run):
    period, q = 1.0 / run.rate_hz, run.q[0]
    try:
        for sample in range(run.samples):
            run.torque(sample * period, run.q[sample], run.dq[sample])
            if sample == 20:
                print("moving", flush=True)
            time.sleep(0.01)
    except dynident.StopRun:
        stopped.append(True)
        raise

try:
    dynident.iterate(dynident.Robot.load({urdf!r}), {out!r}, robot=robot, **SECTIONS)
except KeyboardInterrupt:
    print(json.dumps({{"interrupted": True, "stopped": stopped}}), flush=True)
"""


@pytest.mark.skipif(sys.platform == "win32", reason="a signal that one process sends another")
def test_ctrl_c_stops_a_robot_that_is_a_function(root: Path, tmp_path: Path) -> None:
    names = {"tests": str(root / "python" / "tests"), "urdf": str(root / "robots" / "planar2r.urdf"), "out": str(tmp_path)}
    child = subprocess.Popen([sys.executable, "-c", INTERRUPTED.format(**names)], stdout=subprocess.PIPE, text=True)
    try:
        assert child.stdout is not None
        assert child.stdout.readline() == "moving\n"
        child.send_signal(signal.SIGINT)
        # 1500 samples of 10 ms remain in the run.
        said, _ = child.communicate(timeout=60)
        begin = json.loads(said.splitlines()[-1])
    finally:
        child.kill()
    assert begin == {"interrupted": True, "stopped": [True]}
    assert child.returncode == 0
    # The recorded samples are kept, with the reason of the stop.
    assert json.loads((tmp_path / "iterations.json").read_text())["status"] == "interrupted"


def test_failed_starts_do_not_use_up_runs(planar: dynident.Robot, tmp_path: Path) -> None:
    """The driver is not ready three times, with `max_runs = 4` and one failure in the middle of run 2."""
    arm = Arm(planar)
    calls: list[int] = []

    def robot(run: dynident.Run) -> None:
        calls.append(run.number)
        if len(calls) <= 3:
            raise ConnectionError("the driver is not ready")
        if len(calls) == 5:
            for sample in range(100):
                run.torque(sample / run.rate_hz, run.q[sample], run.dq[sample])
            raise TimeoutError("a packet is lost")
        arm(run)

    found = None
    for _ in range(8):
        try:
            found = dynident.iterate(planar, tmp_path, robot=robot, **SECTIONS)
            break
        except (ConnectionError, TimeoutError):
            state = json.loads((tmp_path / "iterations.json").read_text())
            assert state["status"] == "refused"
            assert len(state["runs"]) == (0 if len(calls) <= 3 else 1)
    assert found is not None
    assert calls[:6] == [1, 1, 1, 1, 2, 2]
    # The model of run 1 is used in run 2, although its first attempt failed.
    assert found.runs[1]["controller"] == found.runs[-1]["controller"] != found.runs[0]["controller"]
    assert found.ok, found.problems


def test_wrong_time_stamps_and_shapes_do_not_use_up_runs(planar: dynident.Robot, tmp_path: Path) -> None:
    for step_s, words in [(0.0, "time 0 s comes after 0 s"), (1000 / 250.0, "give the time in seconds")] * 2:

        def clock(run: dynident.Run, step_s: float = step_s) -> None:
            run.torque(7.0, run.q[0], run.dq[0])
            run.torque(7.0 + step_s, run.q[0], run.dq[0])

        with pytest.warns(dynident.ProblemWarning, match=words):
            found = dynident.iterate(planar, tmp_path, robot=clock, **SECTIONS)
        assert found.status == "refused" and found.runs == [] and not found.ok

    def one_joint(run: dynident.Run) -> None:
        run.torque(0.0, [0.0], [0.0])

    with pytest.raises(ValueError, match="last axis needs 2 entries"):
        dynident.iterate(planar, tmp_path, robot=one_joint, **SECTIONS)
    assert dynident.iterate(planar, tmp_path, robot=Arm(planar), **SECTIONS).ok


def test_torques_are_given_for_lists_and_single_precision(planar: dynident.Robot, tmp_path: Path) -> None:
    class Lists(Arm):
        def __call__(self, run: dynident.Run) -> None:
            run_torque = run.torque
            tau = run_torque(0.0, run.q[0].tolist(), run.dq[0].astype(np.float32))
            assert tau.shape == (2,)
            raise dynident.StopRun("enough")

    with pytest.warns(dynident.ProblemWarning, match="enough"):
        found = dynident.iterate(planar, tmp_path, robot=Lists(planar), **{**SECTIONS, "iteration": {**ITERATION, "max_runs": 1}})
    # The robot has moved and stopped, so this run counts.
    assert len(found.runs) == 1 and "enough" in found.runs[0]["outcome"]


def test_a_stopped_iteration_is_a_problem_of_its_model(planar: dynident.Robot, tmp_path: Path) -> None:
    arm = Arm(planar)

    def robot(run: dynident.Run) -> None:
        if run.number == 1:
            return arm(run)
        # A model-based controller that leaves the envelope.
        for sample in range(run.samples):
            run.torque(sample / run.rate_hz, run.q[0] + 0.01 * sample, run.dq[0])

    with pytest.warns(dynident.ProblemWarning, match="has not converged"):
        found = dynident.iterate(planar, tmp_path, robot=robot, **{**SECTIONS, "iteration": {**ITERATION, "max_runs": 2}})
    model = found.model()
    assert not found.ok and not model.ok
    assert "has not converged" in model.problems[-1]
    assert "has not converged" in found._repr_html_() and "PROBLEM" in model.summary()
    assert len(repr(found)) < 300


def test_progress_of_design_and_iteration(planar: dynident.Robot, tmp_path: Path) -> None:
    heard: list[tuple[str, int, int | None]] = []
    design = dynident.design(planar, design=DESIGN, progress=lambda *now: heard.append(now))
    assert any(stage.startswith("design") for stage, _, _ in heard)
    assert len(repr(design)) < 200
    heard.clear()
    # The function of the robot gives time to the display.
    arm = Arm(planar)
    dynident.iterate(planar, tmp_path, robot=arm, progress=lambda *now: heard.append(now), **SECTIONS)
    assert heard
