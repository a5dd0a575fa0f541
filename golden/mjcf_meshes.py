"""Writes the meshes of golden/mjcf/rules_meshes.xml: a prism with the section of a U, in MuJoCo's three formats.

    python golden/mjcf_meshes.py [--out DIR]

The pyramids between its surface and centroid overlap, so that MuJoCo's modes of mesh inertia give different masses.
"""
import argparse
import struct
from pathlib import Path

import numpy as np

HERE = Path(__file__).resolve().parent
SECTION = [(0, 0), (0.3, 0), (0.3, 0.25), (0.2, 0.25), (0.2, 0.1), (0.1, 0.1), (0.1, 0.2), (0, 0.2)]
# Quadrilaterals of the section, counterclockwise.
PARTS = [(0, 1, 4, 5), (1, 2, 3, 4), (0, 5, 6, 7)]


def prism():
    count = len(SECTION)
    vertices = np.array([(x, y, z) for z in (0.0, 0.12) for x, y in SECTION]) + (0.05, -0.02, 0.11)
    sides = [(k, (k + 1) % count, count + (k + 1) % count, count + k) for k in range(count)]
    ends = [(a, d, c, b) for a, b, c, d in PARTS] + [tuple(count + k for k in part) for part in PARTS]
    return vertices.astype(np.float32), sides + ends


def triangles(quads):
    return [corners for a, b, c, d in quads for corners in ((a, b, c), (a, c, d))]


def obj(vertices, quads):
    lines = [f"v {x:.9g} {y:.9g} {z:.9g}" for x, y, z in vertices]
    corners = [f"f {' '.join(f'{corner + 1}//{1}' for corner in quad)}" for quad in quads]
    # MuJoCo takes the vertices of all groups, but the faces of the first group only.
    extra = ["v 0.5 0.1 0.4", "v 0.6 0.1 0.4", "v 0.5 0.2 0.4", "v 0.5 0.1 0.5", "g second"]
    second = ["f -4 -2 -3", "f -4 -3 -1", "f -3 -2 -1", "f -2 -4 -1"]
    return "\n".join(["vn 0 0 1", "g first", *lines, *corners, *extra, *second]) + "\n"


def stl(vertices, quads):
    faces = triangles(quads)
    body = b"".join(struct.pack("<12fH", 0, 0, 0, *vertices[list(face)].ravel(), 0) for face in faces)
    return bytes(80) + struct.pack("<I", len(faces)) + body


def msh(vertices, quads):
    faces = np.array(triangles(quads), dtype="<i4")
    return struct.pack("<4i", len(vertices), 0, 0, len(faces)) + vertices.astype("<f4").tobytes() + faces.tobytes()


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--out", type=Path, default=HERE / "mjcf" / "meshes", help="output folder")
    out = parser.parse_args().out
    out.mkdir(parents=True, exist_ok=True)
    shape = prism()
    (out / "prism.obj").write_text(obj(*shape))
    (out / "prism.stl").write_bytes(stl(*shape))
    (out / "prism.msh").write_bytes(msh(*shape))


if __name__ == "__main__":
    main()
