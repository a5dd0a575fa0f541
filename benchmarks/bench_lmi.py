"""Compares Clarabel with Dynident's two solvers on random problems of the physically consistent fit.

    cargo bench -p dynident-estimation --bench physical -- --problems 1000 2000 --both-routes > problems.jsonl
    python3 benchmarks/bench_lmi.py problems.jsonl [--scaled] [--gram] [--limit N]

Each line of the file has the definition of a problem and Dynident's solutions. The conic program is formulated here independently of Dynident:

    minimise 1/2 |R B pi - rho|^2 + gamma D(pi, pi0)   with P(pi_i) - margin P0_i positive semidefinite, and the linear limits

`--scaled` whitens the coordinates of the bodies by their references, as Dynident does; the default is SI units. `--gram` uses a cost matrix; the
default uses the residuals as separate variables. The log-det of an entropic prior is formulated with a triangular matrix and exponential cones.
Prints one table: processor time, failures by status, largest violation of a whitened cone, gap to the best objective known.
"""
import argparse
import collections
import json
import multiprocessing
import os
import time

os.environ["OMP_NUM_THREADS"] = os.environ["OPENBLAS_NUM_THREADS"] = "1"  # before NumPy is imported: use one core only

import clarabel
import numpy as np
from scipy import sparse

PAIRS = [(i, j) for j in range(4) for i in range(j + 1)]  # upper triangle, column after column, as Clarabel stacks it
ROOT = np.sqrt(2.0)


def svec(matrix):
    n = len(matrix)
    return np.array([matrix[i, j] * (1.0 if i == j else ROOT) for j in range(n) for i in range(j + 1)])


def pseudo_inertia(p):
    half = 0.5 * (p[4] + p[7] + p[9])
    return np.array(
        [
            [half - p[4], -p[5], -p[6], p[1]],
            [-p[5], half - p[7], -p[8], p[2]],
            [-p[6], -p[8], half - p[9], p[3]],
            [p[1], p[2], p[3], p[0]],
        ]
    )


class Body:
    """Coordinates of one body, pi = T v, and the ten columns of the matrix of its cone."""

    def __init__(self, entry, scaled):
        self.reference = np.array(entry["reference"])
        self.known = None if entry["known"] is None else np.array(entry["known"])
        self.entry = entry
        P0 = pseudo_inertia(self.reference)
        self.root = np.linalg.inv(np.linalg.cholesky(P0))
        basis = np.eye(10)
        whiten = np.column_stack([svec(self.root @ pseudo_inertia(e) @ self.root.T) for e in basis])
        self.T = np.linalg.inv(whiten) if scaled else np.eye(10)
        self.whiten = whiten @ self.T  # v to svec(Q)
        self.cone = self.whiten if scaled else np.column_stack([svec(pseudo_inertia(e)) for e in basis])
        self.cone_reference = svec(np.eye(4)) if scaled else svec(P0)
        self.scaled = scaled
        m = self.reference[0]
        length = np.sqrt(np.trace(P0[:3, :3]) / m)
        self.units = m * np.array([1.0] + 3 * [length] + 6 * [length**2])

    def distance(self, prior, p):
        Q = self.root @ pseudo_inertia(p) @ self.root.T
        if prior == "entropic":
            sign, log = np.linalg.slogdet(Q)
            return np.trace(Q) - log - 4.0 if sign > 0 and np.linalg.eigvalsh(Q)[0] > 0 else np.inf
        if prior == "pullback":
            return 0.5 * np.sum((Q - np.eye(4)) ** 2)
        return 0.5 * np.sum(((p - self.reference) / self.units) ** 2)


class Problem:
    def __init__(self, case, scaled):
        self.case = case
        self.bodies = [Body(entry, scaled) for entry in case["bodies"]]
        count = len(case["right"])
        columns = 10 * len(self.bodies) + len(case["scalars"])
        matrix = lambda t, shape: sparse.coo_matrix((t[2], (t[0], t[1])), shape=shape).toarray()
        self.data = matrix(case["rows"], (count, count)) @ matrix(case["base_map"], (count, columns))
        self.right = np.array(case["right"])

    def objective(self, pi):
        case, n = self.case, 10 * len(self.bodies)
        prior = sum(b.distance(case["prior"], pi[10 * i : 10 * i + 10]) for i, b in enumerate(self.bodies) if b.known is None)
        prior += 0.5 * sum((v - s["prior"]) ** 2 for v, s in zip(pi[n:], case["scalars"]))
        return 0.5 * np.sum((self.data @ pi - self.right) ** 2) + case["prior_weight"] * prior

    def violation(self, pi):
        """Violation of the cones (whitened by the reference) or of scalar limits at the point."""
        worst, n = 0.0, 10 * len(self.bodies)
        for i, b in enumerate(self.bodies):
            if b.known is None:
                Q = b.root @ pseudo_inertia(pi[10 * i : 10 * i + 10]) @ b.root.T
                worst = max(worst, self.case["margin"] - np.linalg.eigvalsh(Q)[0])
        for v, s in zip(pi[n:], self.case["scalars"]):
            worst = max(worst, (s["lower"] if s["lower"] is not None else -np.inf) - v)
            worst = max(worst, v - (s["upper"] if s["upper"] is not None else np.inf))
        return worst

    def conic(self, gram):
        """P, q, A, b, cones in Clarabel's form A x + s = b, and how to read pi from x."""
        case, weight, margin = self.case, self.case["prior_weight"], self.case["margin"]
        free = [i for i, b in enumerate(self.bodies) if b.known is None]
        start = {i: 10 * k for k, i in enumerate(free)}
        bodies, n_bodies = 10 * len(self.bodies), 10 * len(free)
        n_scalars = len(case["scalars"])
        base = n_bodies + n_scalars
        T = np.zeros((bodies + n_scalars, base))
        offset = np.zeros(bodies + n_scalars)
        for i, b in enumerate(self.bodies):
            if b.known is None:
                T[10 * i : 10 * i + 10, start[i] : start[i] + 10] = b.T
            else:
                offset[10 * i : 10 * i + 10] = b.known
        T[bodies:, n_bodies:] = np.eye(n_scalars)
        M, r = self.data @ T, self.right - self.data @ offset
        residuals = 0 if gram else len(r)
        extra = 14 * len(free) if case["prior"] == "entropic" else 0  # Z (10) and t (4) of each body
        n = base + residuals + extra
        Pd, q = np.zeros((base, base)), np.zeros(n)
        # Rows of A by type of cone: zero, nonnegative, then individual PSD and exponential cones.
        zero, zero_b, above, above_b, rest, cones = [], [], [], [], [], []
        if gram:
            Pd += M.T @ M
            q[:base] -= M.T @ r
        else:
            zero.append(sparse.hstack([sparse.csc_matrix(M), -sparse.eye(residuals), sparse.csc_matrix((residuals, extra))]))
            zero_b.append(r)
        for k in range(n_scalars):
            Pd[n_bodies + k, n_bodies + k] += weight
            q[n_bodies + k] -= weight * case["scalars"][k]["prior"]

        def at_least(functional, constant):
            """functional . pi + constant >= 0."""
            row = functional @ T
            size = np.linalg.norm(row) if self.bodies[0].scaled else 1.0
            if size > 0.0:
                above.append(np.concatenate([-row, np.zeros(n - base)]) / size)
                above_b.append((functional @ offset + constant) / size)

        unit = lambda k: np.eye(1, bodies + n_scalars, k).ravel()
        for i in free:
            b, entry = self.bodies[i], self.bodies[i].entry
            v = slice(start[i], start[i] + 10)
            if case["prior"] == "entropic":
                q[v] += weight * (svec(np.eye(4)) @ b.whiten)
                first = base + residuals + 14 * free.index(i)
                q[first + 10 : first + 14] -= weight
                # [P Z; Z' diag(Z)] with Z lower triangular; t_k <= ln Z_kk. The prior contains ln det P - ln det P0.
                lower = [(r_, c_) for c_ in range(4) for r_ in range(c_, 4)]
                block = np.zeros((36, n))
                full = lambda column: column.reshape(8, 8)
                for k in range(10):
                    big = np.zeros((8, 8))
                    column = b.cone[:, k]
                    for (r_, c_), value in zip(PAIRS, column):
                        big[r_, c_] = big[c_, r_] = value / (1.0 if r_ == c_ else ROOT)
                    block[:, start[i] + k] = -svec(full(big))
                for k, (r_, c_) in enumerate(lower):
                    big = np.zeros((8, 8))
                    big[r_, 4 + c_] = big[4 + c_, r_] = 1.0
                    if r_ == c_:
                        big[4 + c_, 4 + c_] = 1.0
                    block[:, first + k] = -svec(big)
                rest.append((block, np.zeros(36)))
                cones.append(clarabel.PSDTriangleConeT(8))
                for c_ in range(4):
                    # (t, 1, Z_cc) in the exponential cone.
                    rows = np.zeros((3, n))
                    rows[0, first + 10 + c_] = -1.0
                    rows[2, first + lower.index((c_, c_))] = -1.0
                    rest.append((rows, np.array([0.0, 1.0, 0.0])))
                    cones.append(clarabel.ExponentialConeT())
            elif case["prior"] == "pullback":
                Pd[v, v] += weight * b.whiten.T @ b.whiten
                q[v] -= weight * b.whiten.T @ svec(np.eye(4))
            else:
                U = b.T / b.units[:, None]
                Pd[v, v] += weight * U.T @ U
                q[v] -= weight * U.T @ (b.reference / b.units)
            rows = np.zeros((10, n))
            rows[:, v] = -b.cone
            rest.append((rows, -margin * b.cone_reference))
            cones.append(clarabel.PSDTriangleConeT(4))
            mass = unit(10 * i)
            if entry["mass_kg"] is not None:
                at_least(mass, -entry["mass_kg"][0])
                at_least(-mass, entry["mass_kg"][1])
            if entry["com_box_m"] is not None:
                for axis, (low, high) in enumerate(zip(*entry["com_box_m"])):
                    moment = unit(10 * i + 1 + axis)
                    at_least(moment - low * mass, 0.0)
                    at_least(high * mass - moment, 0.0)
            if entry["inside"] is not None:
                centre, axes = map(np.array, entry["inside"])
                E = np.diag(1 / axes**2)
                Q = np.block([[-E, (E @ centre)[:, None]], [(E @ centre)[None, :], np.array([[1 - centre @ E @ centre]])]])
                functional = np.zeros(bodies + n_scalars)
                functional[10 * i : 10 * i + 10] = [np.sum(Q * pseudo_inertia(e)) for e in np.eye(10)]
                at_least(functional, 0.0)
        if case["total_mass_kg"] is not None:
            total = sum(unit(10 * i) for i in range(len(self.bodies)))
            at_least(total, -case["total_mass_kg"][0])
            at_least(-total, case["total_mass_kg"][1])
        for k, scalar in enumerate(case["scalars"]):
            if scalar["lower"] is not None:
                at_least(unit(bodies + k), -scalar["lower"])
            if scalar["upper"] is not None:
                at_least(-unit(bodies + k), scalar["upper"])
        P = sparse.block_diag([Pd, sparse.eye(residuals), sparse.csc_matrix((extra, extra))], format="csc")
        A = sparse.vstack(zero + [sparse.csc_matrix(np.array(above))] + [sparse.csc_matrix(rows) for rows, _ in rest], format="csc")
        b = np.concatenate(zero_b + [np.array(above_b)] + [right for _, right in rest])
        first = [clarabel.ZeroConeT(residuals)] if residuals else []
        cones = first + [clarabel.NonnegativeConeT(len(above))] + cones
        return sparse.triu(P, format="csc"), q, A, b, cones, lambda x: T @ x[:base] + offset


def judged(task):
    """Results of every solver for one line of the file."""
    line, scaled, gram = task
    case = json.loads(line)
    problem = Problem(case, scaled)
    P, q, A, b, cones, read = problem.conic(gram)
    settings = clarabel.DefaultSettings()
    settings.verbose = False
    begin = time.process_time()
    solution = clarabel.DefaultSolver(P, q, A, b, cones, settings).solve()
    seconds = time.process_time() - begin
    answers = {"Clarabel": (read(np.array(solution.x)), seconds, str(solution.status), solution.iterations, None)}
    for name, own in case["answers"].items():
        answers[name] = (np.array(own["parameters"]), own["time_s"], own["status"], own["iterations"], own["kkt"])
    points = {name: (problem.objective(pi), problem.violation(pi)) for name, (pi, *_) in answers.items()}
    # The best objective among points that satisfy every cone to 1e-9.
    best = min((o for o, v in points.values() if v <= 1e-9 and np.isfinite(o)), default=np.nan)
    figures = {}
    for name, (_, seconds, status, iterations, kkt) in answers.items():
        objective, violation = points[name]
        gap = (objective - best) / (1.0 + abs(best))
        figures[name] = (len(case["bodies"]), seconds, status, iterations, kkt, violation, gap, case["seed"], case["prior"])
    return figures


def table(name, rows):
    seconds, gaps, violations = (np.array([row[k] for row in rows]) for k in (1, 6, 5))
    small = [row[1] for row in rows if row[0] <= 8]
    large = [row[1] for row in rows if row[0] >= 28]
    ms = lambda values: f"{1e3 * np.median(values):.1f}" if len(values) else "-"
    print(f"{name}: {len(rows)} problems, {dict(collections.Counter(row[2] for row in rows))}")
    print(f"  ms: median {ms(seconds)} (to 8 bodies {ms(small)}, from 28 {ms(large)}), 99 % {1e3 * np.quantile(seconds, 0.99):.1f}, worst {1e3 * seconds.max():.1f}, sum {seconds.sum():.1f} s")
    print(f"  iterations: median {np.median([row[3] for row in rows]):.0f}, most {max(row[3] for row in rows)}")
    print(f"  violation of a whitened cone: median {np.median(violations):.1e}, worst {violations.max():.1e}, above 1e-9 in {np.sum(violations > 1e-9)}, above 1e-6 in {np.sum(violations > 1e-6)}")
    gaps = np.where(np.isfinite(gaps), abs(gaps), np.inf)
    print(f"  |objective gap|: median {np.median(gaps):.1e}, 90 % {np.quantile(gaps, 0.9):.1e}, 99 % {np.quantile(gaps, 0.99, method='higher'):.1e}, worst {gaps.max():.1e}; above 1e-6 in {np.sum(gaps > 1e-6)}, above 1e-4 in {np.sum(gaps > 1e-4)}")
    if rows[0][4] is not None:
        print(f"  certificate (stationarity, duality gap): worst {max(row[4] for row in rows):.1e}")
    bad = [row[7] for row, gap in zip(rows, gaps) if gap > 1e-4 or row[5] > 1e-6]
    print(f"  gap above 1e-4 or violation above 1e-6: {len(bad)}, the first seeds {bad[:10]}")


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("file", type=argparse.FileType())
    parser.add_argument("--scaled", action="store_true")
    parser.add_argument("--gram", action="store_true")
    parser.add_argument("--every", type=int, default=1, help="use every N-th problem")
    parser.add_argument("--processes", type=int, default=1)
    options = parser.parse_args()
    figures = collections.defaultdict(list)
    lines = (line for count, line in enumerate(options.file) if count % options.every == 0)
    with multiprocessing.Pool(options.processes) as pool:
        for own in pool.imap(judged, ((line, options.scaled, options.gram) for line in lines)):
            for name, row in own.items():
                figures[name].append(row)
    for name, rows in figures.items():
        table(name, rows)
        for prior in sorted({row[8] for row in rows}):
            own = [row for row in rows if row[8] == prior]
            print(f"  {prior}: {len(own)}, median {1e3 * np.median([row[1] for row in own]):.1f} ms, {dict(collections.Counter(row[2] for row in own))}")


if __name__ == "__main__":
    main()
