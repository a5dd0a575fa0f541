"""Whether a motion touches the floor or itself, by Pinocchio and Coal: a referee that shares nothing with Dynident.

    python3 benchmarks/contact.py ROBOT.urdf DIR [PACKAGE_DIR ..]

DIR is what `dynident design --out DIR` wrote. Collision shapes are the description's, meshes as convex hulls. Pairs on one joint, on neighbours, and pairs that
touch in the neutral posture (every joint at zero or as near as its limits allow) are left out; so is the floor for links that cannot leave it. Needs pin (PyPI).
"""

import json
import sys
from pathlib import Path

import coal
import numpy as np
import pinocchio as pin

EVERY = 5  # samples of the trajectory


def hulls(shapes):
    for shape in shapes.geometryObjects:
        if isinstance(shape.geometry, coal.BVHModelBase):
            shape.geometry.buildConvexRepresentation(False)
            shape.geometry = shape.geometry.convex


def main():
    urdf, out, folders = sys.argv[1], Path(sys.argv[2]), sys.argv[3:]
    design = json.loads((out / "design.json").read_text())
    rows = np.loadtxt(out / "trajectory.csv", delimiter=",", skiprows=1)
    model = pin.buildModelFromUrdf(urdf)
    shapes = pin.buildGeomFromUrdf(model, urdf, pin.GeometryType.COLLISION, None, folders or [str(Path(urdf).parents[3])])
    hulls(shapes)
    data, placed = model.createData(), pin.GeometryData(shapes)
    places = [(model.joints[model.getJointId(name)], 1 + k) for k, name in enumerate(design["joints"])]

    def configuration(row):
        q = pin.neutral(model)
        for joint, column in places:
            x = row[column]
            if joint.nq == 2:
                q[joint.idx_q : joint.idx_q + 2] = np.cos(x), np.sin(x)
            else:
                q[joint.idx_q] = x
        return q

    zero = np.zeros(1 + len(places))
    for joint, column in places:
        if joint.nq == 1:
            low, high = model.lowerPositionLimit[joint.idx_q], model.upperPositionLimit[joint.idx_q]
            zero[column] = min(max(0.0, low), high)

    def distance(i, j):
        a, b = shapes.geometryObjects[i], shapes.geometryObjects[j]
        request, result = coal.DistanceRequest(), coal.DistanceResult()
        return coal.distance(a.geometry, placed.oMg[i], b.geometry, placed.oMg[j], request, result)

    def lowest(i):
        geometry = shapes.geometryObjects[i].geometry
        down = placed.oMg[i].rotation.T @ np.array([0.0, 0.0, -1.0])
        if isinstance(geometry, coal.Sphere):
            return placed.oMg[i].translation[2] - geometry.radius
        if isinstance(geometry, coal.Capsule):
            return placed.oMg[i].translation[2] - abs(down[2]) * geometry.halfLength - geometry.radius
        if isinstance(geometry, coal.Cylinder):
            return placed.oMg[i].translation[2] - abs(down[2]) * geometry.halfLength - np.hypot(*down[:2]) * geometry.radius
        if isinstance(geometry, coal.Box):
            return placed.oMg[i].translation[2] - np.abs(down) @ geometry.halfSide
        return placed.oMg[i].translation[2] - max(down @ geometry.point(k) for k in range(geometry.num_points))

    def place(q):
        pin.updateGeometryPlacements(model, data, shapes, placed, q)

    parent = [shape.parentJoint for shape in shapes.geometryObjects]
    place(configuration(zero))
    links = [shape.parentFrame for shape in shapes.geometryObjects]
    touching = {
        frozenset((links[i], links[j])) for i in range(len(parent)) for j in range(i) if distance(i, j) <= 0.0
    }
    pairs = [
        (i, j)
        for i in range(len(parent))
        for j in range(i)
        if parent[i] != parent[j]
        and model.parents[parent[i]] != parent[j]
        and model.parents[parent[j]] != parent[i]
        and frozenset((links[i], links[j])) not in touching
    ]
    rng = np.random.default_rng(1)
    highest = np.full(len(parent), -np.inf)
    for _ in range(300):
        row = zero.copy()
        for joint, column in places:
            low, high = (-np.pi, np.pi) if joint.nq == 2 else (model.lowerPositionLimit[joint.idx_q], model.upperPositionLimit[joint.idx_q])
            row[column] = rng.uniform(max(low, -10), min(high, 10))
        place(configuration(row))
        highest = np.maximum(highest, [lowest(i) for i in range(len(parent))])
    has_floor = not any(text.startswith("floor") for text in design["not_checked"])
    least, deepest = np.inf, np.inf
    for row in rows[::EVERY]:
        place(configuration(row))
        for i, j in pairs:
            d = distance(i, j)
            if d < least:
                least, of = d, (links[i], links[j])
        for i in range(len(parent)):
            if has_floor and parent[i] > 0 and highest[i] > 0.0:
                deepest = min(deepest, lowest(i))
    names = [model.frames[k].name for k in of] if np.isfinite(least) else []
    fine = bool(design["feasible"]) and least > 0.0 and deepest > 0.0
    print(f"{Path(urdf).stem}: feasible {design['feasible']}, {len(pairs)} pairs of shapes, least distance {least:.4f} m {names}, lowest {deepest:.4f} m: {'ok' if fine else 'TOUCHES'}")
    return 0 if fine else 1


if __name__ == "__main__":
    sys.exit(main())
