"""Random URDF files: trees of joints of all kinds, some of which follow others."""

import numpy as np


def _numbers(*values):
    return " ".join(repr(float(value)) for value in values)


def _inertial(mass, moments, xyz=(0, 0, 0), rpy=(0, 0, 0)):
    moments = "".join(
        f' i{axes}="{x!r}"' for axes, x in zip(("xx", "yy", "zz"), moments, strict=True)
    )
    return (
        f'<inertial><origin xyz="{_numbers(*xyz)}" rpy="{_numbers(*rpy)}"/><mass value="{mass!r}"/>'
        f'<inertia{moments} ixy="0" ixz="0" iyz="0"/></inertial>'
    )


def _sound(rng, share=1.0):
    a, b, c = (share * rng.uniform(0.001, 0.05, size=3)).tolist()  # sums keep the triangle
    place = rng.uniform(-0.2, 0.2, 3), rng.uniform(-3, 3, 3)
    return _inertial(share * rng.uniform(0.2, 8), (a + b, b + c, c + a), *place)


def _joint(rng, kind, parent, child, extra=""):
    axis = rng.normal(size=3)
    return (
        f'<joint name="{child.replace("l", "j")}" type="{kind}"><parent link="{parent}"/>'
        f'<child link="{child}"/><origin xyz="{_numbers(*rng.uniform(-0.4, 0.4, 3))}" '
        f'rpy="{_numbers(*rng.uniform(-3, 3, 3))}"/>'
        f'<axis xyz="{_numbers(*(axis / np.linalg.norm(axis)))}"/>'
        f'<limit lower="-3" upper="3" effort="9" velocity="9"/>{extra}</joint>'
    )


def random_urdf(rng, mimics=0):
    """A tree of 2 to 6 moving joints of all kinds, each with a sound link and odd ones fixed to it.

    Fixed links: a massless one, an impossible one of rounding size, one of mass, none.
    """
    count = int(rng.integers(2 + mimics, 7))
    odd = (_inertial(0, (0, 0, 0)), _inertial(1e-13, (1e-14, 1e-14, 3e-14)), _sound(rng, 0.3), "")
    parts, parents = [f'<link name="l0">{_sound(rng)}</link>'], ["l0"]
    for k in range(1, count + 1):
        kind, gear = ("revolute", "revolute", "prismatic", "continuous")[rng.integers(4)], ""
        if mimics and (k <= 2 or count - mimics < k):
            turns = k == 1 or rng.random() < 0.7
            kind = rng.choice(["revolute", "continuous"]) if turns else "prismatic"
        if count - mimics < k:
            gear = (
                f'<mimic joint="{rng.choice(["j1", "j2"])}" multiplier="{rng.uniform(-2, 2)!r}" '
                f'offset="{rng.uniform(-1, 1)!r}"/>'
            )
        parent = parents[int(rng.integers(max(0, len(parents) - 2), len(parents)))]
        parts += [
            f'<link name="l{k}">{_sound(rng)}</link>',
            _joint(rng, kind, parent, f"l{k}", gear),
        ]
        parts += [f'<link name="l{k}x">{odd[rng.integers(4)]}</link>']
        parts += [_joint(rng, "fixed", f"l{k}", f"l{k}x")]
        parents.append(f"l{k}")
    toe = _joint(rng, "fixed", f"l{rng.integers(1, count + 1)}x", "toe")
    return f'<robot name="tree">{"".join(parts)}<link name="toe"/>{toe}</robot>'
