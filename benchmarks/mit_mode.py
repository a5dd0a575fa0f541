"""An arm in MIT mode, simulated with MuJoCo: the torque comes from commands and known gains (`sum` of `[format.torque]`).

mit_mode.py DYNIDENT FOLDER: simulates a Unitree Z1 whose bodies, drive inertia and friction differ from its URDF. Its drives compute kp (q_d - q) +
kd (dq_d - dq) in each step of 0.5 ms; the log has 250 rows per second with the command of the last cycle and the position (16 bits of +-12.5 rad) and
velocity (12 bits of +-30 rad/s) that Damiao drives send. Writes studies with the torque of the simulation, with `sum`, and with the command of the
next cycle (a recorder that logs what it has just sent), and prints the error of the rigid-body torque of `identified.urdf` against the truth.
"""

import os
import pathlib
import re
import subprocess
import sys

import mujoco
import numpy as np

FOLDER = pathlib.Path(sys.argv[2]).resolve()
os.environ["OUT"] = str(FOLDER)
FOLDER.mkdir(parents=True, exist_ok=True)
sys.path.insert(0, str(pathlib.Path(__file__).resolve().parent / "corpus"))
from arms import Arm, rigid

STEP_S, STEPS_OF_CYCLE = 5e-4, 8
KP = np.array([150.0, 200, 150, 80, 50, 40])
KD = np.array([4.0, 6, 4, 2, 1, 1])
ARMATURE = np.array([0.05, 0.06, 0.05, 0.02, 0.015, 0.01])
VISCOUS = np.array([0.8, 1.0, 0.7, 0.4, 0.3, 0.2])
COULOMB = np.array([0.8, 1.2, 0.9, 0.4, 0.3, 0.25])
POSITION_STEP, VELOCITY_STEP = 25.0 / 2**16, 60.0 / 2**12


def simulation(arm):
    """The arm in MuJoCo, with the bodies of `arm`."""
    text = open(arm.urdf).read()
    text = re.sub(r"<(visual|collision)\b.*?</\1>", "", text, flags=re.S)
    text = re.sub(r'(<joint name="jointGripper" type=)"revolute"', r'\1"fixed"', text)
    text = re.sub(r"(<robot [^>]*>)", r'\1<mujoco><compiler fusestatic="true" balanceinertia="true"/></mujoco>', text, count=1)
    model = mujoco.MjModel.from_xml_string(text)
    model.opt.timestep = STEP_S
    model.opt.integrator = mujoco.mjtIntegrator.mjINT_IMPLICITFAST
    model.jnt_limited[:] = 0
    for joint in range(model.njnt):
        body, inertia = model.jnt_bodyid[joint], arm.model.inertias[joint + 1]
        ratio = inertia.mass / model.body_mass[body]
        model.body_mass[body] *= ratio
        model.body_inertia[body] *= ratio
    model.dof_armature[:], model.dof_damping[:], model.dof_frictionloss[:] = 0, 0, 0
    mujoco.mj_setConst(model, mujoco.MjData(model))
    # Both programs have the same rigid bodies.
    data, random = mujoco.MjData(model), np.random.default_rng(0)
    data.qpos[:], data.qvel[:], data.qacc[:] = random.normal(size=(3, model.nv))
    mujoco.mj_inverse(model, data)
    expected = rigid(arm.model, [data.qpos], [data.qvel], [data.qacc])[0]
    assert np.allclose(data.qfrc_inverse, expected, atol=1e-6), (data.qfrc_inverse, expected)
    model.dof_armature[:], model.dof_damping[:], model.dof_frictionloss[:] = ARMATURE, VISCOUS, COULOMB
    return model


def record(model, command, velocity, path):
    data = mujoco.MjData(model)
    data.qpos[:] = command[0]
    rows, last = [], (command[0], velocity[0])
    quantised = lambda x, step: np.round(x / step) * step
    for cycle in range(len(command)):
        measured = quantised(data.qpos, POSITION_STEP), quantised(data.qvel, VELOCITY_STEP)
        torque = KP * (last[0] - data.qpos) + KD * (last[1] - data.qvel)
        rows.append(np.r_[cycle * STEP_S * STEPS_OF_CYCLE, *measured, *last, command[cycle], velocity[cycle], torque])
        last = command[cycle], velocity[cycle]
        for _ in range(STEPS_OF_CYCLE):
            data.qfrc_applied[:] = KP * (last[0] - data.qpos) + KD * (last[1] - data.qvel)
            mujoco.mj_step(model, data)
    names = ["q", "dq", "q_d", "dq_d", "next_q_d", "next_dq_d", "tau"]
    header = ",".join(["t"] + [f"{name}{joint + 1}" for name in names for joint in range(len(KP))])
    np.savetxt(path, rows, delimiter=",", header=header, comments="", fmt="%.9g")


def main():
    arm = Arm("z1")
    model = simulation(arm)
    rate = 1 / (STEP_S * STEPS_OF_CYCLE)
    for name, seed in (("train", 1), ("test", 2)):
        motion = arm.log(40.0, rate, seed=seed, noise=0, period=20.0)
        record(model, motion.q, motion.dq, FOLDER / f"{name}.csv")
    gains = [list(map(float, gain)) for gain in (KP, -KP, KD, -KD)]
    n = len(KP)
    of_commands = lambda prefix: f'columns = ["{prefix}q_d{{1..{n}}}", "q{{1..{n}}}", "{prefix}dq_d{{1..{n}}}", "dq{{1..{n}}}"]\nsum = {gains}'
    studies = {
        "torque of the simulation": f'columns = "tau{{1..{n}}}"',
        "commands and gains": of_commands(""),
        "commands of the next cycle": of_commands("next_"),
    }
    for number, (name, torque) in enumerate(studies.items()):
        study = FOLDER / f"study{number}.toml"
        joints = ", ".join(f'"{joint}"' for joint in arm.names)
        study.write_text(f"""[robot]
file = "{arm.urdf}"
joints = [{joints}]
[format]
time = {{ column = "t" }}
position = {{ columns = "q{{1..{n}}}" }}
[format.torque]
{torque}
[[log]]
file = "train.csv"
[[log]]
file = "test.csv"
role = "validate"
""")
        out = FOLDER / f"r{number}"
        run = subprocess.run([sys.argv[1], "identify", str(study), "--out", str(out)], capture_output=True, text=True)
        (FOLDER / f"r{number}.txt").write_text(run.stdout + run.stderr)
        error = arm.truth_error(str(out / "identified.urdf")) if run.returncode < 2 else float("nan")
        held_out = re.findall(r"(?:held.out|validate)[^\n]*", run.stdout)[:2]
        print(f"{name:28s} exit {run.returncode}  rigid-body torque error {error:.2f} %  {held_out}")


if __name__ == "__main__":
    main()
