#!/usr/bin/env python3
"""Replays a recorded log in MuJoCo, with the model before the identification and the identified model.

    replay_in_mujoco.py BEFORE AFTER LOG.csv --time t_s --position 'q{1..6}_rad' --torque 'tau{1..6}_Nm' [--from 0.7] [--require-better]

BEFORE and AFTER are MJCF or URDF files; URDF shapes are ignored. Joints that exist only in BEFORE are fixed at zero. Each model is tested in two ways:

inverse: difference between the torque of the model for the recorded motion and the recorded torque, Nm (N) rms, with the same low-pass for both.
forward: motion of the model with the recorded torque. A weak controller, the same for both models, keeps it near the recorded motion. Results are the rms
         tracking error in mrad (mm) and the torque of the controller. A perfect model needs no controller torque.

Needs mujoco, numpy and scipy."""
import argparse
import csv
import re
import sys
import xml.etree.ElementTree as ElementTree

import mujoco
import numpy as np
from scipy.interpolate import make_interp_spline
from scipy.signal import butter, sosfiltfilt


def columns(pattern):
    """q{1..3}_rad: q1_rad, q2_rad, q3_rad."""
    found = re.fullmatch(r"(.*)\{(\d+)\.\.(\d+)\}(.*)", pattern)
    if not found:
        return pattern.split(",")
    before, first, last, after = found.groups()
    return [f"{before}{k}{after}" for k in range(int(first), int(last) + 1)]


def joint_elements(root):
    """Joints of a robot description with their parents, by name."""
    return {child.get("name"): (parent, child) for parent in root.iter() for child in parent if child.tag == "joint" and child.get("name")}


def moving(root):
    """Names of the joints that move."""
    if root.tag == "robot":
        return [name for name, (_, joint) in joint_elements(root).items() if joint.get("type") != "fixed"]
    world = root.find("worldbody")
    return [joint.get("name") for joint in world.iter("joint")]


def loaded(path, kept):
    """The model with only the joints `kept`, and without constraints except friction."""
    root = ElementTree.parse(path).getroot()
    if root.tag == "robot":
        for link in root.iter("link"):
            for shape in [child for child in link if child.tag in ("visual", "collision")]:
                link.remove(shape)
        for name, (_, joint) in joint_elements(root).items():
            if name not in kept:
                joint.set("type", "fixed")
        model = mujoco.MjModel.from_xml_string(ElementTree.tostring(root, encoding="unicode"))
    else:
        for parent in list(root.find("worldbody").iter()):
            for joint in [child for child in parent if child.tag == "joint" and child.get("name") not in kept]:
                parent.remove(joint)
        model = mujoco.MjModel.from_xml_string(ElementTree.tostring(root, encoding="unicode"))
    model.jnt_limited[:] = 0
    # Contacts are not part of the arm's dynamics.
    model.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_CONTACT
    # A robot description without gravity gets MuJoCo's default.
    return model


class Replay:
    """A model with the joints in the order of the log."""

    def __init__(self, model, names):
        self.model, self.data = model, mujoco.MjData(model)
        joints = [mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_JOINT, name) for name in names]
        self.q, self.v = model.jnt_qposadr[joints], model.jnt_dofadr[joints]

    def inverse(self, motion):
        """Torque of every sample."""
        torque = []
        for q, dq, ddq in zip(*motion):
            self.data.qpos[self.q], self.data.qvel[self.v], self.data.qacc[self.v] = q, dq, ddq
            mujoco.mj_inverse(self.model, self.data)
            torque.append(self.data.qfrc_inverse[self.v].copy())
        return np.array(torque)

    def inertia(self, postures):
        """Mean diagonal of the mass matrix."""
        diagonals = []
        for q in postures:
            self.data.qpos[self.q] = q
            mujoco.mj_forward(self.model, self.data)
            full = np.zeros((self.model.nv, self.model.nv))
            mujoco.mj_fullM(self.model, self.data, full)
            diagonals.append(full[self.v, self.v])
        return np.mean(diagonals, axis=0)

    def forward(self, times, wanted, torque, stiffness, damping, step):
        """Returns positions and controller torque at every `step`, driven by the recorded torque and the controller."""
        model, data = self.model, self.data
        model.opt.timestep = step
        # Add the controller's damping to the model, because MuJoCo integrates damping implicitly; a wrist without drive inertia is light.
        model.opt.integrator = mujoco.mjtIntegrator.mjINT_IMPLICITFAST
        model.dof_damping[self.v] += damping
        mujoco.mj_resetData(model, data)
        data.qpos[self.q], data.qvel[self.v] = wanted(times[0]), wanted(times[0], 1)
        positions, added = [], []
        for time in np.arange(times[0], times[-1], step):
            drive = stiffness * (wanted(time) - data.qpos[self.q]) + damping * wanted(time, 1)
            positions.append(data.qpos[self.q].copy())
            added.append(drive - damping * data.qvel[self.v])
            data.qfrc_applied[self.v] = torque(time) + drive
            mujoco.mj_step(model, data)
        return np.array(positions), np.array(added)


def rms(values):
    return np.sqrt(np.mean(np.square(values), axis=0))


def main():
    options = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    for name in ("before", "after", "log"):
        options.add_argument(name)
    options.add_argument("--time", default="t_s")
    options.add_argument("--position", required=True, help="columns, rad (m): 'q{1..6}_rad' or comma-separated names")
    options.add_argument("--torque", required=True, help="columns, Nm (N)")
    options.add_argument("--joints", help="names of the joints in column order (default: order of AFTER)")
    options.add_argument("--from", dest="first", type=float, default=0.0, help="start at this fraction of the log")
    options.add_argument("--cutoff-hz", type=float, default=3.0, help="cut-off of the low-pass for motion and torque, Hz")
    options.add_argument("--controller-hz", type=float, default=2.0, help="natural frequency of the controller in the forward test, Hz; below 1 Hz gravity moves the arm far from the recorded motion")
    options.add_argument("--delay-ms", type=float, default=0.0, help="delay of the logged torque relative to the motion: `delay` in simulator.json")
    options.add_argument("--require-better", action="store_true", help="fail unless AFTER is better at every joint in the inverse test and on average in the forward test")
    chosen = options.parse_args()

    roots = [ElementTree.parse(path).getroot() for path in (chosen.before, chosen.after)]
    common = [name for name in moving(roots[1]) if name in moving(roots[0])]
    names = chosen.joints.split(",") if chosen.joints else common
    if missing := [name for name in names if name not in common]:
        sys.exit(f"joints missing in one of the models: {', '.join(missing)}")
    models = [Replay(loaded(path, names), names) for path in (chosen.before, chosen.after)]

    with open(chosen.log, newline="") as file:
        rows = list(csv.DictReader(file))
    rows = rows[int(chosen.first * len(rows)) :]
    of = lambda pattern: np.array([[float(row[name]) for name in columns(pattern)] for row in rows])
    times, positions, torques = of(chosen.time)[:, 0], of(chosen.position), of(chosen.torque)
    if positions.shape[1] != len(names) or torques.shape[1] != len(names):
        sys.exit(f"{positions.shape[1]} positions and {torques.shape[1]} torques for the joints {', '.join(names)}")

    # Uniform sampling, a zero-phase low-pass, derivatives of a fifth-order spline.
    rate = 1.0 / np.median(np.diff(times))
    grid = np.arange(times[0], times[-1], 1.0 / rate)
    even = lambda values, t: np.stack([np.interp(t, times, column) for column in values.T], axis=1)
    low_pass = butter(4, chosen.cutoff_hz, fs=rate, output="sos")
    smooth = lambda values: sosfiltfilt(low_pass, values, axis=0)
    wanted = make_interp_spline(grid, smooth(even(positions, grid)), k=5)
    measured = even(torques, grid + 1e-3 * chosen.delay_ms)
    motion = [wanted(grid), wanted(grid, 1), wanted(grid, 2)]
    # Omit the ends, where the filter extrapolates.
    edge = int(rate / chosen.cutoff_hz)
    inside = slice(edge, len(grid) - edge)

    target = smooth(measured)[inside]
    off = [rms(smooth(model.inverse(motion))[inside] - target) for model in models]
    print(f"{len(grid)} samples at {rate:.1f} Hz, below {chosen.cutoff_hz:g} Hz\n")
    print("inverse dynamics at the recorded motion: torque error, rms\n\n| joint | torque rms | before | after |\n| --- | --- | --- | --- |")
    size = rms(target)
    for name, own, before, after in zip(names, size, *off):
        print(f"| {name} | {own:.3f} | {before:.3f} | {after:.3f} |")
    relative = [100 * np.linalg.norm(error) / np.linalg.norm(size) for error in off]
    print(f"| all, relative to the torque | | {relative[0]:.1f} % | {relative[1]:.1f} % |\n")

    # Use one controller for both models, from the inertia of the identified model; without drive inertia a wrist has almost no inertia.
    inertia = models[1].inertia(motion[0][:: max(1, len(grid) // 50)])
    frequency = 2 * np.pi * chosen.controller_hz
    stiffness, damping = inertia * frequency**2, 2 * inertia * frequency
    torque = make_interp_spline(grid, measured, k=1)
    step = 1e-3
    runs = [model.forward(grid, wanted, torque, stiffness, damping, step) for model in models]
    recorded = wanted(np.arange(grid[0], grid[-1], step))
    away = [1e3 * rms(run - recorded) for run, _ in runs]
    helped = [rms(added) for _, added in runs]
    print(f"forward dynamics with the recorded torque, controller at {chosen.controller_hz:g} Hz: tracking error, rms (controller torque)\n")
    print("| joint | before, mrad | after, mrad |\n| --- | --- | --- |")
    for name, before, after, help_before, help_after in zip(names, *away, *helped):
        print(f"| {name} | {before:.1f} ({help_before:.2f} Nm) | {after:.1f} ({help_after:.2f} Nm) |")
    whole = [np.linalg.norm(error) for error in away]
    print(f"| all | {whole[0]:.1f} | {whole[1]:.1f} |")

    if chosen.require_better:
        worse = [name for name, before, after in zip(names, *off) if not after < before]
        if worse:
            sys.exit(f"the identified model does not improve the torque of the joints {', '.join(worse)}")
        if not whole[1] < whole[0]:
            sys.exit("the identified model does not improve the tracking of the recorded motion")


if __name__ == "__main__":
    main()
