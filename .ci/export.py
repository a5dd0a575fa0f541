"""export.py DYNIDENT RESULT STUDY SCRATCH: what `dynident export` writes, read by those it is written for.

The Python module against the compiled C header at 1,000 states (the C header is compared with the core in the tests); MuJoCo's inverse dynamics of the MJCF and Pinocchio's of the URDF
against the same model. Prints the time of the C inverse dynamics beside pin.rnea, alternating; no check depends on it. Needs cc, numpy, mujoco and pin (golden/requirements.txt).
"""
import ctypes
import importlib.util
import json
import pathlib
import subprocess
import sys
import time

import mujoco
import numpy as np
import pinocchio

STATES = 1000
# Rounding of some thousand operations, as in the tests.
SAME_CODE = 1e-12
# Other algorithms on numbers that went through a file, where inertia stands about the centre of mass.
SAME_PHYSICS = 1e-9
FUNCTIONS = {
    "inverse_dynamics": ["q", "dq", "ddq"],
    "gravity": ["q"],
    "coriolis": ["q", "dq"],
    "friction": ["dq"],
    "mass_matrix": ["q"],
    "forward_dynamics": ["q", "dq", "tau"],
}


def exported(dynident, result, study, form, path):
    told = subprocess.run([dynident, "export", result, "--study", study, "--to", form, "--out", path, "--json"], check=True, capture_output=True, text=True)
    assert json.loads(told.stdout)["file"] == str(path), told.stdout
    return path


def compiled(header, prefix, dof, folder):
    """The C functions as Python functions of contiguous vectors."""
    calls = []
    for name, inputs in FUNCTIONS.items():
        arguments = ", ".join(f"const double *{vector}" for vector in inputs)
        calls.append(f"void call_{name}({arguments}, double *out) {{ {prefix}_{name}({', '.join(inputs)}, out); }}")
    # By a pointer that the compiler cannot see through: what does not change would be taken out of the loop.
    calls.append(
        "static void (*volatile called)(const double *, const double *, const double *, double *) = call_inverse_dynamics;\n"
        "void repeat(long n, const double *q, const double *dq, double *ddq, double *out) {"
        " for (long k = 0; k < n; k++) { called(q, dq, ddq, out); ddq[0] += 1e-30 * out[0]; } }"
    )
    (folder / "calls.c").write_text(f'#include "{header.name}"\n' + "\n".join(calls) + "\n")
    library = folder / "calls.so"
    flags = ["-std=c99", "-Wall", "-Wextra", "-Werror", "-O2", "-shared", "-fPIC"]
    subprocess.run(["cc", *flags, str(folder / "calls.c"), "-o", str(library), "-lm"], check=True)
    loaded = ctypes.CDLL(str(library))
    pointer = lambda vector: vector.ctypes.data_as(ctypes.c_void_p)

    def function(name):
        length = dof * dof if name == "mass_matrix" else dof

        def call(*vectors):
            out = np.empty(length)
            getattr(loaded, f"call_{name}")(*(pointer(vector) for vector in vectors), pointer(out))
            return out.reshape(dof, dof) if name == "mass_matrix" else out

        return call

    def repeat(count, *vectors):
        out = np.empty(dof)
        loaded.repeat(ctypes.c_long(count), *(pointer(vector) for vector in vectors), pointer(out))

    return {name: function(name) for name in FUNCTIONS}, repeat


def worst(found, expected):
    return float(np.max(np.abs(found - expected)) / max(1.0, np.max(np.abs(expected))))


def main():
    dynident, result, study, scratch = sys.argv[1:]
    folder = pathlib.Path(scratch)
    folder.mkdir(exist_ok=True)
    header, module_file, mjcf, urdf = (
        exported(dynident, result, study, form, folder / name)
        for form, name in [("c", "robot.h"), ("python", "robot.py"), ("mjcf", "robot.xml"), ("urdf", "robot.urdf")]
    )
    spec = importlib.util.spec_from_file_location("robot", module_file)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    dof = module.DOF
    prefix = header.read_text().split("_inverse_dynamics(")[0].split()[-1]
    of_c, repeat = compiled(header, prefix, dof, folder)

    random = np.random.default_rng(1)
    state = {"q": random.uniform(-3, 3, (STATES, dof)), "dq": random.uniform(-2, 2, (STATES, dof)), "ddq": random.uniform(-8, 8, (STATES, dof))}
    state["tau"] = module.inverse_dynamics(state["q"], state["dq"], state["ddq"])
    for name, inputs in FUNCTIONS.items():
        vectors = [state[vector] for vector in inputs]
        together = getattr(module, name)(*vectors)
        single = np.array([of_c[name](*(np.ascontiguousarray(vector[k]) for vector in vectors)) for k in range(STATES)])
        off = worst(together, single)
        print(f"{name}: Python and C differ by {off:.1e} of the largest")
        assert off < (SAME_PHYSICS if name == "forward_dynamics" else SAME_CODE), name
    assert worst(module.forward_dynamics(state["q"], state["dq"], state["tau"]), state["ddq"]) < SAME_PHYSICS

    q, dq, ddq = state["q"], state["dq"], state["ddq"]
    bare = np.einsum("sij,sj->si", module.mass_matrix(q), ddq) + module.coriolis(q, dq) + module.gravity(q)

    # MuJoCo adds damping; friction that sticks and stops are constraints, which this comparison leaves out.
    simulated = mujoco.MjModel.from_xml_path(str(mjcf))
    data = mujoco.MjData(simulated)
    simulated.dof_frictionloss[:] = 0
    simulated.jnt_limited[:] = 0
    torque = []
    for k in range(STATES):
        data.qpos[:], data.qvel[:], data.qacc[:] = q[k], dq[k], ddq[k]
        mujoco.mj_inverse(simulated, data)
        torque.append(data.qfrc_inverse.copy())
    off = worst(np.array(torque), bare + simulated.dof_damping * dq)
    print(f"MuJoCo's inverse dynamics of the MJCF differ by {off:.1e}")
    assert off < SAME_PHYSICS

    # URDF has no drive inertia: what is compared does not hold it.
    described = pinocchio.buildModelFromUrdf(str(urdf))
    workspace = described.createData()
    described.armature = np.zeros(described.nv)
    zero = np.zeros(described.nv)
    if described.nq == dof:
        bias = np.array([pinocchio.rnea(described, workspace, q[k], dq[k], zero) for k in range(STATES)])
        off = worst(bias, module.coriolis(q, dq) + module.gravity(q))
        print(f"Pinocchio's bias torque of the URDF differs by {off:.1e}")
        assert off < SAME_PHYSICS

        own, other = [], []
        vectors = [np.ascontiguousarray(vector[0]) for vector in (q, dq, ddq)]
        for _ in range(9):
            start = time.process_time()
            repeat(100_000, *vectors)
            own.append((time.process_time() - start) / 100_000)
            start = time.process_time()
            for _ in range(5000):
                pinocchio.rnea(described, workspace, *vectors)
            other.append((time.process_time() - start) / 5000)
        print(f"inverse dynamics, processor time of a call: C {np.median(own) * 1e9:.0f} ns (least {min(own) * 1e9:.0f}), pin.rnea {np.median(other) * 1e9:.0f} ns (least {min(other) * 1e9:.0f}, with its call from Python)")


if __name__ == "__main__":
    main()
