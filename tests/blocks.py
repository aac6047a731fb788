"""Blocks of made-up sweeps, for reductions: values with ties, cut and shuffled in any way."""

import numpy as np

from kickdyn.sweeps.block import Block, Space
from kickdyn.sweeps.expression import Expression

SPACE = Space.of(
    {
        "hip": np.radians(np.arange(7.0)),
        "knee": np.radians(np.arange(5.0)),
        "slide": np.arange(3.0),
    },
    {"hip": "rad", "knee": "rad", "slide": "m"},
)


def made_up(seed):
    """Return the whole space as one block; a third of the values are ties."""
    random = np.random.default_rng(seed)
    speed = random.choice(np.concatenate([random.normal(size=30), [0.1, 0.1]]), SPACE.size)
    load = random.choice(random.lognormal(sigma=8.0, size=40), SPACE.size)
    columns = {"ball_speed": speed, "worst_joint_impulse": load, "launch_angle": speed}
    return Block(SPACE, np.arange(SPACE.size), columns.__getitem__)


def in_any_order(block, fresh, seed):
    """Reduce pieces of a block, one of them empty, on their own; merge them in any order."""
    random = np.random.default_rng(seed)
    piece = random.integers(0, 12, block.numbers.size)
    parts = [fresh() for _ in range(7)]
    for k in random.permutation(12):
        parts[k // 2].update(block.pick(piece == k))
    while len(parts) > 1:
        one = parts.pop(random.integers(len(parts)))
        parts[random.integers(len(parts))].merge(one)
    return parts[0]


def number(text):
    """Return an expression over the space."""
    return Expression(text, SPACE.units, "number")
