"""MuJoCo's integrators under joint PD: 10 s of the Panda arm with a zero-order hold of 1 ms.

    python golden/mujoco_closed_loop.py [ROBOTS] [--out DIR]

The torque `kp (q_d - q) + kd (dq_d - dq)` is written to `qfrc_applied` before every `mj_step`; the reference is
`centre + amplitude sin(omega t + phase)` for each joint. Runs: `euler` and `rk4` without damping, and `euler_damped` with the
viscous friction of `damping`, which MuJoCo's Euler integrator evaluates at the end of the step. Writes DIR/mujoco_closed_loop.json.
"""
import argparse
import sys
from pathlib import Path

HERE = Path(__file__).resolve().parent
import mujoco  # noqa: E402
import numpy as np  # noqa: E402

sys.path.insert(0, str(HERE))
from mujoco_inverse import load  # noqa: E402
from write_json import write  # noqa: E402

RATE_HZ = 1000
SAMPLES = 10 * RATE_HZ
KEEP = 250
KP = np.array([300.0, 300.0, 200.0, 200.0, 60.0, 60.0, 10.0])
KD = np.array([30.0, 30.0, 20.0, 20.0, 4.0, 4.0, 0.5])
CENTRE = np.array([0.1, 0.3, -0.2, -1.6, 0.2, 1.7, 0.4])
AMPLITUDE = np.array([0.6, 0.4, 0.7, 0.5, 0.8, 0.6, 1.0])
OMEGA = np.array([0.9, 1.1, 1.3, 1.6, 1.9, 2.3, 2.7])
PHASE = np.array([0.0, 0.5, 1.0, 1.5, 2.0, 2.5, 3.0])
DAMPING = np.array([2.0, 2.0, 1.5, 1.5, 0.8, 0.8, 0.4])
RUNS = {
    "euler": (mujoco.mjtIntegrator.mjINT_EULER, np.zeros(7)),
    "euler_damped": (mujoco.mjtIntegrator.mjINT_EULER, DAMPING),
    "rk4": (mujoco.mjtIntegrator.mjINT_RK4, np.zeros(7)),
}


def reference(t):
    angle = OMEGA * t + PHASE
    return CENTRE + AMPLITUDE * np.sin(angle), AMPLITUDE * OMEGA * np.cos(angle)


def run(model, integrator, damping):
    model.opt.integrator, model.opt.timestep = integrator, 1 / RATE_HZ
    model.dof_damping[:] = damping
    data = mujoco.MjData(model)
    data.qpos[:], data.qvel[:] = reference(0.0)
    kept, worst = {"q": [], "dq": []}, 0.0
    for k in range(SAMPLES + 1):
        q_d, dq_d = reference(k / RATE_HZ)
        worst = max(worst, float(np.max(np.abs(q_d - data.qpos))))
        if k % KEEP == 0:
            kept["q"].append(data.qpos.copy())
            kept["dq"].append(data.qvel.copy())
        data.qfrc_applied[:] = KP * (q_d - data.qpos) + KD * (dq_d - data.qvel)
        mujoco.mj_step(model, data)
    return kept, worst


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("robots", nargs="?", type=Path, default=HERE.parent / "robots", help="folder of URDF files")
    parser.add_argument("--out", type=Path, default=HERE, help="output folder for mujoco_closed_loop.json")
    options = parser.parse_args()
    model = load(options.robots / "panda_arm7.urdf")
    model.opt.gravity[:] = [0, 0, -9.81]
    runs = {}
    for name, (integrator, damping) in RUNS.items():
        runs[name], worst = run(model, integrator, damping)
        print(f"{name}: largest tracking error {worst:.3f} rad")
    write(options.out / "mujoco_closed_loop.json", {
        "schema": "dynident/golden-mujoco-closed-loop/1",
        "made_by": {"script": "golden/mujoco_closed_loop.py", "mujoco": mujoco.__version__, "numpy": np.__version__},
        "robot": "panda_arm7",
        "joints": [mujoco.mj_id2name(model, mujoco.mjtObj.mjOBJ_JOINT, j) for j in range(model.njnt)],
        "rate_hz": RATE_HZ, "samples": SAMPLES, "every": KEEP, "gravity_mps2": model.opt.gravity,
        "kp": KP, "kd": KD, "centre": CENTRE, "amplitude": AMPLITUDE, "omega": OMEGA, "phase": PHASE, "damping": DAMPING,
        "runs": runs,
    })


if __name__ == "__main__":
    main()
