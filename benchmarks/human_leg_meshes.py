"""The meshes that draw the human leg of urdf/leg_human.urdf: python benchmarks/human_leg_meshes.py.

They are for the eye alone: no computation of an impact uses them, and the inertial values of the
leg are those of the paper's Table 1. Each body is a stack of cross-sections, which are ellipses or,
with a larger exponent, rounded rectangles.
"""

from pathlib import Path

import numpy as np
import trimesh
from scipy.interpolate import PchipInterpolator

FOLDER = Path(__file__).resolve().parent.parent / "urdf" / "meshes"
AROUND, ALONG = 28, 20
"""Corners of a cross-section, and cross-sections of a body."""

# Downwards: height, centre towards the toe, half depth, half width [m], in the link's frame.
PELVIS = """
 0.150 0 0     0      0.146 0 0.070 0.080   0.130 0 0.090 0.098   0.060 0 0.095 0.100
 0.000 0 0.086 0.089 -0.050 0 0.066 0.068  -0.080 0 0.030 0.030  -0.085 0 0     0
"""
SHORTS = """
 0.090 0     0     0      0.080 0     0.050 0.050   0.030 0     0.090 0.094
-0.030 0.002 0.093 0.095 -0.060 0.004 0.094 0.094  -0.150 0.008 0.096 0.092
-0.160 0.008 0.095 0.091 -0.163 0.008 0     0
"""
THIGH = """
 0.075 0     0     0      0.060 0     0.045 0.045   0.020 0     0.077 0.078
-0.060 0.004 0.084 0.082 -0.160 0.008 0.077 0.073  -0.280 0.004 0.060 0.058
-0.345 0.002 0.054 0.053 -0.371 0.002 0.054 0.053  -0.400 0.001 0.044 0.044
-0.418 0     0.024 0.024 -0.424 0     0     0
"""
SHANK = """
 0.045  0     0     0      0.041  0     0.021 0.021   0.026  0     0.040 0.039
 0.000  0     0.046 0.045 -0.050 -0.004 0.049 0.048  -0.120 -0.013 0.055 0.053
-0.200 -0.011 0.049 0.047 -0.300 -0.004 0.036 0.034  -0.380  0     0.030 0.028
-0.443  0     0.031 0.029 -0.460  0     0.026 0.024  -0.474  0     0     0
"""

# From heel to toe: distance ahead of the ankle, lower and upper edge, half width [m]. The toe ends
# at the leg's contact point, 0.145 m ahead of the ankle and as high.
BOOT = """
-0.060 -0.026 -0.026 0     -0.056 -0.043 -0.008 0.016  -0.044 -0.057  0.014 0.028
-0.020 -0.062  0.042 0.035  0.008 -0.062  0.050 0.036   0.034 -0.059  0.041 0.036
 0.065 -0.053  0.025 0.038  0.095 -0.046  0.014 0.041   0.120 -0.039  0.008 0.039
 0.135 -0.033  0.003 0.032  0.143 -0.026 -0.003 0.021   0.146 -0.014 -0.014 0
"""
SOLE_HEIGHT, SOLE_EDGE = 0.014, 0.003
"""Of the sole: its thickness, and how far it stands out from the boot [m]."""


def stack(
    stations: np.ndarray, half: np.ndarray, centre: np.ndarray, power: float
) -> trimesh.Trimesh:
    """Return the body around cross-sections: along x, with half sizes and centres in y and z.

    Args:
        stations: along x, shape `(n,)` [m].
        half: half sizes in y and z, shape `(n, 2)`, 0 at both ends.
        centre: centres in y and z, likewise.
        power: exponent of the cross-section; 2 is an ellipse.
    """
    angle = 2 * np.pi * np.arange(AROUND) / AROUND
    ring = np.column_stack([np.cos(angle), np.sin(angle)])
    ring = np.sign(ring) * np.abs(ring) ** (2 / power)
    points = np.concatenate([np.broadcast_to(stations[:, None, None], (len(stations), AROUND, 1)),
                             centre[:, None] + half[:, None] * ring], axis=2)  # fmt: skip
    first = AROUND * np.arange(len(stations) - 1)[:, None]
    a, b = first + np.arange(AROUND), first + (np.arange(AROUND) + 1) % AROUND
    quads = np.stack([a, b, b + AROUND, a, b + AROUND, a + AROUND], -1).reshape(-1, 3)
    body = trimesh.Trimesh(points.reshape(-1, 3), quads, process=True)
    body.update_faces(body.nondegenerate_faces())
    body.fix_normals()
    return body


def smooth(sections: str) -> np.ndarray:
    """Return more cross-sections, denser at both ends, on monotone cubics through those given."""
    rows = np.array(sections.split(), dtype=float).reshape(-1, 4)
    run = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(rows, axis=0), axis=1))])
    share = (1 - np.cos(np.pi * np.arange(ALONG + 1) / ALONG)) / 2
    share = (share + np.arange(ALONG + 1) / ALONG) / 2
    return np.asarray(PchipInterpolator(run, rows)(run[-1] * share))


def limb(sections: str) -> trimesh.Trimesh:
    """Return a body whose sections are level."""
    height, ahead, depth, width = smooth(sections).T
    body = stack(-height, np.column_stack([width, depth]), np.column_stack([0 * ahead, ahead]), 2.0)
    turn = np.eye(4)
    turn[:3, :3] = [[0, 0, 1], [0, 1, 0], [-1, 0, 0]]  # what was along x points down, z ahead
    return body.apply_transform(turn)


def boot(*, sole: bool) -> trimesh.Trimesh:
    """Return the boot, or its sole alone."""
    ahead, low, high, width = smooth(BOOT).T
    if sole:
        grow = np.where(width > 0, SOLE_EDGE, 0.0)
        high = np.minimum(low + SOLE_HEIGHT, high)
        low, width = low - grow, width + grow
    half = np.column_stack([width, (high - low) / 2])
    centre = np.column_stack([0 * ahead, (high + low) / 2])
    return stack(ahead, half, centre, 3.5 if sole else 2.6)


def pin() -> trimesh.Trimesh:
    """Return a cylinder along y, 1 m long and of radius 1 m, which the URDF scales."""
    along_y = trimesh.transformations.rotation_matrix(np.pi / 2, (1, 0, 0))
    return trimesh.creation.cylinder(1.0, 1.0, sections=32, transform=along_y)


def main() -> None:
    """Write the meshes."""
    bodies = {
        "pelvis": limb(PELVIS),
        "shorts": limb(SHORTS),
        "thigh": limb(THIGH),
        "shank": limb(SHANK),
        "boot": boot(sole=False),
        "sole": boot(sole=True),
        "pin": pin(),
    }
    for name, body in bodies.items():
        file = FOLDER / f"human_{name}.stl"
        body.export(file)
        print(f"{file.name}: {len(body.faces)} triangles, {file.stat().st_size / 1e3:.0f} kB, "
              f"closed: {body.is_watertight}")  # fmt: skip


if __name__ == "__main__":
    main()
