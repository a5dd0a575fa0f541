"""export.py DYNIDENT RESULT STUDY SCRATCH DESCRIPTION: checks the output of `dynident export` with other programs.

Compares the Python module with the modules for CasADi, JAX and Pinocchio, and with the C header, compiled by gcc and clang, at 1,000 states (the tests compare the C header with the core). Compares the same model with the inverse
dynamics of MuJoCo from the MJCF and of Pinocchio from the URDF, from JSON (json), from ROS 2 parameters (PyYAML) and from SDF (libsdformat). DESCRIPTION is the example program of
dynident-export; it is used to read every robot of robots/ with libsdformat. Prints the run times of the C inverse dynamics and of pin.rnea in alternation; no check depends on them.
Needs gcc, clang, g++, libsdformat-dev with pkg-config, and golden/requirements.txt.
"""
import ctypes
import importlib.util
import json
import math
import pathlib
import subprocess
import sys
import time
from xml.etree import ElementTree

import jax
import jsonschema
import mujoco
import numpy as np
import pinocchio
import yaml

jax.config.update("jax_enable_x64", True)

STATES = 1000
# Rounding error of some thousand operations, as in the tests.
SAME_CODE = 1e-12
# Other algorithms, with numbers from a file in which inertia is about the centre of mass.
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
    options = ["--regressor"] if form in ("python", "casadi", "jax") else []
    told = subprocess.run([dynident, "export", result, "--study", study, "--to", form, "--out", path, "--json", *options], check=True, capture_output=True, text=True)
    assert json.loads(told.stdout)["file"] == str(path), told.stdout
    return path


def loaded(path):
    spec = importlib.util.spec_from_file_location(path.stem, path)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def check_modules(files, module, state):
    """Checks that the modules for CasADi, JAX and Pinocchio give the numbers of the module for NumPy."""
    symbolic, pure, rigid = (loaded(files[form]) for form in ("casadi", "jax", "pinocchio"))
    functions = {**FUNCTIONS, "regressor": ["q", "dq", "ddq"]}
    functions |= {"load_friction": ["q", "dq", "ddq"]} if hasattr(module, "load_friction") else {}
    for name, inputs in functions.items():
        vectors = [state[vector] for vector in inputs]
        expected = getattr(module, name)(*vectors)
        by_casadi = np.array([np.array(getattr(symbolic, name)(*(vector[k] for vector in vectors))) for k in range(STATES)])
        for library, found in [("CasADi", by_casadi.reshape(expected.shape)), ("JAX", np.array(jax.jit(getattr(pure, name))(*vectors)))]:
            off = worst(found, expected)
            print(f"{name}: {library} and NumPy differ by {off:.1e} of the largest")
            assert off < (SAME_PHYSICS if name == "forward_dynamics" else SAME_CODE), name
    assert worst(np.einsum("sij,j->si", module.regressor(state["q"], state["dq"], state["ddq"]), module.parameters()), state["tau"]) < SAME_CODE
    slope = jax.jacfwd(pure.inverse_dynamics, argnums=2)(*(state[vector][0] for vector in ("q", "dq", "ddq")))
    if not hasattr(module, "load_friction"):
        assert worst(np.array(slope), module.mass_matrix(state["q"][0])) < SAME_CODE
    found = np.array([rigid.torque(*(state[vector][k] for vector in ("q", "dq", "ddq"))) for k in range(STATES)])
    off = worst(found, state["tau"])
    print(f"the torque of the module for Pinocchio differs by {off:.1e} of the largest")
    assert off < SAME_PHYSICS


def check_memory(dynident, study, folder):
    """Identifies the logs with friction under load and with memory, and compares the functions with state of the modules along a motion."""
    text = pathlib.Path(study).read_text().replace('"ur10_simulated/', f'"{pathlib.Path(study).resolve().parent}/ur10_simulated/')
    text = text.replace('"../robots/', f'"{pathlib.Path("robots").resolve()}/')
    laws = '[{ law = "load" }, { law = "maxwell-slip", yield_displacements = [0.01] }]'
    own = folder / "memory.toml"
    own.write_text(text + f'\n[drive]\nfriction = "stated"\nviscous = true\nlaws = {laws}\n')
    # The verdict may be negative: the logs are of another friction.
    told = subprocess.run([dynident, "identify", str(own), "--out", str(folder / "memory")], capture_output=True, text=True)
    assert told.returncode in (0, 1), told.stderr
    forms = {"python": "memory_numpy.py", "casadi": "memory_casadi.py", "jax": "memory_jax.py", "pinocchio": "memory_pinocchio.py"}
    files = {form: folder / name for form, name in forms.items()}
    for form, path in files.items():
        options = [] if form == "pinocchio" else ["--regressor"]
        subprocess.run([dynident, "export", str(folder / "memory"), "--to", form, "--out", str(path), *options], check=True, capture_output=True)
    module, symbolic, pure = (loaded(files[form]) for form in ("python", "casadi", "jax"))
    time = np.linspace(0, 4, STATES)[:, None] + np.linspace(0, 2, module.DOF)
    motion = np.sin(3 * time), 3 * np.cos(3 * time), -9 * np.sin(3 * time)
    state, state_of_jax, (last, z) = module.State(), pure.reset(motion[0][0]), symbolic.reset(motion[0][0])
    step, off, memory = jax.jit(pure.step), 0.0, 0.0
    for q, dq, ddq in zip(*motion):
        tau = module.step(state, q, dq, ddq)
        by_jax, state_of_jax = step(state_of_jax, q, dq, ddq)
        by_casadi, last, z = symbolic.step(last, z, q, dq, ddq)
        off = max(off, worst(np.array(by_jax), tau), worst(np.array(by_casadi).ravel(), tau))
        memory = max(memory, worst(module.inverse_dynamics(q, dq, ddq), tau))
    print(f"functions with state of CasADi, JAX and NumPy differ by {off:.1e} of the largest; without state they differ by {memory:.1e}")
    assert off < SAME_CODE < memory
    q, dq, ddq = motion
    check_modules(files, module, {"q": q, "dq": dq, "ddq": ddq, "tau": module.inverse_dynamics(q, dq, ddq)})


def compiled(compiler, header, prefix, dof, folder):
    """Compiles the C functions without warnings and wraps them as Python functions of contiguous vectors."""
    calls = []
    for name, inputs in FUNCTIONS.items():
        arguments = ", ".join(f"const double *{vector}" for vector in inputs)
        calls.append(f"void call_{name}({arguments}, double *out) {{ {prefix}_{name}({', '.join(inputs)}, out); }}")
    # A volatile pointer prevents the compiler from moving constant work out of the loop.
    calls.append(
        "static void (*volatile called)(const double *, const double *, const double *, double *) = call_inverse_dynamics;\n"
        "void repeat(long n, const double *q, const double *dq, double *ddq, double *out) {"
        " for (long k = 0; k < n; k++) { called(q, dq, ddq, out); ddq[0] += 1e-30 * out[0]; } }"
    )
    (folder / "calls.c").write_text(f'#include "{header.name}"\n' + "\n".join(calls) + "\n")
    library = folder / f"calls_{compiler}.so"
    flags = ["-std=c99", "-Wall", "-Wextra", "-Werror", "-O2", "-shared", "-fPIC"]
    subprocess.run([compiler, *flags, str(folder / "calls.c"), "-o", str(library), "-lm"], check=True)
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


def step(constants, dq):
    if constants["shape"] == "smooth":
        return np.tanh(dq / constants["width_rad_s"])
    return np.where(np.abs(dq) <= constants["dead_band_rad_s"], 0.0, np.sign(dq))


def friction_of(kind, constants, dq):
    """Velocity function of a friction term of a revolute joint, as documented on the export page of the book."""
    part = lambda x: np.maximum(x, 0.0) if constants["direction"] == "+" else np.minimum(x, 0.0)
    logistic = lambda v: 1 / (1 + np.exp(-constants["steepness_s_per_rad"] * (v + constants["offset_speed_rad_s"])))
    return {
        "viscous": lambda: dq,
        "coulomb": lambda: step(constants, dq),
        "directional-viscous": lambda: part(dq),
        "directional-coulomb": lambda: part(step(constants, dq)),
        "stribeck": lambda: np.exp(-np.abs(dq / constants["speed_rad_s"]) ** constants["exponent"]) * step(constants, dq),
        "sigmoid": lambda: logistic(dq) - logistic(0.0),
        "power": lambda: dq * np.hypot(dq, constants["rounding_rad_s"]) ** (constants["exponent"] - 1),
        "offset": lambda: np.ones_like(dq),
    }[kind]()


def drives_of(terms, couplings, names, dq):
    """Friction at the given velocities, and the contribution of the drives to the mass matrix. `terms` belong to one joint, `couplings` to two; both have kind, value and constants."""
    friction, inertia = np.zeros_like(dq), np.zeros((len(names), len(names)))
    for joint, own in enumerate(terms):
        for term in own:
            if term["kind"] == "drive-inertia":
                inertia[joint, joint] += term["value"]
            else:
                friction[:, joint] += term["value"] * friction_of(term["kind"], term["constants"], dq[:, joint])
    for term in couplings:
        (a, b), (ka, kb) = (names.index(name) for name in term["joints"]), term["constants"]["ratios"]
        if term["constants"]["effect"] == "inertia":
            inertia[a, b] += term["value"] * ka * kb
            inertia[b, a] += term["value"] * ka * kb
        else:
            felt = {"viscous": lambda: None, "coulomb": lambda: step(term["constants"], ka * dq[:, a] + kb * dq[:, b])}[term["constants"]["effect"]]()
            friction[:, a] += term["value"] * (ka * kb * dq[:, b] if felt is None else ka * felt)
            friction[:, b] += term["value"] * (ka * kb * dq[:, a] if felt is None else kb * felt)
    return friction, inertia


def matrix(six):
    xx, xy, xz, yy, yz, zz = six
    return np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])


def assembled(joints, gravity):
    """Builds a Pinocchio model. For each joint: parent (-1 is the base), whether it is revolute, placement, axis, mass, centre of mass and inertia about the centre of mass."""
    model = pinocchio.Model()
    for number, (parent, turns, rotation, translation, axis, mass, com, inertia) in enumerate(joints):
        kind = pinocchio.JointModelRevoluteUnaligned if turns else pinocchio.JointModelPrismaticUnaligned
        # The first joint of a Pinocchio model is the universe.
        joint = model.addJoint(parent + 1, kind(np.array(axis)), pinocchio.SE3(np.array(rotation), np.array(translation)), f"joint {number}")
        model.appendBodyToJoint(joint, pinocchio.Inertia(mass, np.array(com), np.array(inertia)), pinocchio.SE3.Identity())
    model.gravity.linear = np.array(gravity)
    return model


def torques(model, q, dq, ddq):
    data = model.createData()
    return np.array([pinocchio.rnea(model, data, *state) for state in zip(q, dq, ddq)])


def read_sdf(reader, path):
    """Joints of an SDF read by libsdformat, in file order, in the format of `assembled`; and damping and friction of each."""
    told = subprocess.run([reader, str(path)], check=True, capture_output=True, text=True).stdout
    lines = [line.split() for line in told.splitlines()]
    numbers = lambda words: [float(word) for word in words]

    def placed(seven):
        x, y, z, qw, qx, qy, qz = seven
        return pinocchio.Quaternion(qw, qx, qy, qz).toRotationMatrix(), np.array([x, y, z])

    links = {words[1]: numbers(words[2:]) for words in lines if words[0] == "link"}
    listed = [words for words in lines if words[0] == "joint"]
    children = [words[4] for words in listed]
    joints, friction = [], []
    for _, _, motion, parent, child, *rest in listed:
        values = numbers(rest)
        mass, *frame = links[child]
        _, com = placed(frame[:7])
        joints.append((children.index(parent) if parent in children else -1, motion == "turns", *placed(values[:7]), values[7:10], mass, com, np.array(frame[7:]).reshape(3, 3)))
        friction.append(values[14:])
    return joints, np.array(friction)


def sdf_reader(folder):
    """Compiles .ci/sdf.cpp with the installed version of libsdformat."""
    listed = subprocess.run(["pkg-config", "--list-all"], check=True, capture_output=True, text=True).stdout.split("\n")
    packages = sorted({line.split()[0] for line in listed if line.startswith("sdformat")})
    assert packages, "libsdformat is missing: install libsdformat-dev"
    flags = subprocess.run(["pkg-config", "--cflags", "--libs", packages[-1]], check=True, capture_output=True, text=True).stdout.split()
    source, program = pathlib.Path(__file__).with_name("sdf.cpp"), folder / "sdf"
    subprocess.run(["g++", "-std=c++17", "-O0", "-w", str(source), "-o", str(program), *flags], check=True)
    return str(program)


def check_numbers(files, reader, module, state, schema):
    """Checks that JSON, ROS 2 parameters and SDF of the result give the same torques."""
    q, dq, ddq = state["q"], state["dq"], state["ddq"]
    of_json = json.loads(files["json"].read_text())
    jsonschema.Draft7Validator(schema).validate(of_json)
    names = [joint["name"] for joint in of_json["joints"]]
    joints = [
        (
            names.index(joint["parent"]) if joint["parent"] else -1,
            joint["type"] != "prismatic",
            joint["placement"]["rotation"],
            joint["placement"]["translation_m"],
            joint["axis"],
            joint["body"]["mass_kg"],
            joint["body"]["com_m"],
            matrix(joint["body"]["inertia_at_com_kgm2"]),
        )
        for joint in of_json["joints"]
    ]
    friction, drives = drives_of([joint["terms"] for joint in of_json["joints"]], of_json["couplings"], names, dq)
    rigid = torques(assembled(joints, of_json["gravity_m_s2"]), q, dq, ddq)
    off = worst(rigid + ddq @ drives + friction, module.inverse_dynamics(q, dq, ddq))
    print(f"Pinocchio's inverse dynamics from JSON differ by {off:.1e}")
    assert off < SAME_PHYSICS

    (node, section), = yaml.safe_load(files["ros2-yaml"].read_text()).items()
    assert node == "/**" and list(section) == ["ros__parameters"]
    parameters = section["ros__parameters"]

    def only_parameters(value, at):
        """Checks the types and names of ROS parameters: booleans, integers, numbers, strings and uniform arrays; names without dots and slashes."""
        if isinstance(value, dict):
            assert value and all(key.replace("_", "a").isalnum() and key.isascii() for key in value), at
            for key, inner in value.items():
                only_parameters(inner, f"{at}.{key}")
        else:
            values = value if isinstance(value, list) else [value]
            assert values and type(values[0]) in (float, str) and all(type(one) is type(values[0]) for one in values), (at, value)

    only_parameters(parameters, "")
    assert parameters["joints"] == names
    listed = list(parameters["dynamics"].values())
    flat = lambda terms: [{"constants": term, **term} for term in terms.values()]
    friction, drives = drives_of([flat(one.get("terms", {})) for one in listed], flat(parameters.get("couplings", {})), names, dq)
    assert all(drives[k, k] == one["drive_inertia_kgm2"] for k, one in enumerate(listed))
    # Placements come from robot_description, which are also in the JSON.
    of_yaml = [(*joint[:5], one["mass_kg"], one["com_m"], matrix(one["inertia_at_com_kgm2"])) for joint, one in zip(joints, listed)]
    rigid = torques(assembled(of_yaml, parameters["gravity_m_s2"]), q, dq, ddq)
    off = worst(rigid + ddq @ drives + friction, module.inverse_dynamics(q, dq, ddq))
    print(f"Pinocchio's inverse dynamics from the ROS 2 parameters differ by {off:.1e}")
    assert off < SAME_PHYSICS

    of_sdf, dry_and_viscous = read_sdf(reader, files["sdf"])
    off = worst(torques(assembled(of_sdf, of_json["gravity_m_s2"]), q, dq, ddq) + ddq @ drives, module.inverse_dynamics(q, dq, ddq) - module.friction(dq))
    print(f"Pinocchio's inverse dynamics from the SDF (libsdformat) differ by {off:.1e}")
    assert off < SAME_PHYSICS
    # Friction of URDF and SDF is fitted for both.
    described = {joint.get("name"): joint.find("dynamics") for joint in ElementTree.parse(files["urdf"]).iter("joint")}
    of_urdf = [[float(described[name].get(key)) for key in ("damping", "friction")] for name in names]
    assert np.array_equal(dry_and_viscous, of_urdf)


def check_descriptions(description, reader, folder):
    """Compares every robot of robots/, exported as SDF, with Pinocchio's model of the URDF."""
    random = np.random.default_rng(2)
    read = 0
    for urdf in sorted(pathlib.Path("robots").glob("*.urdf")):
        written = subprocess.run([description, str(urdf), "sdf"], capture_output=True, text=True)
        if written.returncode != 0:
            # A description with unphysical bodies.
            assert "NotPhysical" in written.stderr, written.stderr
            print(f"{urdf.name}: {written.stderr.strip()}")
            continue
        (folder / "one.sdf").write_text(written.stdout)
        found, expected = assembled(read_sdf(reader, folder / "one.sdf")[0], [0, 0, -9.81]), pinocchio.buildModelFromUrdf(str(urdf))
        expected.armature = np.zeros(expected.nv)
        assert found.nv == expected.nv, urdf
        # Pinocchio sorts branches by name, and uses cosine and sine for unlimited angles.
        q, dq, ddq = (random.uniform(-2, 2, (50, found.nv)) for _ in range(3))
        joints = written.stdout.split('<joint name="')[2:]
        order = [expected.joints[expected.getJointId(joint.split('"')[0])].idx_v for joint in joints]
        data, off = expected.createData(), 0.0
        for k in range(len(q)):
            angles, velocity, acceleration = pinocchio.neutral(expected), np.zeros(expected.nv), np.zeros(expected.nv)
            for own, place in enumerate(order):
                joint = next(joint for joint in expected.joints if joint.idx_v == place and joint.nv)
                angles[joint.idx_q : joint.idx_q + joint.nq] = q[k, own] if joint.nq == 1 else (math.cos(q[k, own]), math.sin(q[k, own]))
                velocity[place], acceleration[place] = dq[k, own], ddq[k, own]
            theirs = pinocchio.rnea(expected, data, angles, velocity, acceleration)[order]
            off = max(off, worst(pinocchio.rnea(found, found.createData(), q[k], dq[k], ddq[k]), theirs))
        print(f"{urdf.name} as SDF: torques of the SDF (libsdformat) and of the URDF (Pinocchio) differ by {off:.1e}")
        assert off < SAME_PHYSICS
        read += 1
    assert read >= 6, read


def main():
    dynident, result, study, scratch, description = sys.argv[1:]
    folder = pathlib.Path(scratch)
    folder.mkdir(exist_ok=True)
    forms = {"c": "robot.h", "python": "robot.py", "casadi": "robot_casadi.py", "jax": "robot_jax.py", "pinocchio": "robot_pinocchio.py", "mjcf": "robot.xml", "urdf": "robot.urdf", "sdf": "robot.sdf", "ros2-yaml": "robot.yaml", "json": "robot.json"}
    files = {form: exported(dynident, result, study, form, folder / name) for form, name in forms.items()}
    header, module_file, mjcf, urdf = (files[form] for form in ("c", "python", "mjcf", "urdf"))
    module = loaded(module_file)
    dof = module.DOF
    prefix = header.read_text().split("_inverse_dynamics(")[0].split()[-1]
    of_c, repeat = compiled("gcc", header, prefix, dof, folder)
    of_clang, _ = compiled("clang", header, prefix, dof, folder)

    random = np.random.default_rng(1)
    state = {"q": random.uniform(-3, 3, (STATES, dof)), "dq": random.uniform(-2, 2, (STATES, dof)), "ddq": random.uniform(-8, 8, (STATES, dof))}
    state["tau"] = module.inverse_dynamics(state["q"], state["dq"], state["ddq"])
    for name, inputs in FUNCTIONS.items():
        vectors = [state[vector] for vector in inputs]
        together = getattr(module, name)(*vectors)
        for compiler, functions in [("gcc", of_c), ("clang", of_clang)]:
            single = np.array([functions[name](*(np.ascontiguousarray(vector[k]) for vector in vectors)) for k in range(STATES)])
            off = worst(together, single)
            print(f"{name}: Python and C of {compiler} differ by {off:.1e} of the largest")
            assert off < (SAME_PHYSICS if name == "forward_dynamics" else SAME_CODE), name
    assert worst(module.forward_dynamics(state["q"], state["dq"], state["tau"]), state["ddq"]) < SAME_PHYSICS
    check_modules(files, module, state)
    check_memory(dynident, study, folder)

    q, dq, ddq = state["q"], state["dq"], state["ddq"]
    bare = np.einsum("sij,sj->si", module.mass_matrix(q), ddq) + module.coriolis(q, dq) + module.gravity(q)

    # MuJoCo adds damping. Dry friction and joint stops are constraints, which this comparison omits.
    simulated = mujoco.MjModel.from_xml_path(str(mjcf))
    data = mujoco.MjData(simulated)
    simulated.dof_frictionloss[:] = 0
    simulated.jnt_limited[:] = 0
    torque = []
    for k in range(STATES):
        data.qpos[:], data.qvel[:], data.qacc[:] = q[k], dq[k], ddq[k]
        mujoco.mj_inverse(simulated, data)
        torque.append(data.qfrc_inverse.copy())
    # Drive inertia is fitted again for the MJCF, because its friction is another.
    of_json = json.loads(files["json"].read_text())
    names = [joint["name"] for joint in of_json["joints"]]
    _, drives = drives_of([joint["terms"] for joint in of_json["joints"]], of_json["couplings"], names, dq)
    off = worst(np.array(torque), bare - ddq @ drives + simulated.dof_armature * ddq + simulated.dof_damping * dq)
    print(f"MuJoCo's inverse dynamics of the MJCF differ by {off:.1e}")
    assert off < SAME_PHYSICS

    reader = sdf_reader(folder)
    check_numbers(files, reader, module, state, json.loads(pathlib.Path("docs/schemas/model.json").read_text()))
    check_descriptions(description, reader, folder)

    # URDF has no drive inertia, so the comparison omits it.
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
