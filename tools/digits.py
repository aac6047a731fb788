"""How often an impact has fewer digits than it claims: random chains against 50 digits.

`python tools/digits.py --kicks 2000` prints the share of impulses and joints that have, by family.
"""

import argparse
import sys
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pinocchio as pin

import kickdyn as kd

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "tests"))
from chains import random_inertia, random_leg, random_rotation
from references.exact_impact import exact_impact, given


def random_chain(rng, joints, axes=None, sizes=1.0, angles=False):
    """A chain of hinges, and the same chain with hinges only for `given`.

    Link k has `sizes[k]` times the length, and its cube times the mass, of an ordinary one. With
    `angles`, the first joint is a ball joint with three angles; the hinges have massless links.
    """
    sizes = np.broadcast_to(sizes, joints)
    legs = []
    state = rng.bit_generator.state
    for split in (False, True):
        rng.bit_generator.state = state
        model, parent, place = pin.Model(), 0, pin.SE3(random_rotation(rng), rng.normal(size=3))
        for k, size in enumerate(sizes):
            axis = rng.normal(size=3) if axes is None else np.array(axes, float)
            kinds = [pin.JointModelRevoluteUnaligned(axis / np.linalg.norm(axis))]
            if angles and k == 0:
                kinds = [pin.JointModelSphericalZYX()]
                if split:
                    kinds = [pin.JointModelRZ(), pin.JointModelRY(), pin.JointModelRX()]
            for kind in kinds:
                parent = model.addJoint(parent, kind, place, f"joint{model.njoints}")
                place = pin.SE3.Identity()
            body = random_inertia(rng, size)
            model.appendBodyToJoint(parent, body, pin.SE3.Identity())
            turn = random_rotation(rng) if axes is None else np.eye(3)
            place = pin.SE3(turn, size * rng.uniform(-0.4, 0.4, size=3))
        model.addFrame(pin.Frame("toe", parent, 0, place, pin.FrameType.OP_FRAME))
        legs.append(kd.Leg.from_model(model, "toe"))
    return legs


def kick(rng, leg, q, friction=None, graze=0.0):
    """A strike at a posture, with a normal up to 90 degrees from the approach."""
    posture, v = leg.posture(q), rng.normal(size=leg.nv) * 3
    ball = kd.Ball(10 ** rng.uniform(-1.3, 0.3), rng.uniform(0.02, 0.2))
    motion = {"ball_velocity": rng.normal(size=3), "ball_spin": rng.normal(size=3) * 20}
    closing = posture.point_velocity(v) - motion["ball_velocity"]
    direction = closing / np.linalg.norm(closing)
    aside = np.cross(direction, rng.normal(size=3))
    normal = direction + rng.uniform(0, 0.8) * aside / np.linalg.norm(aside)
    if graze:
        normal = aside / np.linalg.norm(aside) + graze * direction
    mu = rng.choice([0.0, 0.2, 0.4, 1.0, 3.0]) if friction is None else friction
    return kd.strike(posture, v, ball, kd.Contact(normal, rng.uniform(0, 1), mu), **motion)


def ordinary(rng):
    """A random leg with links of ordinary size."""
    leg = random_leg(rng)
    return kick(rng, leg, rng.uniform(-2, 2, size=leg.nq)), leg


def light_foot(rng):
    """A leg whose last link has down to a thousandth of the others' mass."""
    leg = random_leg(rng, last=10 ** rng.uniform(-3, 0))
    return kick(rng, leg, rng.uniform(-2, 2, size=leg.nq)), leg


def short_links(rng):
    """A chain with links down to a hundredth of the ordinary length."""
    joints = rng.integers(2, 8)
    leg, same = random_chain(rng, joints, sizes=10 ** rng.uniform(-2, 0, size=joints))
    return kick(rng, leg, rng.uniform(-2, 2, size=joints)), same


def parallel(rng):
    """A chain whose hinges are parallel."""
    joints = rng.integers(2, 8)
    axis = rng.choice([[0, 1, 0], [0.48, 0.6, 0.64]])
    leg, same = random_chain(rng, joints, axis, 10 ** rng.uniform(-1, 0, size=joints))
    return kick(rng, leg, rng.uniform(-2, 2, size=joints)), same


def gimbal(rng):
    """A chain with three angles at its root, near the gimbal lock of these."""
    joints = rng.integers(1, 5)
    leg, same = random_chain(rng, joints, angles=True)
    q = rng.uniform(-2, 2, size=leg.nq)
    q[1] = np.pi / 2 * rng.choice([-1, 1]) + rng.choice([-1, 1]) * 10 ** rng.uniform(-6, 0)
    return kick(rng, leg, q), same


def grazing(rng):
    """A foot that moves nearly along the ball's surface."""
    leg = random_leg(rng)
    q = rng.uniform(-2, 2, size=leg.nq)
    return kick(rng, leg, q, graze=10 ** rng.uniform(-13, -1)), leg


def weak_slip(rng):
    """A slip that the contact hardly resists: mu is sought for which n . G (n + mu t) is small."""
    fast = 10 ** rng.uniform(2, 10)  # so that the impulse, however large, does not stop it
    share = 300.0 / fast
    while True:
        leg = random_leg(rng, joints=rng.integers(1, 4))
        posture, v = leg.posture(rng.uniform(-2, 2, size=leg.nq)), 3 * rng.normal(size=leg.nv)
        foot = posture.point_velocity(v)
        foot /= np.linalg.norm(foot)
        normal = foot + rng.uniform(0.5, 2) * np.cross(foot, rng.normal(size=3))
        ball = kd.Ball(10 ** rng.uniform(0, 3), 0.1)
        spin, mu, resists = -fast * np.cross(normal, foot), 0.05, 1.0
        for _ in range(20):
            contact = kd.Contact(normal, 0.5, mu)
            hit = kd.strike(posture, v, ball, contact, ball_spin=spin)
            n, problem = contact.normal, hit.approach.contact_problem()
            (axes,), _ = rotations, _ = problem.in_contact_axes()
            g = axes @ problem.delassus(rotations) @ axes.T
            along = hit.impulse - (n @ hit.impulse) * n
            along /= np.linalg.norm(along)
            if hit.sticking or n @ g @ along >= 0:
                break
            resists = n @ g @ (n + mu * along) / (n @ g @ n)
            if resists < 2 * share:
                return hit, leg
            mu -= 0.9 * (resists - share) * (n @ g @ n) / (n @ g @ along)


FAMILIES = {
    one.__name__: one
    for one in (ordinary, light_foot, short_links, parallel, gimbal, grazing, weak_slip)
}


def shortfalls(family, seed):
    """Return error times 10^digits of impulse and joints, above 1 if the claim is false."""
    rng = np.random.default_rng([list(FAMILIES).index(family), seed])
    while True:
        try:
            hit, same = FAMILIES[family](rng)
            structure, scene = given(_with_leg(hit, same))
            exact = exact_impact(structure, scene)
        except (kd.KickdynError, ArithmeticError):  # no kick, or no slip that the reference finds
            continue
        if exact["energy lost"].error(hit.energy_lost) < 0.1 or hit.digits < 1:
            break  # else another slip of several, one of which the reference does not find
    impulse = exact["impulse"].error(hit.impulse) * 10**hit.digits
    last = [exact[f"joint {i + 1}"] for i in range(len(structure["parents"]))]
    last = last[len(last) - len(hit.joint_impulses) :]
    joints = []
    for wrench, answer, digits in zip(hit.joint_impulses, last, hit.joint_digits, strict=True):
        exactly = answer.exact[:3]
        size = float(exactly @ exactly) ** 0.5
        error = np.linalg.norm([float(one) for one in wrench[:3] - exactly])
        joints.append(error / size * 10**digits if size else 0.0)
    return impulse, joints, hit


def _with_leg(hit, leg):
    """What `given` reads of an impact, with another leg that has the same numbers."""
    posture = SimpleNamespace(leg=leg, q=hit.posture.q)
    names = ("ball", "contact", "ball_before", "v_before")
    return SimpleNamespace(posture=posture, **{name: getattr(hit, name) for name in names})


def main():
    """Print a row for each family."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--kicks", type=int, default=2000, help="in all")
    count = parser.parse_args().kicks // len(FAMILIES)
    print(f"{'family':12}{'kicks':>7}{'false':>7}{'worst':>8}{'joints false':>14}{'worst':>8}")
    for family in FAMILIES:
        found = [shortfalls(family, seed)[:2] for seed in range(count)]
        of_impulse, of_joints = (np.array([np.max(one[k]) for one in found]) for k in (0, 1))
        print(
            f"{family:12}{count:7}{(of_impulse > 1).sum():7}{of_impulse.max():8.2f}"
            f"{(of_joints > 1).sum():14}{of_joints.max():8.2f}", flush=True,
        )  # fmt: skip


if __name__ == "__main__":
    main()
