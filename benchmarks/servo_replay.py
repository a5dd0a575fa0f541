"""Replays servo arms in MuJoCo along recorded commands.

servo_replay.py MJCF RECORDINGS: simulates the MJCF (with position actuators, as `dynident identify examples/so101.toml` writes it) along the commands of
the twelve held-out motions of the study, from the first measured position and within the
study's `command_range`, and prints the root mean square error of each joint in mrad.
"""

import csv
import json
import pathlib
import sys
import tomllib

import mujoco
import numpy as np

ROOT = pathlib.Path(__file__).resolve().parent.parent
STUDY = tomllib.loads((ROOT / "examples" / "so101.toml").read_text())


def table(path, quantity):
    """Stamps in seconds and positions in rad."""
    own = STUDY["format"][quantity]
    with path.open(newline="") as source:
        rows = [(float(row["timestamp"]) * 1e-6, json.loads(row["positions"])) for row in csv.DictReader(source)]
    return np.array([row[0] for row in rows]), np.array([row[1] for row in rows]) * own["scale"] + own["offset"]


def replayed(model, folder):
    """Squared errors of each joint at the stamps of the measured positions."""
    command_times, commands = table(folder / "control.csv", "command")
    commands = np.clip(commands, *np.transpose(STUDY["drive"]["servo"]["command_range"]))
    times, measured = table(folder / "state_motor.csv", "position")
    data = mujoco.MjData(model)
    data.qpos[:6] = measured[0]
    errors = np.zeros_like(measured)
    for sample, time in enumerate(times):
        while data.time < time - times[0] - 0.5 * model.opt.timestep:
            data.ctrl[:] = commands[max(np.searchsorted(command_times, times[0] + data.time, side="right") - 1, 0)]
            mujoco.mj_step(model, data)
        errors[sample] = data.qpos[:6] - measured[sample]
    return errors**2


def main():
    model = mujoco.MjModel.from_xml_path(sys.argv[1])
    model.opt.timestep = 0.002
    model.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_CONTACT
    held_out = [log["file"] for log in STUDY["log"] if log.get("role") == "validate"]
    rows = [1e3 * np.sqrt(replayed(model, pathlib.Path(sys.argv[2]) / name).mean(0)) for name in held_out]
    for name, row in zip(held_out, rows):
        print(f"{name:24}", *(f"{value:6.1f}" for value in row))
    mean = np.mean(rows, axis=0)
    print(f"{'mean':24}", *(f"{value:6.1f}" for value in mean), f"  arm {mean[:5].mean():.1f}")


if __name__ == "__main__":
    main()
