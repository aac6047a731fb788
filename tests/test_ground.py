import dataclasses
import math

import pytest

import kickdyn as kd
from kickdyn.ground import SURFACES, Surface


@pytest.mark.parametrize("height", [math.nan, math.inf, "0", None, True, [0.0]], ids=repr)
def test_ground_refuses(height):
    with pytest.raises(kd.InvalidInput, match=r"ground height is .*finite number \[m\]"):
        kd.Ground(height)


@pytest.mark.parametrize("height", [0, -3.5, 8848])
def test_ground_is_level_and_frozen(height):
    ground = kd.Ground(height)
    assert ground.height == height
    with pytest.raises(dataclasses.FrozenInstanceError):
        ground.height = 0.0


def test_ground_is_at_zero_unless_named():
    assert kd.Ground() == kd.Ground(0.0)


def test_surfaces_have_names_and_sources():
    for name, surface in SURFACES.items():
        assert surface.name == name
        assert surface.source
        assert kd.Ground(surface=name).surface is surface


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ((1.1, 0.5, 1), r"ground restitution is 1\.1"),
        (("air", 0.5, 1), "ground restitution is 'air': .* or a model's name: .*inflated"),
        ((0.5, -1, 1), "ground friction is -1"),
        ((0.5, 0.5, 0), "rolling deceleration is 0"),
        ((0.5, 0.5, 1, 2), "tangential restitution is 2"),
    ],
)
def test_bad_surfaces(arguments, words):
    with pytest.raises(kd.InvalidInput, match=words):
        Surface("bad", *arguments)


@pytest.mark.parametrize("surface", ["ice", 3])
def test_unknown_surfaces(surface):
    with pytest.raises(kd.InvalidInput, match=r"surface (is 3|'ice' is unknown: choose turf)"):
        kd.Ground(surface=surface)


@pytest.mark.parametrize(
    ("deviations", "message"),
    [
        ({"bounce": 0.1}, "deviations has 'bounce'"),
        ({"friction": -1}, "deviation of friction is -1"),
    ],
)
def test_a_surface_refuses_other_deviations(deviations, message):
    with pytest.raises(kd.InvalidInput, match=message):
        kd.Surface("lawn", 0.6, 0.5, 0.7, deviations=deviations)
