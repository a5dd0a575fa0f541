#!/usr/bin/env python3
"""simulator.py DYNIDENT RESULT STUDY FOLDER SCRATCH: what `dynident export --to simulator` says of a simulated robot, against the truth that the robot was simulated with.

FOLDER holds train.csv and truth.json of the study. The nearest damping and frictionloss of the true law and of the identified one are made here again, by numpy's least squares over
the velocities of train.csv. Needs numpy, scipy, jsonschema."""
import json
import pathlib
import subprocess
import sys
import xml.etree.ElementTree as ElementTree

import jsonschema
import numpy as np
from scipy.signal import butter, sosfiltfilt

# Bars are 95 % intervals of some twenty values that are not independent: a value beyond twice its bar (four standard deviations) is a wrong bar.
BARS = 2.0
# Velocities stand in bins of 1/64 to 1/128 of the largest one and are differentiated by another filter here: a middle of a bin is off by 1/128 at most.
BINS = 0.02


def nearest(velocity, torque):
    """c, d of c sign(dq) + d dq, and what is left, rms. Neither is at its limit here, or the file says another number."""
    regressor = np.stack([np.sign(velocity), velocity], axis=1)
    found = np.linalg.lstsq(regressor, torque, rcond=None)[0]
    return *found, np.sqrt(np.mean((torque - regressor @ found) ** 2))


def main():
    dynident, result, study, folder, scratch = sys.argv[1:]
    folder, scratch = pathlib.Path(folder), pathlib.Path(scratch)
    scratch.mkdir(exist_ok=True)
    export = [dynident, "export", result, "--study", study, "--quiet", "--to"]
    written = json.loads(subprocess.run([*export, "simulator"], check=True, capture_output=True, text=True).stdout)
    jsonschema.Draft7Validator(json.loads(pathlib.Path("docs/schemas/simulator.json").read_text())).validate(written)
    table = subprocess.run([*export, "simulator-table"], check=True, capture_output=True, text=True).stdout
    mjcf = ElementTree.fromstring(subprocess.run([*export, "mjcf"], check=True, capture_output=True, text=True).stdout)
    of_mjcf = {joint.get("name"): joint for joint in mjcf.iter("joint")}

    truth = json.loads((folder / "truth.json").read_text())
    true = {parameter["symbol"]: parameter["value"] for parameter in truth["parameters"]}
    width = truth["coulomb"]["width_rad_s"]
    identified = {term["symbol"]: term["value"] for joint in json.loads(pathlib.Path(result).read_text())["joints"] for term in joint["laws"]}
    log = np.genfromtxt(folder / "train.csv", delimiter=",", names=True)
    rate = 1 / np.median(np.diff(log["t_s"]))
    low_pass = butter(4, 10, fs=rate, output="sos")

    compared = 0
    for number, joint in enumerate(written["joints"], 1):
        dq = np.gradient(sosfiltfilt(low_pass, log[f"q{number}_rad"]), 1 / rate)
        # As the file leaves out what is beside rest.
        dq = dq[np.abs(dq) > np.abs(dq).max() / 64]
        law = lambda of, shape: of[f"fc{number}"] * shape + of[f"fv{number}"] * dq + of[f"off{number}"]
        coulomb, viscous, left = nearest(dq, law(identified, np.sign(dq)))
        found = [joint["frictionloss"]["value"], joint["damping"]["value"], joint["friction_error"]["rms_nm"]]
        scale = coulomb + viscous * np.abs(dq).max()
        print(f"{joint['name']}: frictionloss, damping, rest of the identified law {found}, by numpy {coulomb:.4f} {viscous:.4f} {left:.4f}")
        assert abs(found[0] - coulomb) < BINS * scale and abs(found[1] - viscous) * np.abs(dq).max() < BINS * scale
        assert abs(found[2] - left) < BINS * scale
        assert joint["friction_error"]["over"] == "recorded-motion"

        coulomb, viscous, _ = nearest(dq, law(true, np.tanh(dq / width)))
        for value, expected in [(joint["frictionloss"], coulomb), (joint["damping"], viscous), (joint["armature"], true[f"Ia{number}"])]:
            if value["half_width_95"] is None:
                assert "told only in the sum" in value["note"], value
                continue
            print(f"  {value['value']:.4f} ± {value['half_width_95']:.4f} {value['unit']}, in truth {expected:.4f}")
            assert abs(value["value"] - expected) < BARS * value["half_width_95"]
            compared += 1
        # The simulated torque comes with the motion.
        assert abs(joint["delay"]["value"]) < BARS * joint["delay"]["half_width_95"]
        assert joint["actuator_gain"]["value"] == 1 and "known payload" in joint["actuator_gain"]["note"]
        own = of_mjcf[joint["name"]]
        for attribute in ["armature", "damping", "frictionloss"]:
            assert float(own.get(attribute)) == joint[attribute]["value"], attribute
        assert f"| {joint['name']} |" in table
    assert compared >= 14, compared


if __name__ == "__main__":
    main()
