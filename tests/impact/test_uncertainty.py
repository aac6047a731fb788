"""Uncertainty budgets: by derivatives, by differences, and as sums of their parts."""

import dataclasses

import numpy as np
import pytest
from digits import FAMILIES, shortfalls
from extremes import extreme_impacts
from references.exact_impact import exact_impact, given
from shown_numbers import numbers_of
from tolerances import agrees, closed_form, differenced

import kickdyn as kd
from kickdyn.impact.uncertainty import _spread

LEG = kd.Leg.human()
Q, V = np.radians([5, 10, -5]), np.array([0.1, -2.0, -1.0])
RESULTS = ("impulse", "velocity", "spin")


def kick(q=Q, v=V, e=0.7, friction=0.0, normal=(2, 0.3, 1), mass=0.43, **options):
    contact = kd.Contact(normal, e, friction)
    return kd.strike(LEG.posture(q), v, kd.Ball(mass), contact, **options)


@pytest.mark.parametrize("friction", [0.0, 0.1, 3.0])
def test_covariances_follow_from_the_derivatives(friction):
    """J Sigma J^T summed over the sources, without friction, slipping and sticking.

    Of numbers, of one deviation for each component, and of a covariance that is singular.
    """
    deviations = {"q": [0.004, 0.006, 0.008], "restitution": 0.01, "normal": 0.005,
                  "v": np.array([[4.0, 2.0, 0.0], [2.0, 1.0, 0.0], [0.0, 0.0, 9.0]]) * 1e-4,
                  "ball_mass": 0.004}  # fmt: skip
    spread = deviations | {"q": np.diag([0.004, 0.006, 0.008]) ** 2, "restitution": [[1e-4]],
                           "normal": 0.005**2 * np.eye(3), "ball_mass": [[1.6e-5]]}  # fmt: skip
    impact = kick(friction=friction)
    ours, slopes = impact.uncertainty(**deviations), impact.sensitivity()

    def covariance(jacobians):
        return sum(jacobians[name] @ np.array(s) @ jacobians[name].T for name, s in spread.items())

    for result in RESULTS:
        agrees(getattr(ours, result), covariance(getattr(slopes, result)), closed_form(10))
    p, v = (x / np.linalg.norm(x) for x in (impact.impulse, impact.ball_after.velocity))
    right = np.sqrt([p @ ours.impulse @ p, v @ ours.velocity @ v])
    assert [ours.impulse_size, ours.speed] == pytest.approx(right, rel=closed_form(10))
    loads = kd.joint_loads(impact)
    for k, (name, joint) in enumerate(ours.joints.items()):
        exact = covariance({s: slopes.joint_impulses[s][k] for s in spread})
        agrees(joint.impulse, exact, closed_form(10))
        across = np.eye(6)
        across[4, 4] = 0.0  # all axes are y
        agrees(joint.structure, across @ exact @ across, closed_form(100))
        assert np.abs(joint.axis).max() <= closed_form(100) * np.abs(exact).max()
        load = loads[name].structure + loads[name].axis
        sizes = [np.linalg.norm(load[:3]), np.linalg.norm(load[3:])]
        assert [joint.force, joint.moment] == pytest.approx(sizes, rel=closed_form())
        for deviation, part in ((joint.force_deviation, slice(3)),
                                (joint.moment_deviation, slice(3, 6))):  # fmt: skip
            direction = load[part] / np.linalg.norm(load[part])
            expected = np.sqrt(direction @ exact[part, part] @ direction)
            assert deviation == pytest.approx(expected, rel=closed_form(100)), name


def test_a_ball_that_moves_and_the_axis_of_a_rotor_by_differences():
    """Of the joint velocity alone. The ball's velocity afterwards is not along the impulse."""
    posture, h = LEG.with_armature({"knee": 0.05}).posture(Q), 1e-5

    def struck(v):
        contact = kd.Contact((2, 0.3, 1), 0.7, 0.1)
        return kd.strike(posture, v, kd.Ball(), contact, ball_velocity=(-6, 3, -2))

    def read(v):
        hit = struck(v)
        load = kd.joint_loads(hit)["knee"]
        return np.array([*load.structure, *load.axis, hit.ball_after.speed])

    rows = np.transpose([(read(V + step) - read(V - step)) / (2 * h) for step in h * np.eye(3)])
    ours, right = struck(V).uncertainty(v=0.1), 0.01 * rows @ rows.T
    agrees(ours.joints["knee"].structure, right[:6, :6], differenced())
    agrees(ours.joints["knee"].axis, right[6:12, 6:12], differenced())
    assert ours.speed == pytest.approx(np.sqrt(right[12, 12]), rel=differenced())


def test_shares_are_those_of_the_sources_alone():
    spread = {"q": 0.01, "v": 0.05, "ball_spin": 1.0, "link_mass": [0.1, 0.05, 0.02]}
    impact = kick(friction=0.1)
    ours = impact.uncertainty(**spread)
    alone = [impact.uncertainty(**{name: value}) for name, value in spread.items()]
    deviations = {name: [one.joints[name].force_deviation for one in alone] for name in ours.joints}
    for name, joint in ours.joints.items():
        assert list(joint.by_source.values()) == pytest.approx(deviations[name], rel=closed_form())
    deviations |= {x: np.sqrt([np.trace(getattr(one, x)) for one in alone]) for x in RESULTS}
    deviations |= {x: [getattr(one, x) for one in alone] for x in ("impulse_size", "speed")}
    for result, sizes in deviations.items():
        right = dict(zip(spread, np.square(sizes) / np.sum(np.square(sizes)), strict=True))
        assert ours.share(result) == pytest.approx(right, rel=closed_form(10))
    with pytest.raises(kd.InvalidInput, match=r"'size' is unknown.*impulse_size.*knee"):
        ours.share("size")


def test_the_distance_to_the_other_branch():
    """A friction d above the edge is d / sigma away; independent sources add in quadrature."""
    impact = kick(friction=5.0)
    n, p = impact.contact.normal, impact.impulse
    edge = np.linalg.norm(p - (n @ p) * n) / (n @ p)
    for distance, sigmas in ((0.005, 0.5), (0.05, 5.0)):
        ours = kick(friction=edge + distance).uncertainty(friction=0.01)
        right = pytest.approx(sigmas, rel=closed_form(1e3))
        assert (ours.branch, ours.branch_sigmas) == ("stick", right)
    assert kick(friction=edge).uncertainty(friction=0.01).branch_sigmas == 0.0
    assert kick().uncertainty(v=0.1).branch_sigmas == np.inf
    slipping, spread = kick(friction=0.1), {"v": 0.1, "friction": 0.02}
    alone = [slipping.uncertainty(**{name: x}).branch_sigmas for name, x in spread.items()]
    right = 1 / np.hypot(1 / alone[0], 1 / alone[1])
    assert slipping.uncertainty(**spread).branch_sigmas == pytest.approx(right, rel=closed_form())
    strong, stronger = (kick(friction=mu).uncertainty(v=0.1) for mu in (1e100, 1e300))
    assert stronger.branch_sigmas == pytest.approx(strong.branch_sigmas)


def test_the_budget_has_deviations_and_shares_by_source():
    """Of `by_source`; of joints the six with the largest impulses, and how many are left out."""
    leg = kd.Leg.from_robot("g1", legs_only=True)
    posture = leg.posture(leg.configuration({"right_knee_joint": 0.5}))
    contact = kd.Contact((4, 0.5, 1), 0.7, 0.1)
    hit = kd.strike(posture, posture.joint_velocity((4, 0, 1)), kd.Ball(), contact)
    ours = hit.uncertainty(v=0.05, restitution=0.03, friction=0.02)
    _, _, *lines = str(ours).splitlines()
    names = ("impulse_size", "speed", "velocity", "spin")
    variances = {source: [np.trace(of[name]) for name in names]
                 for source, of in ours.by_source.items()}  # fmt: skip
    total = np.sum(list(variances.values()), axis=0)
    for line, (source, variance) in zip(lines, variances.items(), strict=False):
        right = np.column_stack([np.sqrt(variance), 100 * np.array(variance) / total]).ravel()
        assert line.split()[0] == source
        assert [x.value for x in numbers_of(line)] == pytest.approx(right, rel=6e-3, abs=0.06)
    assert [x.value for x in numbers_of(lines[3])] == pytest.approx(np.sqrt(total), rel=6e-3)
    assert f"sticks; slipping is {ours.branch_sigmas:.2g} standard" in lines[5]
    loads = sorted(ours.joints.items(), key=lambda item: -item[1].force)
    rows = {line.split()[0]: line for line in lines[8:-1]}
    assert rows.keys() == {name for name, _ in loads[:6]}
    for name, x in loads[:6]:
        right = x.force, x.force_deviation, x.moment, x.moment_deviation
        assert [x.value for x in numbers_of(rows[name])] == pytest.approx(right, rel=6e-3)
    assert lines[-1].startswith(f"{leg.nv - 6} more")


@pytest.mark.parametrize(("spread", "words"), [
    ({}, "no source"), ({"q": 0.1, "size": 0.1}, "source 'size' is unknown: .*q, v"),
    ({"q": -0.1}, r"spread of q is -0\.1"), ({"q": [0.1, 0.2]}, r"spread of q has shape \(2,\)"),
    ({"v": np.diag([1.0, 1.0, -1.0])}, "eigenvalue of -1"),
    ({"v": np.eye(3) + np.eye(3, k=2)}, "symmetric"), ({"restitution": [[0.1]]}, r"shape \(1, 1\)"),
    ({"q": 1e200}, r"spread of q is 1e\+200"), ({"friction": np.nan}, "friction is nan"),
    ({"q": 5}, "spread of q is 5 rad"), ({"normal": 4 * np.eye(3)}, "spread of normal is 2 rad")
])  # fmt: skip
def test_bad_input(spread, words):
    with pytest.raises(kd.InvalidInput, match=words):
        kick().uncertainty(**spread)


HARSH = [*extreme_impacts.heavy_balls(), *list(extreme_impacts.cancellations())[:4],
         *extreme_impacts.short_links(), *extreme_impacts.masses()]  # fmt: skip


@pytest.mark.parametrize("family", FAMILIES)
def test_no_claim_is_false(family):
    """A few of the kicks that `python tools/digits.py` measures by the thousand."""
    for seed in range(4):
        impulse, joints, impact = shortfalls(family, seed)
        assert impulse < 1.0, seed
        assert max(joints) < 1.0, seed
        usual = family in ("ordinary", "light_foot", "short_links", "parallel")
        assert impact.digits > 12 or not usual or impact.approach_speed < 0.1, seed


@pytest.mark.parametrize("kick", HARSH, ids=lambda kick: kick.name)
def test_an_extreme_impact_has_the_digits_that_it_claims(kick):
    impact = kick.impact()
    exact = exact_impact(*given(impact))
    assert exact["impulse"].error(impact.impulse) < 10**-impact.digits
    for i, digits in enumerate(impact.joint_digits):
        assert exact[f"joint {i + 1}"].error(impact.joint_impulses[i]) < 10**-digits


def test_digits_fall_with_what_cancels():
    """A share s of the speed that remains costs -log10(s) digits, and a ball's mass likewise."""
    usual = extreme_impacts.usual("", kd.Contact(extreme_impacts.OBLIQUE, 0.8, 0.4))
    assert 14 < usual.impact().digits < 16
    approaches = [kick.impact() for kick in list(extreme_impacts.cancellations())[:4]]
    speeds, digits = np.array([[impact.approach_speed, impact.digits] for impact in approaches]).T
    np.testing.assert_allclose(np.diff(digits), np.diff(np.log10(speeds)), atol=0.3)
    heavy = [kick.impact().digits for kick in list(extreme_impacts.heavy_balls())[1::2]]
    assert np.diff(heavy).max() < -2


def test_the_speeds_that_cancel_are_those_along_the_links():
    """Of thigh, shank and foot of 0.371, 0.443 and 0.145 m, however they are bent."""
    posture, v = kd.Leg.human().posture([0.4, 1.5, 0.1]), np.array([[2.0, 0.0], [-3, 1], [4, 0]])
    right = [2 * (0.371 + 0.443 + 0.145) + 3 * (0.443 + 0.145) + 4 * 0.145, 0.443 + 0.145]
    assert _spread(posture, v) == pytest.approx(right)


@pytest.mark.parametrize(("share", "creates"), [(1e-13, False), (1e-11, True)])
@pytest.mark.parametrize("mass", [1e-6, 0.4])
def test_energy_within_the_rounding_of_a_fast_spin_is_not_created(share, creates, mass):
    posture, ball = kd.Leg.human().posture([0.1, 0.2, 0.3]), kd.Ball(mass)
    v, contact = posture.joint_velocity((3, 0, 1)), kd.Contact((3, 0, 1), 0.8, 0.4)
    impact = kd.strike(posture, v, ball, contact, ball_spin=(0.0, 1e6, 0.0))
    gained = share * float(np.abs(impact.impulse).max()) * ball.radius * 1e6
    solution = impact.solution._replace(energy_lost=-gained)
    assert dataclasses.replace(impact, solution=solution).creates_energy is creates
