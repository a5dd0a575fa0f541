"""Fits simulated robots with position drives whose values are known.

servo_twins.py DYNIDENT OUT [--robot so101|pendulum|arm7|leg] [--rate HZ] [--load-friction F] [--twins N] [--seed S] [--starts N] [--check]: simulates N robots in MuJoCo
(another integrator than Dynident's) that follow commands by position actuators with friction, delay and encoders of 4,096 counts, fits each with `dynident identify`, and prints how often the 95 %
intervals contain the true values, the error on unseen motion, and the difference between Dynident's simulation and MuJoCo's of the exported MJCF. With --starts the first robot is fitted from N starts
within a factor of 5 of the truth instead, and the errors at the ends are compared. With --check the status is 1 if a figure misses its limit.
"""

import argparse
import dataclasses
import json
import pathlib
import subprocess
import sys
import time

import mujoco
import numpy as np

ROOT = pathlib.Path(__file__).resolve().parent.parent
COUNT = 2 * np.pi / 4096
STEP_S = 0.001
LOAD_KG = 0.2
LOAD_M = (0.0, 0.0, -0.15)

# One joint with a weight, like a bench for servos. The body `load` exists in the simulation only; it has mass in one log.
PENDULUM = """<mujoco model="pendulum"><compiler angle="radian"/><worldbody>
<body name="rod"><joint name="swing" axis="0 1 0"/><inertial pos="0 0 -0.1" mass="0.35" diaginertia="0.001 0.001 0.0001"/>LOAD</body>
</worldbody><actuator><position joint="swing" kp="10"/></actuator></mujoco>"""
LOAD = '<body name="load" pos="{} {} {}"><inertial pos="0 0 0" mass="1e-9" diaginertia="1e-12 1e-12 1e-12"/></body>'.format(*LOAD_M)

# A leg in the air: hip roll, hip pitch, knee.
LEG = """<mujoco model="leg"><compiler angle="radian"/><worldbody>
<body name="hip"><joint name="roll" axis="1 0 0"/><inertial pos="0 0.02 0" mass="0.7" diaginertia="0.0005 0.0008 0.0006"/>
<body name="thigh" pos="0 0.08 0"><joint name="pitch" axis="0 1 0"/><inertial pos="0 0 -0.03" mass="1.0" diaginertia="0.005 0.005 0.001"/>
<body name="shank" pos="0 0 -0.21"><joint name="knee" axis="0 1 0"/><inertial pos="0 0 -0.08" mass="0.25" diaginertia="0.0015 0.0015 0.0001"/></body></body></body>
</worldbody><actuator><position joint="roll" kp="50"/><position joint="pitch" kp="50"/><position joint="knee" kp="50"/></actuator></mujoco>"""


@dataclasses.dataclass
class Kind:
    """A robot: its joints, the centre and half of the range of its commands, and whether its servos are of one type."""

    joints: int
    centre: tuple
    range: tuple
    alike: bool


KINDS = {
    "so101": Kind(6, (0, 0, 0, 0, 0, 0.4), (0.5, 0.5, 0.5, 0.5, 0.5, 0.3), True),
    "pendulum": Kind(1, (0.3,), (1.5,), False),
    "arm7": Kind(7, (0, 0.4, 0, -0.8, 0, 0.6, 0), (0.6,) * 7, False),
    "leg": Kind(3, (0, 0.6, -1.2), (0.4, 0.7, 0.7), False),
}


def descriptions(name, folder):
    """The MJCF that Dynident reads, and the model that MuJoCo simulates."""
    if name == "so101":
        path = ROOT / "robots" / "so101.xml"
        return path, mujoco.MjModel.from_xml_path(str(path))
    path = folder / f"{name}.xml"
    if name == "arm7":
        spec = mujoco.MjSpec.from_file(str(ROOT / "robots" / "iiwa14.urdf"))
        spec.compile()
        for joint in spec.joints:
            actuator = spec.add_actuator(name=joint.name, target=joint.name, trntype=mujoco.mjtTrn.mjTRN_JOINT)
            actuator.set_to_position(kp=1000.0)
        model = spec.compile()
        path.write_text(spec.to_xml())
        return path, model
    text = {"pendulum": PENDULUM, "leg": LEG}[name]
    path.write_text(text.replace("LOAD", ""))
    return path, mujoco.MjModel.from_xml_string(text.replace("LOAD", LOAD))


def so101_drives(rng):
    """True values of six servos of one type, in MuJoCo's terms."""
    common = {"kp": rng.uniform(8, 25), "damping": rng.uniform(0.5, 1.5), "armature": rng.uniform(0.01, 0.04)}
    joints = [{key: value * np.exp(0.05 * rng.standard_normal()) for key, value in common.items()} for _ in range(6)]
    for joint in joints:
        joint["frictionloss"] = 0.1 * np.exp(0.7 * rng.standard_normal())
    return joints


def other_drives(rng, model, kind):
    """True values of individual drives for the inertia of each joint."""
    data = mujoco.MjData(model)
    data.qpos[: kind.joints] = kind.centre
    mujoco.mj_forward(model, data)
    full = np.zeros((model.nv, model.nv))
    mujoco.mj_fullM(model, data, full)
    joints = []
    for joint in range(kind.joints):
        inertia = full[joint, joint] - model.dof_armature[joint]
        armature = max(inertia, 1e-3) * np.exp(rng.uniform(-1.0, 0.7))
        frequency, ratio = rng.uniform(15, 35), rng.uniform(0.5, 1.2)
        kp = (inertia + armature) * frequency**2
        joints.append({"kp": kp, "damping": 2 * ratio * frequency * (inertia + armature), "armature": armature, "frictionloss": kp * rng.uniform(0.003, 0.02)})
    return joints


def twin(rng, name, folder):
    """The path of the description, a MuJoCo model with other values and masses, and the values."""
    kind = KINDS[name]
    path, model = descriptions(name, folder)
    values = so101_drives(rng) if name == "so101" else other_drives(rng, model, kind)
    masses = np.exp(0.2 * rng.standard_normal(model.nbody))
    model.body_mass *= masses
    model.body_inertia *= masses[:, None]
    for joint, own in enumerate(values):
        model.dof_damping[joint] = own["damping"]
        model.dof_armature[joint] = own["armature"]
        model.dof_frictionloss[joint] = own["frictionloss"]
        model.actuator_gainprm[joint, 0] = own["kp"]
        model.actuator_biasprm[joint, 1:3] = -own["kp"], 0.0
        model.actuator_forcelimited[joint] = 0
        # A stiff constraint, so that a resting joint does not creep.
        model.dof_solref[joint] = 0.005, 1.0
    configured(model)
    return path, model, values


def configured(model, step_s=STEP_S):
    model.opt.timestep = step_s
    model.opt.integrator = mujoco.mjtIntegrator.mjINT_IMPLICITFAST
    model.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_CONTACT
    # Joint limits of the description belong to the description: drives stop at none here.
    model.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_LIMIT
    model.actuator_ctrllimited[:] = 0


def commands(rng, seconds, kind, rate):
    """Sums of sines, then steps with rests."""
    times = np.arange(0, seconds, 1 / rate)
    rows = np.zeros((len(times), kind.joints))
    for joint in range(kind.joints):
        sines = sum(rng.uniform(0.1, 0.4) * np.sin(2 * np.pi * f * times + rng.uniform(0, 6)) for f in rng.uniform(0.1, 1.5, 3))
        steps = np.repeat(rng.uniform(-0.6, 0.6, int(seconds / 1.5) + 1), int(1.5 * rate))[: len(times)]
        rows[:, joint] = kind.range[joint] * np.where(times < 0.6 * seconds, sines, steps) + kind.centre[joint]
    return times, rows


def played(model, times, rows, delay_s, load_friction):
    """Positions at the stamps along delayed, held commands, from the first command at rest. Friction grows with the torque of weight and velocity."""
    data = mujoco.MjData(model)
    joints = rows.shape[1]
    data.qpos[:joints] = rows[0]
    friction = model.dof_frictionloss.copy()
    out = np.zeros_like(rows)
    step, sample = 0, 0
    step_s = model.opt.timestep
    while sample < len(times):
        now = step * step_s
        if now >= times[sample] - 1e-9:
            out[sample] = data.qpos[:joints]
            sample += 1
        index = np.searchsorted(times, now - delay_s + 1e-9, side="right") - 1
        data.ctrl[:joints] = rows[max(index, 0)]
        if load_friction:
            model.dof_frictionloss[:] = friction + load_friction * np.abs(data.qfrc_bias)
        mujoco.mj_step(model, data)
        step += 1
    model.dof_frictionloss[:] = friction
    return out


def write_log(path, times, rows, positions):
    joints = rows.shape[1]
    names = [f"q{k + 1}" for k in range(joints)] + [f"c{k + 1}" for k in range(joints)]
    counted = np.round(positions / COUNT) * COUNT
    table = np.column_stack([times, counted, rows])
    np.savetxt(path, table, delimiter=",", header=",".join(["t_s", *names]), comments="", fmt="%.9g")


STUDY = """name = "servo twin"
[robot]
file = "{robot}"
[drive.servo]
{stated}
[drive.servo.fit]
alike = {alike}
[format]
time = {{ column = "t_s" }}
position = {{ columns = "q{{1..{joints}}}" }}
command = {{ columns = "c{{1..{joints}}}" }}
"""


def recorded(options, folder, rng):
    """Writes the logs of a twin. Returns the study without stated values, as a function of them, and the truth."""
    name, kind = options.robot, KINDS[options.robot]
    path, model, values = twin(rng, name, folder)
    logs = ""
    for log, role in [("one", "identify"), ("two", "identify"), ("test", "validate")]:
        times, rows = commands(rng, options.seconds, kind, options.rate)
        is_loaded = name == "pendulum" and log == "two"
        if is_loaded:
            model.body_mass[model.body("load").id] = LOAD_KG
        write_log(folder / f"{log}.csv", times, rows, played(model, times, rows, options.delay, options.load_friction))
        logs += f'\n[[log]]\nfile = "{log}.csv"\nrole = "{role}"\n'
        if is_loaded:
            model.body_mass[model.body("load").id] = 1e-9
            logs += 'payload = "load"\n'
    if name == "pendulum":
        logs = f'\n[[payload]]\nname = "load"\nlink = "rod"\nmass_kg = {LOAD_KG}\ncom_m = {list(LOAD_M)}\n' + logs

    def study(stated=""):
        return STUDY.format(robot=path, alike=str(kind.alike).lower(), joints=kind.joints, stated=stated) + logs

    return study, values, {model.body(k).name: model.body_mass[k] for k in range(model.nbody)}


def fitted(program, folder, study):
    (folder / "twin.toml").write_text(study)
    begin = time.perf_counter()
    subprocess.run([program, "identify", folder / "twin.toml", "--out", folder / "result", "--quiet"], check=False)
    return json.loads((folder / "result" / "result.json").read_text()), time.perf_counter() - begin


# The truth in MuJoCo's terms by the name in the result.
NAMES = {"stiffness": "kp", "damping": "damping", "armature": "armature", "Coulomb friction": "frictionloss"}


def covered(result, values, masses, load_friction):
    """For each value: its name, the error as a part of the half width of its 95 % interval, and whether the motion determines it."""
    rows = []
    for drive, own in zip(result["drives"], values, strict=True):
        truth = {name: own[key] for name, key in NAMES.items()}
        if load_friction:
            truth["friction per load"] = load_friction
        rows += [(n["name"], (n["value"] - truth[n["name"]]) / n["half_width_95"], n["determined"]) for n in drive["values"] if n["name"] in truth]
    for body in result["bodies"]:
        rows += [(n["name"], (n["value"] - masses[body["body"]]) / n["half_width_95"], n["determined"]) for n in body["values"] if n["name"] == "mass" and body["body"] in masses]
    return rows


def replayed(result, folder):
    """Largest root mean square difference between MuJoCo's simulation of the exported model and Dynident's, mrad."""
    model = mujoco.MjModel.from_xml_path(str(folder / "result" / "identified.xml"))
    joints = len(result["drives"])
    configured(model, result["step_s"])
    log = result["motion"]
    rows = np.loadtxt(folder / "test.csv", delimiter=",", skiprows=1)
    data = mujoco.MjData(model)
    data.qpos[:joints] = rows[0, 1 : joints + 1]
    drives_found = result["drives"]
    times, simulated = np.array(log["times_s"]), np.array(log["simulated"])
    path, stamps, step = [], [], 0
    while step * model.opt.timestep <= times[-1] + 0.1:
        now = step * model.opt.timestep
        stamps.append(now)
        path.append(data.qpos[:joints].copy())
        index = np.searchsorted(rows[:, 0], now + 1e-9, side="right") - 1
        data.ctrl[:joints] = rows[index, joints + 1 :]
        mujoco.mj_step(model, data)
        step += 1
    path = np.array(path)
    worst = 0.0
    for joint, drive in enumerate(drives_found):
        replay = np.interp(times + drive["read_delay_s"], stamps, path[:, joint])
        # MuJoCo's delayed actuators begin with the command zero.
        later = times > 1.0
        worst = max(worst, np.sqrt(np.mean((replay - simulated[joint])[later] ** 2)))
    return 1e3 * worst


def from_starts(options):
    """Fits the first twin from random starts. Returns whether at least 95 % end within 1 % of the best errors."""
    folder = options.out / "starts"
    folder.mkdir(parents=True, exist_ok=True)
    study, values, _ = recorded(options, folder, np.random.default_rng([options.seed, 0]))
    rng = np.random.default_rng([options.seed, 1])
    ends = []
    for index in range(options.starts):
        stated = f"delay_s = {rng.uniform(0, 0.06):.4f}\n"
        for key, truth in [("stiffness", "kp"), ("damping", "damping"), ("armature", "armature"), ("coulomb", "frictionloss")]:
            factors = np.exp(rng.uniform(-np.log(5), np.log(5), len(values)))
            stated += f"{key} = [{', '.join(f'{own[truth] * factor:.6g}' for own, factor in zip(values, factors, strict=True))}]\n"
        result, seconds = fitted(options.program, folder, study(stated))
        # Joints have errors of different size: their geometric mean is the cost.
        ends.append(np.exp(np.mean([np.log(np.sqrt(np.mean(np.square(errors)))) for errors in zip(*[log["errors"] for log in result["training"]], strict=True)])))
        print(f"start {index}: {1e3 * ends[-1]:.4f} mrad, {result['iterations']} steps, {seconds:.1f} s", flush=True)
    share = 100 * np.mean(np.array(ends) <= 1.01 * min(ends))
    print(f"starts that end within 1 % of the least error: {share:.0f} % of {len(ends)}")
    return share >= 95


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("program")
    parser.add_argument("out", type=pathlib.Path)
    parser.add_argument("--robot", choices=KINDS, default="so101")
    parser.add_argument("--rate", type=float, default=50.0)
    parser.add_argument("--load-friction", type=float, default=0.0)
    parser.add_argument("--twins", type=int, default=10)
    parser.add_argument("--starts", type=int, default=0)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--seconds", type=float, default=30.0)
    parser.add_argument("--delay", type=float, default=0.02)
    parser.add_argument("--check", action="store_true")
    options = parser.parse_args()
    if options.starts:
        good = from_starts(options)
        sys.exit(0 if good or not options.check else 1)
    rows, delays, tests, replays = [], [], [], []
    for index in range(options.twins):
        folder = options.out / f"{options.robot}{index}"
        folder.mkdir(parents=True, exist_ok=True)
        study, values, masses = recorded(options, folder, np.random.default_rng([options.seed, index]))
        result, seconds = fitted(options.program, folder, study())
        own = covered(result, values, masses, options.load_friction)
        rows += own
        drive = result["drives"][0]
        delays.append(drive["delay_s"] - np.mean([d["read_delay_s"] for d in result["drives"]]) - options.delay)
        tests.append(1e3 * np.mean(result["validation"][0]["errors"]))
        if (folder / "result" / "identified.xml").exists():
            replays.append(replayed(result, folder))
        hold = sum(abs(part) <= 1 for _, part, _ in own)
        print(
            f"{options.robot} {index}: {hold} of {len(own)} intervals hold, delay wrong by {1e3 * delays[-1]:.2f} ms, unseen motion {tests[-1]:.2f} mrad, "
            f"replay of the MJCF {replays[-1] if replays else np.nan:.2f} mrad, {result['unknowns']} unknowns, scale ±{result['scale']['half_width_95_percent']:.0f} %, {seconds:.1f} s",
            flush=True,
        )
    for name in sorted({name for name, _, _ in rows}):
        parts = np.array([part for own, part, _ in rows if own == name])
        print(f"  {name}: {100 * np.mean(np.abs(parts) <= 1):.0f} % of {len(parts)} intervals hold, mean error {np.mean(parts):+.2f} half widths")
    share, determined = (100 * np.mean([abs(part) <= 1 for _, part, known in rows if known or not only]) for only in [False, True])
    print(
        f"intervals that hold: {share:.1f} % of {len(rows)}, of determined values {determined:.1f} %; delay within {1e3 * np.max(np.abs(delays)):.2f} ms; unseen motion {np.mean(tests):.2f} mrad; "
        f"replay at most {np.max(replays, initial=0.0):.2f} mrad"
    )
    if options.check:
        good = share >= 80 and np.max(np.abs(delays)) < 0.0025 and np.mean(tests) < 3 and np.max(replays, initial=0.0) < 1.5
        sys.exit(0 if good else 1)


if __name__ == "__main__":
    main()
