"""A held robot from its definition: rows by differences of frames' places, one dense system.

Of kickdyn nothing, of Pinocchio places of frames and momenta of joints: no Jacobian, no
joint-space inertia, no factor.
"""

import numpy as np
import pinocchio as pin

STEP = 1e-3
STENCIL = ((-2, 1 / 12), (-1, -2 / 3), (1, 2 / 3), (2, -1 / 12))
"""Of the derivative: the error is of fourth order, below 1e-10 with this step."""


def rows_of(leg, q, frame, offset=(0.0, 0.0, 0.0)):
    """Linear velocity of a point of a frame, then angular, per joint velocity, `(6, nv)`."""
    model = leg.model
    data, number = model.createData(), model.getFrameId(frame)
    pin.framesForwardKinematics(model, data, q)
    here = data.oMf[number].rotation.copy()
    rows = np.zeros((6, leg.nv))
    for column, unit in enumerate(np.eye(leg.nv)):
        for steps, weight in STENCIL:
            pin.framesForwardKinematics(model, data, pin.integrate(model, q, steps * STEP * unit))
            place = data.oMf[number]
            rows[:3, column] += weight / STEP * place.act(np.array(offset))
            rows[3:, column] += weight / STEP * pin.log3(place.rotation @ here.T)
    return rows


def inertia_of(leg, q):
    """Joint-space inertia, column by column: what it takes to set off with a unit velocity."""
    model = leg.model
    model.gravity = pin.Motion.Zero()
    data, still = model.createData(), np.zeros(leg.nv)
    return np.column_stack([pin.rnea(model, data, q, still, unit) for unit in np.eye(leg.nv)])


def held_rows(leg, q):
    """Rows of all supports, one below the other."""
    return np.vstack(
        [rows_of(leg, q, support.frame)[: support.size] for support in leg.constraints.supports]
    )


def solved(inertia, rows, impulse):
    """Jump, and impulses of the constraints, the smallest if there are several.

    M jump = impulse + A^T reaction and A jump = 0, as one system.
    """
    n, m = rows.shape[1], len(rows)
    system = np.block([[inertia, -rows.T], [rows, np.zeros((m, m))]])
    answer = np.linalg.lstsq(system, np.concatenate([impulse, np.zeros(m)]), rcond=1e-9)[0]
    return answer[:n], answer[n:]
