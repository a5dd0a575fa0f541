"""Copies published MJCF models from their packages to golden/mjcf.

    pip install --no-deps robosuite==1.5.2 dm-control==1.0.50 gymnasium==1.4.0 gymnasium-robotics==1.4.2
    python golden/mjcf_models.py [--out DIR]

Models without meshes are copied byte by byte, with included files. For the others, meshes, sites, cameras, lights, sensors
and textures are removed. The copy is written only if MuJoCo gives the same mass matrix and inverse dynamics as for the
original (1e-12 of the largest entry).
"""
import argparse
import importlib.metadata
import shutil
import xml.etree.ElementTree as ElementTree
from pathlib import Path

import mujoco
import numpy as np

HERE = Path(__file__).resolve().parent
SAME = 1e-12
ROBOSUITE = ["baxter", "iiwa", "jaco", "kinova3", "panda", "sawyer", "spot_arm", "tiago", "ur5e", "xarm7"]
CONTROL = ["acrobot", "cartpole", "cheetah", "finger", "hopper", "manipulator", "reacher", "swimmer", "walker"]
GYMNASIUM = ["half_cheetah", "inverted_double_pendulum", "pusher", "walker2d"]
DROPPED = {"site", "camera", "light", "asset", "sensor", "contact", "keyframe", "visual", "statistic", "size", "tendon"}


def package(name):
    return Path(importlib.metadata.distribution(name).locate_file(""))


def plain(element):
    """Removes parts that need other files from the element; returns it with the names of the removed tendons."""
    for child in list(element):
        is_mesh = child.tag == "geom" and (child.get("type") == "mesh" or child.get("mesh"))
        if child.tag in DROPPED or is_mesh:
            element.remove(child)
            continue
        for key in ("material", "hfield", "texture"):
            child.attrib.pop(key, None)
        plain(child)
    for actuator in element.findall("actuator"):
        for child in list(actuator):
            if child.get("joint") is None:
                actuator.remove(child)


def expanded(path):
    """The document with its included files inserted."""
    root = ElementTree.parse(path).getroot()

    def fill(element):
        for index, child in reversed(list(enumerate(element))):
            if child.tag == "include":
                element[index:index + 1] = list(expanded_part(path.parent / child.get("file")))
            else:
                fill(child)

    def expanded_part(part):
        part = ElementTree.parse(part).getroot()
        fill(part)
        return part

    fill(root)
    return root


def torques(model):
    """Mass matrix and inverse dynamics at several states."""
    data, random = mujoco.MjData(model), np.random.default_rng(3)
    model.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_CONSTRAINT
    found = []
    for _ in range(3):
        data.qpos[:], data.qvel[:], data.qacc[:] = (random.uniform(-1, 1, model.nv) for _ in range(3))
        mujoco.mj_inverse(model, data)
        found.append(data.qfrc_inverse.copy())
    return np.array(found)


def stripped(source, target, drop_bodies=()):
    root = expanded(source)
    for parent in list(root.iter()):
        for child in list(parent):
            if child.tag == "body" and child.get("name") in drop_bodies:
                parent.remove(child)
    plain(root)
    ElementTree.indent(root)
    target.write_text(ElementTree.tostring(root, encoding="unicode") + "\n", encoding="utf-8", newline="\n")
    original, copy = (mujoco.MjModel.from_xml_path(str(path)) for path in (source, target))
    a, b = torques(original), torques(copy)
    if a.shape != b.shape or not np.max(np.abs(a - b)) <= SAME * np.max(np.abs(a)):
        target.unlink()
        raise SystemExit(f"{source.name}: the dynamics of the copy differ, {a.shape} {b.shape} {np.max(np.abs(a - b)) if a.shape == b.shape else ''}")


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--out", type=Path, default=HERE / "mjcf", help="output folder for the models")
    out = parser.parse_args().out
    out.mkdir(parents=True, exist_ok=True)
    for robot in ROBOSUITE:
        stripped(package("robosuite") / "robosuite/models/assets/robots" / robot / "robot.xml", out / f"robosuite_{robot}.xml")
    suite = package("dm-control") / "dm_control/suite"
    for name in CONTROL:
        shutil.copyfile(suite / f"{name}.xml", out / f"dm_control_{name}.xml")
    (out / "common").mkdir(exist_ok=True)
    for part in ("materials.xml", "skybox.xml", "visual.xml"):
        shutil.copyfile(suite / "common" / part, out / "common" / part)
    for name in GYMNASIUM:
        shutil.copyfile(package("gymnasium") / "gymnasium/envs/mujoco/assets" / f"{name}.xml", out / f"gymnasium_{name}.xml")
    robotics = package("gymnasium-robotics") / "gymnasium_robotics/envs/assets"
    stripped(robotics / "hand/reach.xml", out / "shadow_hand.xml")
    stripped(robotics / "fetch/reach.xml", out / "fetch.xml")


if __name__ == "__main__":
    main()
