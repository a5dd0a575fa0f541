"""Joint springs and a cable in MuJoCo: reference for Dynident's declared torques.

    python golden/springs.py [--out DIR]

Writes DIR/springs.json: the MJCF of an arm of two links with a spring in its second joint (`stiffness`, `springref`)
and a cable from the base to the first link that pulls when stretched beyond its length (a spatial tendon with `stiffness` and
`springlength`), and `mj_inverse` at random states.
"""
import argparse
import sys
from pathlib import Path

import mujoco
import numpy as np

HERE = Path(__file__).resolve().parent
sys.path.insert(0, str(HERE))
from write_json import write  # noqa: E402

STATES = 40
SEED = 20261124
MODEL = """<mujoco model="springs">
  <compiler angle="radian"/>
  <option><flag constraint="disable"/></option>
  <worldbody>
    <site name="anchor" pos="0.1 0 0.3"/>
    <body name="upper">
      <inertial pos="0.2 0.01 0" mass="3" diaginertia="0.01 0.05 0.05"/>
      <joint name="shoulder" axis="0 1 0" range="-2.5 2.5"/>
      <site name="clamp" pos="0.25 0 0"/>
      <body name="lower" pos="0.4 0 0">
        <inertial pos="0.15 0 0.02" mass="2" diaginertia="0.01 0.03 0.03"/>
        <joint name="elbow" axis="0 1 0" range="-2.5 2.5" stiffness="40" springref="0.35"/>
      </body>
    </body>
  </worldbody>
  <tendon>
    <spatial name="cable" stiffness="900" springlength="0 0.3">
      <site site="anchor"/>
      <site site="clamp"/>
    </spatial>
  </tendon>
</mujoco>
"""


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--out", type=Path, default=HERE, help="output folder for springs.json")
    options = parser.parse_args()
    random = np.random.default_rng(SEED)
    model = mujoco.MjModel.from_xml_string(MODEL)
    data = mujoco.MjData(model)
    states = []
    for _ in range(STATES):
        data.qpos[:] = random.uniform(-2.5, 2.5, 2)
        data.qvel[:], data.qacc[:] = random.uniform(-2, 2, 2), random.uniform(-5, 5, 2)
        mujoco.mj_inverse(model, data)
        states.append({"q": data.qpos.copy(), "dq": data.qvel.copy(), "ddq": data.qacc.copy(),
                       "tau": data.qfrc_inverse.copy(), "cable_m": float(data.ten_length[0])})
    write(options.out / "springs.json", {
        "schema": "dynident/golden-springs/1",
        "made_by": {"script": "golden/springs.py", "mujoco": mujoco.__version__, "numpy": np.__version__, "seed": SEED},
        "mjcf": MODEL,
        "states": states,
    })


if __name__ == "__main__":
    main()
