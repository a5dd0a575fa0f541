"""Tests the studies of the pages docs/src/recordings-*.md: python3 docs/recordings.py DYNIDENT FOLDER [PAGE..]

For each study with a log, the program writes the files that the study names into FOLDER: the robot description, and recordings with the columns, units,
signs and time stamps of the vendor's recorder. The torques are those of a robot whose masses differ from the description (`dynident evaluate`), plus
friction, drive inertia where the torque is measured at the motor, and noise. Then `dynident check` and `dynident identify` must succeed, and the
identified model must predict the held-out recording well.

The geometry is that of a robot in robots/: names, units and sides of the gear are the vendor's, the link lengths are not.
Needs the packages of golden/requirements.txt (NumPy, pyarrow, rosbags).
"""
import csv
import json
import pathlib
import re
import subprocess
import sys
import xml.etree.ElementTree as ElementTree

import numpy as np

HERE = pathlib.Path(__file__).resolve().parent
ROBOTS = HERE.parent / "robots"
# The noise is 0.2 % of the largest torque of each joint.
MOST_ERROR_PERCENT = 2.0
# Encoders with 4096 steps per turn and currents with steps of 6.5 mA.
MOST_ERROR_SERVOS_PERCENT = 20.0
MASS_RATIOS = [1.1, 0.9, 1.15, 0.85, 1.12, 0.9, 1.1]
DURATION_S = 20.0
DEGREES = 180.0 / np.pi
UR_GAINS = [13.6, 14.3, 11.4, 11.2, 11.8, 11.8]
ABB_GEARS = np.array([-121.0, 121.0, 100.0, -50.0, 50.0, -50.0])
# Motor angles from joint angles of the Stäubli TX40 (examples/tx40.toml), and joint zeros.
STAUBLI = np.diag([32.0, 32.0, 45.0, -48.0, 45.0, 32.0])
STAUBLI[5, 4] = 32.0
STAUBLI_ZERO = np.array([0.0, -np.pi / 2, np.pi / 2, 0.0, 0.0, 0.0])
SERVOS = ["shoulder_pan", "shoulder_lift", "elbow_flex", "wrist_flex", "wrist_roll"]


class Robot:
    """A description for the user, and the truth: the description with other masses. `moving_text` is the description with the joints of the log only."""

    def __init__(self, text, motor_side, friction, drive_inertia, centre, coupling=None, moving_text=None):
        self.text, self.moving_text, self.motor_side, self.coupling, self.centre = text, moving_text or text, motor_side, coupling, np.array(centre)
        self.friction, self.drive_inertia = np.array(friction), np.array(drive_inertia)
        root = ElementTree.fromstring(self.moving_text)
        moving = [joint for joint in root.iter("joint") if joint.get("type") in ("revolute", "continuous")]
        self.joints = [joint.get("name") for joint in moving]
        limits = [joint.find("limit") for joint in moving]
        self.lower, self.upper, self.speed = (np.array([float(limit.get(key)) for limit in limits]) for key in ("lower", "upper", "velocity"))

    def truth(self, weight_kg=0.0, link=None):
        """The description with other masses and, at a link, a weight 0.06 m along its z axis."""
        root = ElementTree.fromstring(self.moving_text)
        for number, body in enumerate(root.iter("inertial")):
            ratio = MASS_RATIOS[number % len(MASS_RATIOS)]
            for part in (body.find("mass"), body.find("inertia")):
                for key, value in part.attrib.items():
                    part.set(key, repr(float(value) * ratio))
        if weight_kg:
            root.append(ElementTree.fromstring(f'<link name="weight"><inertial><mass value="{weight_kg}"/><inertia ixx="0" ixy="0" ixz="0" iyy="0" iyz="0" izz="0"/></inertial></link>'))
            root.append(ElementTree.fromstring(f'<joint name="bolts" type="fixed"><parent link="{link}"/><child link="weight"/><origin xyz="0 0 0.06"/></joint>'))
        return ElementTree.tostring(root, encoding="unicode")


def renamed(file, joints, links={}):
    """A robot of robots/ with the joint names of another one."""
    text = (ROBOTS / file).read_text(encoding="utf-8")
    old = [joint.get("name") for joint in ElementTree.fromstring(text).iter("joint") if joint.get("type") in ("revolute", "continuous")]
    for before, after in [*zip(old, joints), *links.items()]:
        text = text.replace(f'"{before}"', f'"{after}"')
    return text


def servo_arm():
    """A small arm with the joint names of the SO-101 and a gripper."""
    links = ['<link name="base"/>']
    parent = "base"
    sizes = [("0 0 0.05", "0 0 1", 0.12, "0 0 0.03"), ("0.03 0 0.06", "0 1 0", 0.16, "0.06 0 0"), ("0.116 0 0", "0 1 0", 0.14, "0.06 0 0"), ("0.135 0 0", "0 1 0", 0.12, "0.03 0 0.01"),
             ("0.06 0 0", "1 0 0", 0.1, "0.03 0.01 0.01"), ("0.05 0.02 0", "0 0 1", 0.03, "0.03 0 0")]
    for name, (origin, axis, mass, com) in zip([*SERVOS, "gripper"], sizes):
        links.append(
            f'<joint name="{name}" type="revolute"><parent link="{parent}"/><child link="{name}_link"/><origin xyz="{origin}"/><axis xyz="{axis}"/>'
            f'<limit lower="-1.9" upper="1.9" velocity="6" effort="3"/></joint><link name="{name}_link"><inertial><origin xyz="{com}"/><mass value="{mass}"/>'
            f'<inertia ixx="1e-4" ixy="0" ixz="0" iyy="1e-4" iyz="0" izz="1e-4"/></inertial></link>'
        )
        parent = f"{name}_link"
    return '<robot name="so101">' + "".join(links) + "</robot>"


def robots():
    six = dict(motor_side=True, friction=[8.0, 8.0, 6.0, 2.0, 2.0, 1.5], drive_inertia=[1.0, 1.0, 0.8, 0.2, 0.2, 0.2], centre=[0.0, -1.2, 1.1, -0.6, 0.8, 0.0])
    sensors = dict(motor_side=False, friction=[0.6, 0.6, 0.5, 0.5, 0.3, 0.3, 0.2], drive_inertia=[0.0] * 7)
    here = lambda file: (ROBOTS / file).read_text(encoding="utf-8")
    ur10 = here("ur10.urdf")
    axes = lambda pattern, count: [pattern.format(number + 1) for number in range(count)]
    return {
        "ur10.urdf": Robot(ur10, **six),
        "arm.urdf": Robot(ur10, **six),
        "kr.urdf": Robot(renamed("ur10.urdf", axes("joint_a{}", 6)), **six),
        "irb.urdf": Robot(renamed("ur10.urdf", axes("joint_{}", 6)), **six),
        "xarm6.urdf": Robot(renamed("ur10.urdf", axes("joint{}", 6), {"wrist_3_link": "link6"}), **six),
        "panda.urdf": Robot(here("panda.urdf"), centre=[0.0, 0.0, 0.0, -1.6, 0.0, 1.8, 0.0], moving_text=here("panda_arm7.urdf"), **sensors),
        "lbr.urdf": Robot(renamed("iiwa14.urdf", axes("lbr_A{}", 7)), centre=[0.0, 0.4, 0.0, -1.0, 0.0, 0.6, 0.0], **sensors),
        "gen3.urdf": Robot(renamed("iiwa14.urdf", axes("joint_{}", 7)), centre=[0.0, 0.4, 0.0, -1.0, 0.0, 0.6, 0.0], **sensors),
        "tx40.urdf": Robot(here("tx40.urdf"), motor_side=True, friction=[4.0, 4.0, 3.0, 1.5, 1.5, 1.0], drive_inertia=[0.4, 0.4, 0.3, 0.1, 0.1, 0.05],
                           centre=[0.0, -1.0, 1.2, 0.0, 0.4, 0.0], coupling=(4, 5)),
        "so101.urdf": Robot(servo_arm(), motor_side=True, friction=[0.05, 0.05, 0.05, 0.03, 0.03, 0.0], drive_inertia=[0.01, 0.01, 0.01, 0.006, 0.006, 0.0], centre=[0.0, -0.6, 0.6, 0.3, 0.0, 0.0]),
    }


def motion(robot, rate_hz, seed):
    """Sines with a window that starts and ends at rest: times and positions, velocities and accelerations, (samples, joints)."""
    random = np.random.default_rng(seed)
    t = np.arange(int(DURATION_S * rate_hz) + 1) / rate_hz
    w = 2 * np.pi / DURATION_S
    window, slope, curvature = (1 - np.cos(w * t)) / 2, w * np.sin(w * t) / 2, w**2 * np.cos(w * t) / 2
    columns = []
    for joint, centre in enumerate(robot.centre):
        s, ds, dds = np.zeros_like(t), np.zeros_like(t), np.zeros_like(t)
        for harmonic in range(2, 13):
            a, phase = random.normal() / harmonic**0.5, random.uniform(0, 2 * np.pi)
            s += a * np.sin(harmonic * w * t + phase)
            ds += a * harmonic * w * np.cos(harmonic * w * t + phase)
            dds -= a * (harmonic * w) ** 2 * np.sin(harmonic * w * t + phase)
        x, dx, ddx = window * s, slope * s + window * ds, curvature * s + 2 * slope * ds + window * dds
        room = 0.8 * min(robot.upper[joint] - centre, centre - robot.lower[joint], 1.0 / 0.8)
        size = min(room / np.abs(x).max(), 0.7 * min(robot.speed[joint], 2.5) / np.abs(dx).max())
        columns.append((centre + size * x, size * dx, size * ddx))
    return t, *(np.stack([column[kind] for column in columns], axis=1) for kind in range(3))


class Recorder:
    """Writes the robot descriptions and recordings that a study names."""

    def __init__(self, dynident):
        self.dynident, self.robots = dynident, robots()

    def samples(self, folder, name, rate_hz, seed, noise=0.002, weight_kg=0.0, link=None):
        """Time, position, velocity and torque, (samples, joints); the noise is a share of the largest torque."""
        robot = self.robots[name]
        t, q, dq, ddq = motion(robot, rate_hz, seed)
        truth, states, torques = folder / "truth.urdf", folder / "states.csv", folder / "torques.csv"
        truth.write_text(robot.truth(weight_kg, link), encoding="utf-8")
        joints = len(robot.joints)
        more = np.zeros((len(t), joints - q.shape[1]))
        q, dq, ddq = (np.hstack([value, more]) for value in (q, dq, ddq))
        header = ",".join(f"{kind}{joint + 1}" for kind in ("q", "dq", "ddq") for joint in range(joints))
        np.savetxt(states, np.hstack([q, dq, ddq]), delimiter=",", header=header, comments="")
        self.run(0, "evaluate", truth, "--states", states, "--quantity", "inverse-dynamics", "--out", torques)
        tau = np.loadtxt(torques, delimiter=",", skiprows=1)[:, -joints:]
        n = len(robot.friction)
        q, dq, ddq, tau = q[:, :n], dq[:, :n], ddq[:, :n], tau[:, :n]
        tau = tau + robot.friction * (np.tanh(dq / 0.02) + 0.5 * dq) + 0.1 * robot.friction
        if robot.motor_side:
            tau = tau + robot.drive_inertia * ddq
        if robot.coupling:
            a, b = robot.coupling
            inertia, viscous, coulomb = robot.drive_inertia[b], 0.3 * robot.friction[b], 0.5 * robot.friction[b]
            tau[:, a] += inertia * ddq[:, b] + viscous * dq[:, b] + coulomb * np.tanh((dq[:, a] + dq[:, b]) / 0.02)
            tau[:, b] += inertia * ddq[:, a] + viscous * dq[:, a] + coulomb * np.tanh((dq[:, a] + dq[:, b]) / 0.02)
        random = np.random.default_rng(seed + 1000)
        tau = tau + noise * np.abs(tau).max(axis=0) * random.normal(size=tau.shape)
        q = q + 2e-5 * random.normal(size=q.shape)
        for file in (truth, states, torques):
            file.unlink()
        return t, q, dq, tau

    def run(self, status, *command):
        ended = subprocess.run([self.dynident, *map(str, command)], capture_output=True, text=True)
        if ended.returncode != status:
            sys.exit(f"{' '.join(map(str, command))}: exit status {ended.returncode}, expected {status}\n{ended.stdout}{ended.stderr}")
        return ended.stdout

    def write(self, folder, robot, file):
        """Writes one log of a study. `_test` in the name selects another motion."""
        seed = 2 if "_test." in file or file.startswith("test_") or file == "run2" else 1
        path = folder / file
        if file.startswith("robot_data"):
            t, q, dq, tau = self.samples(folder, robot, 125.0, seed)
            table(path, {"timestamp": 8123.4 + t, **named("actual_q_{}", q, 0), **named("actual_qd_{}", dq, 0), **named("actual_current_{}", tau / UR_GAINS, 0)}, delimiter=" ")
        elif file.startswith("franka"):
            t, q, dq, tau = self.samples(folder, robot, 1000.0, seed)
            table(path, {"time": np.round(1000 * t), "success_rate": np.ones_like(t), **named("state.q[{}]", q, 0), **named("state.dq[{}]", dq, 0), **named("state.tau_J[{}]", tau, 0)})
        elif file.startswith("fri"):
            t, q, dq, tau = self.samples(folder, robot, 200.0, seed)
            table(path, {"t_s": t, **named("measured_joint_position_{}", q, 0), **named("measured_torque_{}", -tau, 0), **named("external_torque_{}", 0 * tau + 0.1, 0)})
        elif file.endswith("_NextGenDrive#1.dat"):
            t, q, dq, tau = self.samples(folder, robot, 250.0, seed)
            trace(folder, file.split("_")[0], q, tau)
        elif file.startswith("rsi"):
            t, q, dq, tau = self.samples(folder, robot, 250.0, seed)
            table(path, {"IPOC": 4_208_163_634 + np.round(1000 * t), **named("AIPos.A{}", np.round(q * DEGREES, 4), 1), **named("GearTorque.A{}", tau, 1)})
        elif file.startswith("testsignals"):
            t, q, dq, tau = self.samples(folder, robot, 250.0, seed)
            table(path, {"t_s": t, **named("pos4000_{}", q * DEGREES, 1), **named("torque4002_{}", tau, 1)})
        elif file.startswith("motor_side"):
            t, q, dq, tau = self.samples(folder, robot, 250.0, seed)
            table(path, {"t_s": t, **named("resolver_angle_{}", q * ABB_GEARS, 1), **named("torque_ref_{}", tau / ABB_GEARS, 1)})
        elif file == "positions.csv":
            t, q, dq, tau = self.samples(folder, robot, 1000.0, seed)
            table(path, named("Joint_{}", (q - STAUBLI_ZERO) @ STAUBLI.T, 1))
            table(folder / "torques.csv", named("Joint_{}", tau @ np.linalg.inv(STAUBLI), 1))
        elif file.startswith("xarm"):
            weight = {"weight_kg": 3.0, "link": "link6"} if "weight" in file else {}
            t, q, dq, tau = self.samples(folder, robot, 200.0, seed, **weight)
            table(path, {"time_us": np.round(1e6 * t) + 5_000_000, **named("actual_q{}", q, 1), **named("actual_dq{}", dq, 1), **named("actual_current{}", tau / UR_GAINS, 1)})
        elif file.startswith("gen3"):
            t, q, dq, tau = self.samples(folder, robot, 500.0, seed)
            table(path, {"t_s": t, **named("position_deg_{}", q * DEGREES, 1), **named("velocity_deg_s_{}", dq * DEGREES, 1), **named("torque_{}", -tau, 1)})
        elif file == "so101_dataset":
            episodes = [self.samples(folder, robot, 50.0, number) for number in range(5)]
            lerobot(path, [(np.round(q * 4096 / 2 / np.pi) * 2 * np.pi / 4096, np.round(tau[:, :5] / 1.2 / 0.0065) * 0.0065) for _, q, _, tau in episodes], 50.0)
        elif file in ("run1", "run2"):
            t, q, dq, tau = self.samples(folder, robot, 200.0, seed)
            bag(path, self.robots[robot].joints, t, q, dq, tau)
        else:
            sys.exit(f"{file}: no recorder for this log; add one to docs/recordings.py")

    def test(self, text, folder):
        """Tests one study and returns its first validation (`result.json`)."""
        folder.mkdir(parents=True, exist_ok=True)
        study = folder / "study.toml"
        study.write_text(text, encoding="utf-8")
        robot = re.search(r'^file = "(.*\.urdf)"', text, re.MULTILINE).group(1)
        (folder / robot).write_text(self.robots[robot].text, encoding="utf-8")
        for file in dict.fromkeys(re.findall(r'^\[\[log\]\]\nfile = "(.*)"', text, re.MULTILINE)):
            self.write(folder, robot, file)
        self.run(0, "check", study)
        most = MOST_ERROR_SERVOS_PERCENT if "so101" in robot else MOST_ERROR_PERCENT
        self.run(0, "identify", study, "--out", folder / "result", "--max-validation-error", most)
        result = json.loads((folder / "result/result.json").read_text(encoding="utf-8"))
        return result["validation"][0]


def named(pattern, values, first):
    return {pattern.format(column + first): values[:, column] for column in range(values.shape[1])}


def table(path, columns, delimiter=","):
    with path.open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file, delimiter=delimiter)
        writer.writerow(columns)
        writer.writerows(zip(*(["%.12g" % value for value in column] for column in columns.values())))


def trace(folder, name, q, tau):
    """A trace of KUKA's KR C4: for each drive a DIAdem header and its numbers (golden/formats.py has the sources)."""
    rows = len(q)
    start = ["DIAEXTENDED", "#BEGINGLOBALHEADER", "  1,DOS", '102,rob "#KR6R900"', "111,9.9000000000E+34", "112,High -> Low", "#ENDGLOBALHEADER", ""]
    clock = {200: "Zeit", 201: "Zeitkanal", 202: "sec", 210: "IMPLIZIT", 220: rows, 240: "0.00000", 241: "0.00400000"}
    for drive in range(q.shape[1]):
        stem = f"{name}_NextGenDrive#{drive + 1}"
        (folder / f"{stem}.r64").write_bytes(np.stack([1e6 * DEGREES * q[:, drive], tau[:, drive]], axis=1).astype("<f8").tobytes())
        channels = [clock]
        for place, (channel, unit, factor) in enumerate([("Istposition", "\u00b0", "1.000000e-06"), ("Istmoment", "Nm", "1.000000e+00")]):
            channels.append({200: channel, 201: "AT_Drive", 202: unit, 210: "EXPLIZIT", 211: f"{stem}.r64", 213: "BLOCK", 214: "REAL64", 220: rows, 221: place + 1, 240: 0, 241: factor})
        lines = start + [line for channel in channels for line in ["#BEGINCHANNELHEADER", *(f"{key},{value}" for key, value in channel.items()), "#ENDCHANNELHEADER", ""]]
        (folder / f"{stem}.dat").write_bytes("\r\n".join(lines).encode("latin-1"))


def lerobot(folder, episodes, rate_hz):
    """A LeRobot data set of version 3 with positions in degrees, commands, and currents in A."""
    import pyarrow
    import pyarrow.parquet

    names = [f"{joint}.pos" for joint in [*SERVOS, "gripper"]]
    feature = {"dtype": "float32", "shape": [6], "names": names}
    scalar = {"shape": [1], "names": None}
    features = {
        "action": feature, "observation.state": feature, "observation.current": {"dtype": "float32", "shape": [5], "names": SERVOS}, "timestamp": scalar | {"dtype": "float32"},
        **{key: scalar | {"dtype": "int64"} for key in ["frame_index", "episode_index", "index", "task_index"]},
    }
    rows = {key: [] for key in features}
    for episode, (q, current) in enumerate(episodes):
        state = np.hstack([q[:, :5] * DEGREES, np.full((len(q), 1), 50.0)])
        for frame in range(len(q)):
            values = {"action": state[frame], "observation.state": state[frame], "observation.current": current[frame], "timestamp": frame / rate_hz, "frame_index": frame,
                      "episode_index": episode, "index": len(rows["index"]), "task_index": 0}
            for key, value in values.items():
                rows[key].append(value.astype(np.float32).tolist() if isinstance(value, np.ndarray) else value)
    kinds = {"action": pyarrow.list_(pyarrow.float32()), "observation.state": pyarrow.list_(pyarrow.float32()), "observation.current": pyarrow.list_(pyarrow.float32()), "timestamp": pyarrow.float32()}
    file = folder / "data/chunk-000/file-000.parquet"
    file.parent.mkdir(parents=True, exist_ok=True)
    (folder / "meta").mkdir(exist_ok=True)
    pyarrow.parquet.write_table(pyarrow.table({key: pyarrow.array(values, kinds.get(key, pyarrow.int64())) for key, values in rows.items()}), file)
    info = {"codebase_version": "v3.0", "robot_type": "so101_follower", "total_episodes": len(episodes), "total_frames": len(rows["index"]), "fps": int(rate_hz), "chunks_size": 1000,
            "data_path": "data/chunk-{chunk_index:03d}/file-{file_index:03d}.parquet", "features": features}
    (folder / "meta/info.json").write_text(json.dumps(info, indent=4) + "\n", encoding="utf-8")


def bag(folder, joints, t, q, dq, tau):
    """A rosbag2 recording in MCAP with joint states in alphabetical order."""
    from rosbags.rosbag2 import StoragePlugin, Writer
    from rosbags.typesys import Stores, get_typestore

    types = get_typestore(Stores.ROS2_JAZZY)
    state, header, stamp = (types.types[name] for name in ["sensor_msgs/msg/JointState", "std_msgs/msg/Header", "builtin_interfaces/msg/Time"])
    order = sorted(range(len(joints)), key=lambda joint: joints[joint])
    with Writer(folder, version=9, storage_plugin=StoragePlugin.MCAP) as writer:
        connection = writer.add_connection("/joint_states", state.__msgtype__, typestore=types)
        for row, time_s in enumerate(t):
            at = 1_700_000_000_000_000_000 + round(time_s * 1e9)
            message = state(header=header(stamp=stamp(sec=at // 10**9, nanosec=at % 10**9), frame_id=""), name=[joints[joint] for joint in order],
                            position=q[row, order], velocity=dq[row, order], effort=tau[row, order])
            writer.write(connection, at + 300_000 + (row * 7919) % 200_000, types.serialize_cdr(message, state.__msgtype__))


def main():
    dynident, scratch, *wanted = sys.argv[1:]
    recorder = Recorder(dynident)
    print("| page | study | held-out error, % | of the description, % |\n| --- | --- | --- | --- |")
    tested = 0
    for page in sorted((HERE / "src").glob("recordings-*.md")):
        studies = re.findall(r"^```toml,study\n(.*?)^```", page.read_text(encoding="utf-8"), re.MULTILINE | re.DOTALL)
        studies = [study for study in studies if "[[log]]" in study]
        assert studies, f"{page.name} has no study"
        if wanted and page.stem not in wanted:
            continue
        for number, study in enumerate(studies):
            held_out = recorder.test(study, pathlib.Path(scratch) / f"{page.stem}-{number + 1}")
            name = re.search(r'^name = "(.*)"', study).group(1)
            print(f"| {page.stem} | {name} | {held_out['physical']['relative_error_percent']:.2f} | {held_out['prior']['relative_error_percent']:.2f} |", flush=True)
            tested += 1
    assert tested, "no study was tested"


main()
