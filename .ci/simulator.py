#!/usr/bin/env python3
"""simulator.py DYNIDENT RESULT STUDY FOLDER SCRATCH: compares the output of `dynident export --to simulator` with the true values of a simulated robot.

FOLDER contains train.csv and truth.json of the study. Damping and frictionloss are fitted independently to the true and the identified friction law, with numpy's least squares over
the velocities of train.csv. Needs numpy, scipy, jsonschema."""
import json
import math
import pathlib
import subprocess
import sys
import xml.etree.ElementTree as ElementTree

import jsonschema
import numpy as np
from scipy.signal import butter, sosfiltfilt

# The error bars are 95 % intervals of about twenty correlated values; an error above twice the bar (four standard deviations) means a wrong error bar.
BARS = 2.0
# The export groups velocities in bins of 1/64 to 1/128 of the largest velocity, and the filter here is different: the centre of a bin is off by at most 1/128.
BINS = 0.02


def nearest(velocity, torque):
    """Fits c sign(dq) + d dq without limits; returns c, d and the rms residual. No value may be at its limit in these examples."""
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
    form = next(form for form in json.loads(pathlib.Path(result).read_text())["forms"] if "mjcf" in form["forms"])
    fitted = {term["symbol"]: term["value"] for term in form["terms"]}
    log = np.genfromtxt(folder / "train.csv", delimiter=",", names=True)
    rate = 1 / np.median(np.diff(log["t_s"]))
    low_pass = butter(4, 10, fs=rate, output="sos")

    compared = 0
    for number, joint in enumerate(written["joints"], 1):
        dq = np.gradient(sosfiltfilt(low_pass, log[f"q{number}_rad"]), 1 / rate)
        # The export also omits velocities near zero.
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
                assert "identifiable only in the sum" in value["note"], value
                continue
            print(f"  {value['value']:.4f} ± {value['half_width_95']:.4f} {value['unit']}, in truth {expected:.4f}")
            assert abs(value["value"] - expected) < BARS * value["half_width_95"]
            compared += 1
        # The simulated torque has no delay.
        assert abs(joint["delay"]["value"]) < BARS * joint["delay"]["half_width_95"]
        assert joint["actuator_gain"]["value"] == 1 and "known payload" in joint["actuator_gain"]["note"]
        # The MJCF has the values that were fitted for it; those above approximate the identified law.
        own = of_mjcf[joint["name"]]
        for attribute, symbol in [("armature", "Ia"), ("damping", "fv"), ("frictionloss", "fc")]:
            # The export solves for them once more.
            assert math.isclose(float(own.get(attribute)), fitted[f"{symbol}{number}"], rel_tol=1e-9), attribute
        assert f"| {joint['name']} |" in table
    assert compared >= 14, compared


if __name__ == "__main__":
    main()
