"""The ground and its surfaces: published measurements, refusals."""

import math

import pytest

import kickdyn as kd
from kickdyn.flight.follow import bounce
from kickdyn.ground import SURFACES, Surface

RAMP = math.sqrt(2 * 9.81 * 1.0 * 3 / 5)
"""Speed of a ball that rolled down 1 m [m/s]; 2/5 of the energy of a thin shell is in its spin."""

# least and largest rebound height over drop height; speed [m/s], least and largest roll [m]
MEASURED = {
    # FIFA Quality: a ball dropped from 2 m rebounds 0.60 to 0.85 m, and rolls 4 to 10 m
    "turf": ((0.60 / 2, 0.85 / 2), (RAMP, 4.0, 10.0)),
    # and the fast end of that roll on wet grass
    "wet-grass": ((0.60 / 2, 0.85 / 2), (RAMP, 9.8, 10.2)),
    # FIFA Quality Pro: 1.35 to 1.55 m from 2 m on steel; EN 12234: a roll of 12 m
    "hard-floor": ((1.35 / 2, 1.55 / 2), (RAMP, 11.8, 12.2)),
    # RoboCup: from 2 m to 0.5 m; Webots: from 0.841 m/s, a ball rolls 0.621 m
    "carpet": ((0.5 / 2, 0.5 / 2), (0.841, 0.615, 0.63)),
}


@pytest.mark.parametrize("name", MEASURED)
def test_a_surface_bounces_and_rolls_as_measured(name):
    surface, ((low, high), (speed, near, far)) = SURFACES[name], MEASURED[name]
    assert low - 0.005 <= surface.restitution**2 <= high + 0.005
    assert near <= speed**2 / (2 * surface.rolling_deceleration) <= far
    if name in ("wet-grass", "hard-floor"):  # leather, most match balls: Proceedings 2020, 49(1):92
        assert 0.37 <= surface.friction <= 0.45


def test_turf_rebounds_in_the_middle_of_fifas_range_and_keeps_its_share_of_the_speed():
    """0.60 to 0.85 m from 2 m; of 50 km/h at 15 degrees to the ground, 45 to 70 % are left."""
    turf, angle = SURFACES["turf"], math.radians(15)
    middle = (math.sqrt(0.60 / 2) + math.sqrt(0.85 / 2)) / 2
    assert turf.restitution == pytest.approx(middle, abs=5e-3)
    before = kd.BallState(velocity=(50 / 3.6 * math.cos(angle), 0, -50 / 3.6 * math.sin(angle)))
    assert 0.45 <= bounce(before, kd.Ball(), turf).speed / before.speed <= 0.70


def test_surfaces_are_found_by_name_and_have_a_source():
    for name, surface in SURFACES.items():
        assert surface.name == name
        assert surface.source
        assert kd.Ground(surface=name).surface is surface
    assert kd.Ground() == kd.Ground(0.0, None)


@pytest.mark.parametrize(("make", "words"), [
    *((lambda v=v: kd.Ground(v), "ground height is") for v in (math.nan, math.inf, "0", True)),
    (lambda: kd.Ground(surface="ice"), "'ice'.*choose turf"),
    (lambda: kd.Ground(surface=3), "surface is 3"),
    (lambda: Surface("bad", 1.1, 0.5, 1), r"restitution is 1\.1"),
    (lambda: Surface("bad", "air", 0.5, 1), "restitution is 'air'.*inflated"),
    (lambda: Surface("bad", 0.5, -1, 1), "friction is -1"),
    (lambda: Surface("bad", 0.5, 0.5, 0), "rolling deceleration is 0"),
    (lambda: Surface("bad", 0.5, 0.5, 1, 2), "tangential restitution is 2"),
    (lambda: Surface("bad", 0.5, 0.5, 1, -1.1), r"tangential restitution is -1\.1"),
    (lambda: Surface("bad", 0.6, 0.5, 0.7, deviations={"bounce": 0.1}), "'bounce'.*friction"),
    (lambda: Surface("bad", 0.6, 0.5, 0.7, deviations={"friction": -1}), "friction is -1")
])  # fmt: skip
def test_refusals(make, words):
    with pytest.raises(kd.InvalidInput, match=words):
        make()
