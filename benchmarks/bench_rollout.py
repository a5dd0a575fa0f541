"""64 closed loops at once by MuJoCo's batched `rollout`, one thread: ns a step of one loop. The loop is that of bench_mujoco.c
(joint PD towards zero, gains 100 and 20 times the mass matrix' diagonal at zero, 1 ms, Euler, no contacts), its controller an
actuator of the model, since rollout calls none.

    bench_rollout.py ROBOT.urdf...           one JSON line per robot
"""
import statistics
import sys
import time
from pathlib import Path

import mujoco
import mujoco.rollout
import numpy as np
from common import figure

LOOPS, STEPS, REPEATS = 64, 500, 9


def with_controller(path):
    spec = mujoco.MjSpec.from_file(path)
    plain = spec.compile()
    for joint in range(plain.njnt):
        name = mujoco.mj_id2name(plain, mujoco.mjtObj.mjOBJ_JOINT, joint)
        inertia = plain.dof_M0[plain.jnt_dofadr[joint]]
        actuator = spec.add_actuator(name=f"pd_{name}", target=name, trntype=mujoco.mjtTrn.mjTRN_JOINT)
        actuator.set_to_position(kp=100 * inertia, kv=20 * inertia)
    model = spec.compile()
    model.opt.timestep = 1e-3
    model.opt.integrator = mujoco.mjtIntegrator.mjINT_EULER
    model.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_CONSTRAINT | mujoco.mjtDisableBit.mjDSBL_CONTACT
    # Limits of effort would hold the actuator back, and do not hold what bench_mujoco.c applies.
    model.jnt_actfrclimited[:] = 0
    model.dof_damping[:] = model.dof_frictionloss[:] = 0
    return model


for path in sys.argv[1:]:
    model = with_controller(path)
    data = mujoco.MjData(model)
    rng = np.random.default_rng(1)
    kind = mujoco.mjtState.mjSTATE_FULLPHYSICS
    start = np.empty((LOOPS, mujoco.mj_stateSize(model, kind)))
    for loop in start:
        mujoco.mj_resetData(model, data)
        data.qpos[:] = rng.uniform(-0.3, 0.3, model.nq)
        mujoco.mj_getState(model, data, loop, kind)
    ns = []
    # nthread=0: in this thread.
    with mujoco.rollout.Rollout(nthread=0) as roll:
        for repeat in range(REPEATS + 1):
            begin = time.thread_time_ns()
            states, _ = roll.rollout(model, data, start, nstep=STEPS)
            if repeat:
                ns.append((time.thread_time_ns() - begin) / (LOOPS * STEPS))
    # The last state is that of single steps with the torque applied, as in bench_mujoco.c.
    gains = [scale * model.dof_M0 for scale in (100, 20)]
    model.actuator_gainprm[:] = model.actuator_biasprm[:] = 0
    mujoco.mj_setState(model, data, start[0], kind)
    for _ in range(STEPS):
        data.qfrc_applied[:] = -gains[0] * data.qpos - gains[1] * data.qvel
        mujoco.mj_step(model, data)
    difference = abs(states[0, -1, 1 : 1 + model.nq] - data.qpos).max()
    assert difference < 1e-9, f"{path}: the actuator is another controller, by {difference} rad"
    figure("mujoco", "wheel", Path(path).stem, model.nv, "pd_step_euler_64_loops", ns)
