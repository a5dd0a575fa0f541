#!/usr/bin/env python3
"""view.py DYNIDENT CHROMIUM SCRATCH: checks the robots in three dimensions in a browser.

The page of each robot must place all bodies at 100 random postures as Pinocchio (URDF), MuJoCo (MJCF) or the product of the D-H matrices do, within 1e-6 m and
1e-6 of each entry of the rotation, replace the still picture, ask for no address, and write nothing to the console. Prints size and frames per second.

Pinocchio and MuJoCo are those of golden/requirements.txt.
"""

import json
import pathlib
import subprocess
import sys
import tempfile
import tomllib

import numpy as np
import pages

ROOT = pathlib.Path(__file__).resolve().parent.parent
URDF = ["golden/coupled/followers.urdf", "examples/robots/palletizer.urdf", "crates/dynident-benchmark/robots/tx40.urdf"]
MJCF = ["robosuite_panda", "robosuite_xarm7", "robosuite_kinova3", "robosuite_iiwa", "robosuite_ur5e", "robosuite_sawyer", "gymnasium_pusher"]
TABLES = ["examples/robots/paper_2r.toml"]
POSTURES = 100
LARGEST_ERROR = 1e-6
MAX_BYTES = 3_000_000

LIVE = """(async () => {
  const view = document.querySelector(".view");
  for (let k = 0; k < 200 && !view.posesAt; k++) await new Promise((done) => setTimeout(done, 20));
  return Boolean(view.posesAt) && getComputedStyle(view.querySelector(".still3d")).display === "none";
})()"""
BODIES = """(() => {
  const data = JSON.parse(document.querySelector("script[data-scene]").textContent);
  return { joints: data.joints, bodies: data.bodies.map(({ name, drivers }) => ({ name, drivers })) };
})()"""
RATE = """(async () => {
  const view = document.querySelector(".view");
  const start = performance.now();
  let frames = 0;
  while (performance.now() - start < 2000) { view.frames(); await new Promise(requestAnimationFrame); frames++; }
  return frames / 2;
})()"""


def urdf_poses(path, joints, postures):
    import pinocchio

    model = pinocchio.buildModelFromUrdf(str(path), mimic=True)
    data = model.createData()
    places = [model.joints[model.getJointId(joint)] for joint in joints]
    for posture in postures:
        q = pinocchio.neutral(model)
        for joint, value in zip(places, posture):
            q[joint.idx_q : joint.idx_q + joint.nq] = [value] if joint.nq == 1 else [np.cos(value), np.sin(value)]
        pinocchio.framesForwardKinematics(model, data, q)
        yield {frame.name: (data.oMf[k].rotation, data.oMf[k].translation) for k, frame in enumerate(model.frames) if frame.type == pinocchio.BODY}


def mjcf_poses(path, joints, postures):
    import mujoco

    model = mujoco.MjModel.from_xml_path(str(path))
    data = mujoco.MjData(model)
    for posture in postures:
        data.qpos[:] = model.qpos0
        for joint, value in zip(joints, posture):
            data.qpos[model.joint(joint).qposadr[0]] = value
        mujoco.mj_kinematics(model, data)
        found = {}
        for body in range(1, model.nbody):
            # The frame of a body with one joint is that of its joint.
            if model.body_jntnum[body] == 1:
                found[model.body(body).name] = (data.xmat[body].reshape(3, 3), data.xanchor[model.body_jntadr[body]])
        yield found


def table_poses(path, joints, postures):
    """Modified D-H convention: rotation alpha and shift a about x of the parent, then theta and d about z."""
    table = tomllib.loads(path.read_text(encoding="utf-8"))
    assert table["convention"] == "modified", table["convention"]
    for posture in postures:
        pose, found = np.eye(4), {}
        for row, value in zip(table["joint"], posture):
            alpha, a, d, theta = (row.get(key, 0.0) for key in ("alpha", "a_m", "d_m", "theta"))
            theta += value
            (ca, sa), (ct, st) = ((np.cos(x), np.sin(x)) for x in (alpha, theta))
            step = np.array([[ct, -st, 0, a], [st * ca, ct * ca, -sa, -d * sa], [st * sa, ct * sa, ca, d * ca], [0, 0, 0, 1]])
            pose = pose @ step
            found[row.get("link", row["name"])] = (pose[:3, :3], pose[:3, 3])
        yield found


def checked(browser, dynident, robot, oracle, folder):
    page = pathlib.Path(folder) / "view.html"
    subprocess.run([dynident, "view", robot, "--out", page, "--quiet"], check=True)
    browser.events.clear()
    browser.size(1400, 900)
    browser.call("Page.navigate", url=page.resolve().as_uri())
    browser.wait_for("Page.loadEventFired")
    if not browser.value(LIVE):
        return [f"{robot}: the still picture was not replaced"]
    known = browser.value(BODIES)
    random = np.random.default_rng(61)
    postures = random.uniform(-1.5, 1.5, (POSTURES, len(known["joints"])))
    seen = browser.value(f"{json.dumps(postures.tolist())}.map((q) => document.querySelector('.view').posesAt(q))")
    wrong, compared, largest = [], 0, 0.0
    for poses, expected in zip(seen, oracle(robot, known["joints"], postures)):
        for body, (rotation, origin) in zip(known["bodies"], poses):
            if body["name"] in expected and body["drivers"]:
                compared += 1
                differences = [np.subtract(rotation, expected[body["name"]][0]), np.subtract(origin, expected[body["name"]][1])]
                largest = max(largest, *(float(np.abs(difference).max()) for difference in differences))
    bytes_ = page.stat().st_size
    print(f"{robot.relative_to(ROOT)}: {compared} poses, largest difference {largest:.1e}, {bytes_ / 1e6:.2f} MB, {browser.value(RATE):.0f} frames/s")
    if compared < POSTURES or largest > LARGEST_ERROR:
        wrong.append(f"{robot}: {compared} poses differ by up to {largest}")
    if bytes_ > MAX_BYTES:
        wrong.append(f"{robot}: {bytes_} bytes")
    wrong += [f"{robot}: network: {event['params']['request']['url']}" for event in browser.events
              if event.get("method") == "Network.requestWillBeSent" and not event["params"]["request"]["url"].startswith(("file:", "data:"))]
    return wrong + [f"{robot}: console: {message}" for message in browser.console()]


def main():
    dynident, program, scratch = sys.argv[1:]
    robots = [(ROOT / path, urdf_poses) for path in URDF] + [(ROOT / f"golden/mjcf/{name}.xml", mjcf_poses) for name in MJCF]
    robots += [(ROOT / path, table_poses) for path in TABLES]
    wrong = []
    with tempfile.TemporaryDirectory(ignore_cleanup_errors=True, dir=scratch) as folder:
        browser = pages.Browser(program, folder)
        browser.call("Network.enable")
        for robot, oracle in robots:
            wrong += checked(browser, dynident, robot, oracle, folder)
        browser.close()
    for finding in wrong:
        print(finding)
    sys.exit(bool(wrong))


if __name__ == "__main__":
    main()
