"""Tests dynamics over arrays: shapes and physical identities."""

from __future__ import annotations

import concurrent.futures
import multiprocessing
import pickle
from pathlib import Path

import numpy as np
import pytest
from conftest import motion

import dynident


def test_a_robot_file_with_macros_needs_permission(root: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    plain = (root / "robots" / "planar2r.urdf").read_text()
    declared = '<robot xmlns:xacro="http://www.ros.org/wiki/xacro" '
    arm = tmp_path / "arm.urdf"
    arm.write_text(plain.replace("<robot ", declared, 1).replace("</robot>", '<xacro:property name="m" value="${1}"/></robot>'))
    program = tmp_path / "xacro"
    program.write_text(f"#!/bin/sh\necho \"$@\" >>'{tmp_path}/ran'\ncat '{root}/robots/planar2r.urdf'\n")
    program.chmod(0o755)
    monkeypatch.setenv("PATH", str(tmp_path), prepend=":")
    study = tmp_path / "study.toml"
    study.write_text('[robot]\nfile = "arm.urdf"\n')
    for refused in [
        lambda: dynident.Robot.load(arm),
        lambda: dynident.Robot.from_urdf(arm),
        lambda: dynident.inspect(arm),
        lambda: dynident.study(arm),
        lambda: dynident.design(study),
        lambda: dynident.new(arm, tmp_path / "log.csv"),
    ]:
        with pytest.raises(dynident.RobotError, match="allow_command=True"):
            refused()
    assert not (tmp_path / "ran").exists()
    robot = dynident.Robot.load(arm, allow_command=True, xacro={"ur_type": "ur5e"})
    assert robot.joint_names == dynident.Robot.load(root / "robots" / "planar2r.urdf").joint_names
    assert (tmp_path / "ran").read_text() == f"{arm} ur_type:=ur5e\n"
    assert 'ur_type = "ur5e"' in dynident.study(robot).to_toml()
    assert pickle.loads(pickle.dumps(robot)).joint_names == robot.joint_names
    dynident.Study.load(study, allow_command=True)
    assert len((tmp_path / "ran").read_text().splitlines()) == 2


def test_shapes_follow_the_samples(ur10: dynident.Robot) -> None:
    q = np.random.default_rng(0).normal(size=(3, 4, 6))
    n, bodies = ur10.n, len(ur10.body_names)
    assert ur10.inverse_dynamics(q[0, 0]).shape == (n,)
    assert ur10.inverse_dynamics(q, q, q).shape == (3, 4, n)
    assert ur10.mass_matrix(q).shape == (3, 4, n, n)
    assert ur10.regressor(q, q, q).shape == (3, 4, n, 10 * bodies)
    assert [part.shape for part in ur10.derivatives(q)] == [(3, 4, n, n)] * 3
    assert ur10.gravity(np.zeros((0, n))).shape == (0, n)
    assert ur10.gravity([0.0] * n).shape == (n,)


def test_the_equation_of_motion_holds(ur10: dynident.Robot) -> None:
    _, q, dq, ddq = motion(6, seconds=2.0)
    tau = ur10.inverse_dynamics(q, dq, ddq)
    bias = ur10.inverse_dynamics(q, dq)
    rebuilt = np.einsum("sij,sj->si", ur10.mass_matrix(q), ddq) + bias
    # Rounding error of torques of 100 Nm.
    np.testing.assert_allclose(rebuilt, tau, atol=1e-11)
    np.testing.assert_allclose(ur10.forward_dynamics(q, dq, tau), ddq, atol=1e-8)
    np.testing.assert_allclose(ur10.regressor(q, dq, ddq) @ ur10.inertial_parameters.ravel(), tau, atol=1e-11)
    base = ur10.base_projection @ ur10.inertial_parameters.ravel()
    regressor = ur10.regressor(q, dq, ddq)[..., ur10.base_columns]
    # Columns that are linearly dependent by structure, to 1e-9 of the largest column.
    np.testing.assert_allclose(regressor @ base, tau, atol=1e-6)
    step = 1e-6
    by_q, by_dq, by_ddq = ur10.derivatives(q[7], dq[7], ddq[7])
    for joint in range(6):
        one = step * np.eye(6)[joint]
        for found, (a, b) in [
            (by_q, ((q[7] + one, dq[7], ddq[7]), (q[7] - one, dq[7], ddq[7]))),
            (by_dq, ((q[7], dq[7] + one, ddq[7]), (q[7], dq[7] - one, ddq[7]))),
            (by_ddq, ((q[7], dq[7], ddq[7] + one), (q[7], dq[7], ddq[7] - one))),
        ]:
            # Difference quotient of torques of 100 Nm with a step of 2e-6: rounding error 1e-8.
            difference = (ur10.inverse_dynamics(*a) - ur10.inverse_dynamics(*b)) / (2 * step)
            np.testing.assert_allclose(found[:, joint], difference, atol=1e-6)


def test_batches_equal_single_calls_whatever_the_layout(ur10: dynident.Robot) -> None:
    _, q, dq, ddq = motion(6, seconds=20.0, rate_hz=100.0)
    whole = ur10.inverse_dynamics(q, dq, ddq)
    fortran = ur10.inverse_dynamics(np.asfortranarray(q), dq[:, ::1], ddq.astype(">f8"))
    np.testing.assert_array_equal(whole, fortran)
    # The SIMD lanes add in another order than single calls.
    single = np.array([ur10.inverse_dynamics(*row) for row in zip(q[:50], dq[:50], ddq[:50], strict=True)])
    np.testing.assert_allclose(whole[:50], single, atol=1e-12)
    np.testing.assert_array_equal(ur10.inverse_dynamics(q.tolist(), dq.tolist(), ddq.tolist()), whole)


def test_pinocchio_says_the_same(ur10: dynident.Robot, root: Path) -> None:
    pinocchio = pytest.importorskip("pinocchio")
    model = pinocchio.buildModelFromUrdf(str(root / "robots" / "ur10.urdf"))
    data = model.createData()
    _, q, dq, ddq = motion(6, seconds=0.5)
    theirs = np.array([pinocchio.rnea(model, data, *row) for row in zip(q, dq, ddq, strict=True)])
    np.testing.assert_allclose(ur10.inverse_dynamics(q, dq, ddq), theirs, rtol=1e-12, atol=1e-12)


def test_descriptions_as_text_and_keys_of_a_study(root: Path, ur10: dynident.Robot) -> None:
    text = (root / "robots" / "ur10.urdf").read_text()
    assert dynident.Robot.from_urdf(text).joint_names == ur10.joint_names
    held = dynident.Robot.from_urdf(root / "robots" / "ur10.urdf", lock={"elbow_joint": 0.5})
    assert held.n == 5
    assert held.joint_names == ur10.locked({"elbow_joint": 0.5}).joint_names
    q = np.array([0.1, 0.2, 0.3, 0.4, 0.5])
    np.testing.assert_allclose(held.gravity(q), np.delete(ur10.gravity(np.insert(q, 2, 0.5)), 2), atol=1e-12)
    hanging = dynident.Robot.from_urdf(text, gravity_m_s2=[0.0, 0.0, 9.81])
    np.testing.assert_allclose(hanging.gravity(np.ones(6)), -ur10.gravity(np.ones(6)), atol=1e-12)
    with pytest.raises(dynident.RobotError, match="not Mjcf"):
        dynident.Robot.from_mjcf(text)


def test_what_is_wrong_is_said(ur10: dynident.Robot, root: Path) -> None:
    with pytest.raises(dynident.RobotError, match=r"nowhere\.urdf: cannot be read"):
        dynident.Robot.load("nowhere.urdf")
    with pytest.raises(ValueError, match="last axis needs 6 entries"):
        ur10.gravity(np.zeros(5))
    with pytest.raises(ValueError, match="dq has samples in"):
        ur10.inverse_dynamics(np.zeros((2, 6)), np.zeros((3, 6)))
    with pytest.raises(dynident.StudyError, match="unknown field `gravity`"):
        dynident.Robot.load(root / "robots" / "ur10.urdf", gravity=9.81)  # type: ignore[call-arg]
    with pytest.raises(dynident.StudyError, match="no_such_joint"):
        ur10.locked({"no_such_joint": 0.0})


def test_pickled_robots_are_the_same(ur10: dynident.Robot) -> None:
    robot = ur10.locked({"wrist_3_joint": 0.2})
    again = pickle.loads(pickle.dumps(robot))
    q = np.random.default_rng(0).normal(size=(100, 5))
    np.testing.assert_array_equal(again.inverse_dynamics(q, q, q), robot.inverse_dynamics(q, q, q))


def _regressor_sum(robot: dynident.Robot) -> float:
    _, q, dq, ddq = motion(6)
    return float(np.abs(robot.regressor(q, dq, ddq)).sum())


@pytest.mark.skipif("fork" not in multiprocessing.get_all_start_methods(), reason="the system does not fork")
@pytest.mark.filterwarnings("ignore:.*fork.*:DeprecationWarning")
def test_threads_and_forked_processes(ur10: dynident.Robot) -> None:
    # Large enough for the thread pool, so that a child process must create its own pool.
    expected = _regressor_sum(ur10)
    with concurrent.futures.ThreadPoolExecutor(4) as threads:
        assert set(threads.map(_regressor_sum, [ur10] * 8)) == {expected}
    context = multiprocessing.get_context("fork")
    with concurrent.futures.ProcessPoolExecutor(2, mp_context=context) as processes:
        assert set(processes.map(_regressor_sum, [ur10] * 4, timeout=120)) == {expected}


def test_a_regressor_is_written_where_it_is_wanted(ur10: dynident.Robot) -> None:
    # More than one block, but not a whole number of blocks.
    _, q, dq, ddq = motion(6, seconds=3.0, rate_hz=100.0)
    whole = ur10.regressor(q, dq, ddq)
    out = np.full_like(whole, np.nan)
    assert ur10.regressor(q, dq, ddq, out=out) is out
    np.testing.assert_array_equal(out, whole)
    base = ur10.regressor(q, dq, ddq, base=True)
    np.testing.assert_array_equal(base, whole[..., ur10.base_columns])
    theta = ur10.base_projection @ ur10.inertial_parameters.ravel()
    np.testing.assert_allclose(base @ theta, ur10.inverse_dynamics(q, dq, ddq), atol=1e-6)
    own = np.full_like(base, np.nan)
    np.testing.assert_array_equal(ur10.regressor(q, dq, ddq, base=True, out=own), base)
    one = np.full((6, 60), np.nan)
    np.testing.assert_array_equal(ur10.regressor(q[0], dq[0], ddq[0], out=one), whole[0])
    for wrong in (out[:-1], np.asfortranarray(out), out.astype("f4"), out[..., ::-1], "text"):
        with pytest.raises(ValueError, match="out: give an array of float64"):
            ur10.regressor(q, dq, ddq, out=wrong)
    out.flags.writeable = False
    with pytest.raises(ValueError, match="out"):
        ur10.regressor(q, dq, ddq, out=out)


def test_kinematics_are_those_of_the_differences(ur10: dynident.Robot) -> None:
    assert ur10.dof == ur10.n == 6
    assert ur10.link_names[-1] in ur10.link_names
    rng = np.random.default_rng(0)
    q = rng.uniform(-2.0, 2.0, (20, 6))
    for link in ("wrist_1_link", ur10.link_names[-1]):
        point = np.array([0.1, -0.2, 0.3])
        poses = ur10.forward_kinematics(q, link)
        np.testing.assert_allclose(poses[:, 3], np.tile([0.0, 0.0, 0.0, 1.0], (20, 1)))
        rotation = poses[:, :3, :3]
        np.testing.assert_allclose(rotation @ rotation.transpose(0, 2, 1), np.tile(np.eye(3), (20, 1, 1)), atol=1e-12)
        found = ur10.jacobian(q, link, point)
        step = 1e-6
        for joint in range(6):
            ends = [ur10.forward_kinematics(q + sign * step * np.eye(6)[joint], link) for sign in (1, -1)]
            places = [end[:, :3, :3] @ point + end[:, :3, 3] for end in ends]
            # The error of central differences is some 1e-12 / 1e-6.
            np.testing.assert_allclose(found[:, :3, joint], (places[0] - places[1]) / (2 * step), atol=1e-8)
            spin = (ends[0][:, :3, :3] - ends[1][:, :3, :3]) / (2 * step) @ rotation.transpose(0, 2, 1)
            omega = np.stack([spin[:, 2, 1], spin[:, 0, 2], spin[:, 1, 0]], axis=-1)
            np.testing.assert_allclose(found[:, 3:, joint], omega, atol=1e-8)
    assert (ur10.jacobian(q[0], ur10.link_names[0]) == 0.0).all()
    with pytest.raises(dynident.RobotError, match="no link `hand`: give one of"):
        ur10.forward_kinematics(q, "hand")


def test_kinematics_are_those_of_pinocchio(root: Path) -> None:
    pinocchio = pytest.importorskip("pinocchio")
    path = str(root / "robots" / "ur10.urdf")
    robot, model = dynident.Robot.load(path), pinocchio.buildModelFromUrdf(path)
    data = model.createData()
    q = np.random.default_rng(1).uniform(-2.0, 2.0, 6)
    pinocchio.framesForwardKinematics(model, data, q)
    pinocchio.computeJointJacobians(model, data, q)
    for link in robot.link_names:
        frame = model.getFrameId(link)
        np.testing.assert_allclose(robot.forward_kinematics(q, link), data.oMf[frame].homogeneous, atol=1e-12)
        expected = pinocchio.getFrameJacobian(model, data, frame, pinocchio.LOCAL_WORLD_ALIGNED)
        np.testing.assert_allclose(robot.jacobian(q, link), expected, atol=1e-12)


def test_limits_are_those_of_the_description(ur10: dynident.Robot) -> None:
    assert set(ur10.limits) == {"lower", "upper", "velocity", "effort"}
    assert ur10.limits["upper"][0] == pytest.approx(2 * np.pi, abs=1e-3)
    text = """<robot name="arm"><link name="base"/><link name="rod"><inertial><mass value="1"/>
    <inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial></link>
    <joint name="j" type="continuous"><parent link="base"/><child link="rod"/><axis xyz="0 0 1"/></joint></robot>"""
    limits = dynident.Robot.from_urdf(text).limits
    assert [limits[key][0] for key in ("lower", "upper", "velocity", "effort")] == [-np.inf, np.inf, np.inf, np.inf]


def test_errors_of_descriptions_have_a_place(tmp_path: Path) -> None:
    path = tmp_path / "arm.urdf"
    path.write_text('<robot name="arm">\n<link name="base"/>\n<joint name="j" type="what"/></robot>')
    with pytest.raises(dynident.RobotError) as raised:
        dynident.Robot.load(path)
    assert raised.value.path == path
    assert raised.value.line == 3 and raised.value.column >= 1
    with pytest.raises(dynident.Error) as raised:
        dynident.Robot.load(tmp_path / "missing.urdf")
    assert raised.value.path == tmp_path / "missing.urdf"
