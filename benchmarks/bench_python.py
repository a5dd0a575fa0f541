"""Measures Pinocchio called from Python (with call overhead), and the usual computation of a triangular factor from samples in Python.

    bench_python.py            one JSON line per robot and algorithm
"""
import numpy as np
import pinocchio as pin
import scipy.linalg
from common import NAMES, emit_timed, fourier, robot_path, states

for name in NAMES:
    m = pin.buildModelFromUrdf(robot_path(name))
    d = m.createData()
    n = 2000 if m.nv < 20 else 300
    rows = list(zip(*states(m, n)))
    algorithms = {
        "rnea": lambda q, v, a: pin.rnea(m, d, q, v, a),
        "crba": lambda q, v, a: pin.crba(m, d, q),
        "aba": lambda q, v, a: pin.aba(m, d, q, v, a),
        "joint_torque_regressor": lambda q, v, a: pin.computeJointTorqueRegressor(m, d, q, v, a),
        "rnea_derivatives": lambda q, v, a: pin.computeRNEADerivatives(m, d, q, v, a),
    }
    for algo, call in algorithms.items():
        def sweep(call=call):
            for q, v, a in rows:
                call(q, v, a)
        emit_timed("pinocchio_python", "wheel", name, m.nv, algo, sweep, repeats=9, per=n)

# 10,000 samples of a Panda arm: the stacked regressor, then the R factor of [W tau] (LAPACK, one thread).
name, n = "panda_arm7", 10_000
m = pin.buildModelFromUrdf(robot_path(name))
d = m.createData()
Q, V, A = fourier(m, n, 10.0)
stack = np.empty((n * m.nv, 10 * m.nv + 1))
stack[:, -1] = np.concatenate([pin.rnea(m, d, Q[i], V[i], A[i]) for i in range(n)])


def regressor():
    for i in range(n):
        stack[i * m.nv : (i + 1) * m.nv, :-1] = pin.computeJointTorqueRegressor(m, d, Q[i], V[i], A[i])


def factor():
    regressor()
    scipy.linalg.qr(stack, mode="r", check_finite=False)


emit_timed("pinocchio_python", "wheel", name, m.nv, "regressor_10000", regressor, repeats=5)
emit_timed("pinocchio_python", "wheel", name, m.nv, "factors_10000", factor, repeats=5)
