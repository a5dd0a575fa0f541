#!/usr/bin/env python3
"""Exported files of 20 simulated arms: every form is written, and its error is the best that the form allows.

    forms_arms.py DYNIDENT SCRATCH [--seed 1]

Simulates a UR10, a Panda, an iiwa 14 (robots/), a SCARA and a tree of two branches with Pinocchio, each with four kinds of friction: viscous and Coulomb, Stribeck, friction under load, presliding
(Maxwell slip with two elements). 30 s at 250 Hz, five Fourier harmonics of 0.1 Hz, 1 % torque noise with a lag-1 correlation of 0.8, position noise of 2e-5 rad; the last 30 % are held out. Each case is
`dynident identify` with default settings, `dynident export` in every form, and `forms_referee.py` on its study. Exit status 1 if a form is not written or the referee fails. Needs the packages of the
referee.
"""
import argparse
import pathlib
import subprocess
import sys

import numpy as np
import pinocchio

from simulated_arms import correlated_noise, fourier, slip

HERE = pathlib.Path(__file__).resolve().parent
ROBOTS = HERE.parent / "robots"
FORMS = ["urdf", "sdf", "mjcf", "ros2-yaml", "json", "c", "cpp", "rust", "python", "matlab", "casadi", "jax", "pinocchio"]
TRUTHS = ["coulomb", "stribeck", "load", "slip"]
SAMPLES, DT, HARMONICS, BASE_HZ = 7500, 0.004, 5, 0.1


def body(name, mass, com, moments):
    inertia = " ".join(f'{key}="{value}"' for key, value in zip(("ixx", "iyy", "izz"), moments))
    return f'<link name="{name}"><inertial><origin xyz="{com}"/><mass value="{mass}"/><inertia {inertia} ixy="0" ixz="0" iyz="0"/></inertial></link>'


def joint(name, kind, parent, child, xyz, axis, reach):
    return (
        f'<joint name="{name}" type="{kind}"><parent link="{parent}"/><child link="{child}"/><origin xyz="{xyz}"/><axis xyz="{axis}"/>'
        f'<limit lower="{-reach}" upper="{reach}" velocity="3" effort="300"/></joint>'
    )


def scara():
    parts = [body("arm", 6, "0.2 0 0", (0.03, 0.1, 0.1)), body("forearm", 4, "0.15 0 0", (0.02, 0.06, 0.06)), body("quill", 1.5, "0.01 0 0.1", (0.01, 0.01, 0.002)), body("flange", 0.8, "0.02 0.01 0", (0.002, 0.003, 0.004))]
    links = [("base", "arm", "revolute", "0 0 0.3", "0 0 1", 2.0), ("arm", "forearm", "revolute", "0.4 0 0", "0 0 1", 2.0), ("forearm", "quill", "prismatic", "0.3 0 0", "0 0 -1", 0.15), ("quill", "flange", "revolute", "0 0 0", "0 0 -1", 3.0)]
    return parts, links


def tree():
    parts, links = [body("trunk", 12, "0.02 0 0.2", (0.4, 0.4, 0.2))], [("base", "trunk", "revolute", "0 0 0.1", "0 0 1", 2.0)]
    for side, y in (("left", 0.25), ("right", -0.25)):
        parts += [body(f"{side}_upper", 3, "0.15 0 0.01", (0.01, 0.04, 0.04)), body(f"{side}_lower", 2, "0.1 0.02 0", (0.006, 0.02, 0.02))]
        links += [("trunk", f"{side}_upper", "revolute", f"0 {y} 0.4", "0 1 0", 1.5), (f"{side}_upper", f"{side}_lower", "revolute", "0.3 0 0", "0 1 0", 1.8)]
    return parts, links


def written(scratch, name, parts, links):
    joints = [joint(f"joint_{k + 1}", kind, parent, child, xyz, axis, reach) for k, (parent, child, kind, xyz, axis, reach) in enumerate(links)]
    path = scratch / f"{name}.urdf"
    path.write_text(f'<robot name="{name}"><link name="base"/>' + "".join(parts + joints) + "</robot>\n")
    return path


def simulated(model, truth, random):
    """Time, positions and torques."""
    data, t = model.createData(), np.arange(SAMPLES) * DT
    low, high = np.maximum(model.lowerPositionLimit, -2.5), np.minimum(model.upperPositionLimit, 2.5)
    q, v, acc = fourier(t, (low + high) / 2, 0.9 * (high - low) / 2, HARMONICS, BASE_HZ, random)
    rigid = np.array([pinocchio.rnea(model, data, *row) for row in zip(q, v, acc)])
    size = np.sqrt((rigid**2).mean(axis=0)) + 0.5
    step, viscous = np.tanh(v / 0.005), 0.1 * size * v
    friction = {
        "coulomb": lambda: 0.15 * size * step,
        "stribeck": lambda: 0.12 * size * step * (1 + 0.6 * np.exp(-np.abs(v) / 0.1)),
        "load": lambda: (0.1 * size + 0.08 * np.abs(rigid)) * step,
        "slip": lambda: 0.15 * size * slip(q, (0.005, 0.05)),
    }[truth]()
    error = correlated_noise(q.shape, random)
    return np.column_stack([t, q + 2e-5 * random.normal(size=q.shape), rigid + viscous + friction + 0.01 * size * error])


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("dynident")
    parser.add_argument("scratch", type=pathlib.Path)
    parser.add_argument("--seed", type=int, default=1)
    options = parser.parse_args()
    options.scratch.mkdir(parents=True, exist_ok=True)
    arms = {name: ROBOTS / f"{name}.urdf" for name in ("ur10", "panda_arm7", "iiwa14")}
    arms |= {name: written(options.scratch, name, *parts) for name, parts in (("scara", scara()), ("tree", tree()))}
    random, studies, missing = np.random.default_rng(options.seed), [], 0
    for name, robot in arms.items():
        model = pinocchio.buildModelFromUrdf(str(robot))
        for truth in TRUTHS:
            table, case = simulated(model, truth, random), f"{name}_{truth}"
            columns = f"{{1..{model.nv}}}"
            head = ",".join(["t"] + [f"{key}{k + 1}" for key in ("q", "tau") for k in range(model.nv)])
            np.savetxt(options.scratch / f"{case}.csv", table, delimiter=",", header=head, comments="", fmt="%.10g")
            log = f'[[log]]\nfile = "{case}.csv"\n'
            study = options.scratch / f"{case}.toml"
            study.write_text(
                f'[robot]\nfile = "{robot}"\n[format]\ntime = {{ column = "t" }}\nposition = {{ columns = "q{columns}" }}\ntorque = {{ columns = "tau{columns}" }}\n'
                f'{log}fraction = [0.0, 0.67]\n{log}fraction = [0.7, 1.0]\nrole = "validate"\n'
            )
            studies.append(study)
            result = options.scratch / f"{case}_result"
            subprocess.run([options.dynident, "identify", study, "--out", result, "--quiet"], capture_output=True)
            for form in FORMS:
                done = subprocess.run([options.dynident, "export", result, "--to", form, "--out", options.scratch / f"{case}.{form}", "--quiet"], capture_output=True, text=True)
                if done.returncode:
                    missing += 1
                    print(f"{case}: no {form}: {done.stderr.strip()}", flush=True)
    print(f"{len(studies)} arms, {len(FORMS)} forms each, {missing} not written", flush=True)
    referee = subprocess.run([sys.executable, HERE / "forms_referee.py", options.dynident, options.scratch / "referee", *studies])
    sys.exit(missing > 0 or referee.returncode)


if __name__ == "__main__":
    main()
