"""first_minutes.py DYNIDENT SCRATCH: runs new, check, identify and export from a robot description and rosbag2 recordings only.

Writes the simulated recordings of README as bags with the independent package rosbags: joints in alphabetical order, as in ros2_control, time stamps different from those of the recorder,
and a second topic. The model must agree with that of the same samples in CSV, and the exported C must compile.
"""
import csv
import json
import os
import pathlib
import subprocess
import sys

import numpy as np
from rosbags.rosbag2 import StoragePlugin, Writer
from rosbags.typesys import Stores, get_typestore

ROBOT = "robots/ur10.urdf"
CSV_STUDY = "examples/ur10_simulated.toml"
JOINTS = ["shoulder_pan_joint", "shoulder_lift_joint", "elbow_joint", "wrist_1_joint", "wrist_2_joint", "wrist_3_joint"]
# Stamps are integer nanoseconds; the rounding is negligible compared with the error bars.
SAME_STD = 1e-3


def bag(table, folder, storage):
    types = get_typestore(Stores.ROS2_JAZZY)
    state, header, stamp, temperature = (types.types[name] for name in ["sensor_msgs/msg/JointState", "std_msgs/msg/Header", "builtin_interfaces/msg/Time", "std_msgs/msg/Float64"])
    order = sorted(range(len(JOINTS)), key=lambda joint: JOINTS[joint])
    start = 1_700_000_000_123_456_789
    with Writer(folder, version=9, storage_plugin=storage) as writer:
        states = writer.add_connection("/joint_states", state.__msgtype__, typestore=types)
        other = writer.add_connection("/motor_temperature", temperature.__msgtype__, typestore=types)
        for number, row in enumerate(csv.DictReader(table.open())):
            at = start + round(float(row["t_s"]) * 1e9)
            values = lambda name: np.array([float(row[name.format(joint + 1)]) for joint in order])
            message = state(
                header=header(stamp=stamp(sec=at // 10**9, nanosec=at % 10**9), frame_id=""),
                name=[JOINTS[joint] for joint in order],
                position=values("q{}_rad"),
                velocity=np.array([]),
                effort=values("tau{}_Nm"),
            )
            # Recorded some time after the measurement.
            recorded = at + 400_000 + (number * 7919) % 300_000
            writer.write(states, recorded, types.serialize_cdr(message, state.__msgtype__))
            if number % 100 == 0:
                writer.write(other, recorded, types.serialize_cdr(temperature(data=40.0), temperature.__msgtype__))


def called(*command, path=None):
    environment = os.environ | ({"PATH": path} if path else {})
    ended = subprocess.run([str(part) for part in command], capture_output=True, text=True, env=environment)
    assert ended.returncode == 0, f"{command}\n{ended.stdout}{ended.stderr}"
    return ended.stdout


def with_macros(dynident, scratch):
    """Writes the robot as xacro; the program `xacro` is in the folder of the Python interpreter."""
    macros = scratch / "arm.urdf.xacro"
    text = pathlib.Path(ROBOT).read_text()
    begin = text.index("<robot")
    end = text.index(">", begin)
    head = text[begin:end] + ' xmlns:xacro="http://www.ros.org/wiki/xacro"><xacro:property name="lift" value="shoulder_lift"/>'
    macros.write_text(text[:begin] + head + text[end + 1 :].replace("shoulder_lift_joint", "${lift}_joint"))
    assert "${lift}_joint" in macros.read_text()
    path = f"{pathlib.Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}"
    seen = [json.loads(called(dynident, "inspect", robot, "--json", "--allow-command", path=path)) for robot in (ROBOT, macros)]
    # xacro runs Python code from the file; without permission it must not start.
    refused = subprocess.run([str(dynident), "inspect", str(macros)], capture_output=True, text=True)
    assert refused.returncode == 2 and "--allow-command" in refused.stderr, refused.stderr
    for key in ["joints", "bodies", "base_parameters", "moving_mass_kg"]:
        assert seen[0][key] == seen[1][key], key


def parameters(result):
    """Estimates and standard deviations of the common base parameters, by name."""
    found = json.loads((result / "result.json").read_text())["base_parameters"]
    return {entry["symbol"]: (entry["value"], entry["std"]) for entry in found if entry["std"]}


def main(dynident, scratch):
    scratch = pathlib.Path(scratch)
    scratch.mkdir()
    data = pathlib.Path("examples/ur10_simulated")
    bag(data / "train.csv", scratch / "train", StoragePlugin.SQLITE3)
    bag(data / "test.csv", scratch / "test", StoragePlugin.MCAP)

    study = scratch / "study.toml"
    called(dynident, "new", "--robot", ROBOT, "--log", scratch / "train", scratch / "test", "--out", study)
    called(dynident, "check", study)
    called(dynident, "identify", study, "--out", scratch / "result")
    called(dynident, "export", scratch / "result/result.json", "--study", study, "--to", "c", "--out", scratch / "arm.h")
    (scratch / "arm.c").write_text('#include "arm.h"\n')
    called("cc", "-std=c99", "-Wall", "-Wextra", "-Werror", "-O2", "-c", scratch / "arm.c", "-o", scratch / "arm.o")

    # The same samples as CSV, with the hand-written study.
    by_hand = pathlib.Path(CSV_STUDY).read_text()
    by_hand = by_hand.replace('"../robots', f'"{pathlib.Path("robots").resolve()}').replace('"ur10_simulated/', f'"{data.resolve()}/')
    (scratch / "csv.toml").write_text(by_hand)
    called(dynident, "identify", scratch / "csv.toml", "--out", scratch / "csv")
    bagged, plain = parameters(scratch / "result"), parameters(scratch / "csv")
    assert bagged.keys() == plain.keys(), bagged.keys() ^ plain.keys()
    far = max(abs(bagged[name][0] - value) / std for name, (value, std) in plain.items())
    assert far < SAME_STD, f"{far} standard deviations from the model of the CSV"
    with_macros(dynident, scratch)
    print(f"{len(plain)} parameters, at most {far:.1e} standard deviations from those of the CSV")


if __name__ == "__main__":
    main(*sys.argv[1:])
