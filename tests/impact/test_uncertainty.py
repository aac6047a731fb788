"""Uncertainty budgets: against Monte Carlo and differences, and as sums of their parts."""

import numpy as np
import pytest
from tolerances import agrees, closed_form, differenced, sampled

import kickdyn as kd

LEG = kd.Leg.human()
Q, V = np.radians([5, 10, -5]), np.array([0.1, -2.0, -1.0])
RESULTS = {
    "impulse": lambda impact: impact.impulse,
    "velocity": lambda impact: impact.ball_after.velocity,
    "spin": lambda impact: impact.ball_after.spin,
}
SIZES = {
    "impulse_size": lambda impact: np.linalg.norm(impact.impulse),
    "speed": lambda impact: float(impact.ball_after.speed),
}


def kick(q=Q, v=V, e=0.7, friction=0.0, normal=(2, 0.3, 1), mass=0.43, **options):
    contact = kd.Contact(normal, e, friction)
    return kd.strike(LEG.posture(q), v, kd.Ball(mass), contact, **options)


@pytest.mark.parametrize("friction", [0.0, 0.1, 3.0])
def test_monte_carlo(friction):
    """Without friction, slipping and sticking; sampling errors are 2 % to 6 %."""
    rng, n = np.random.default_rng(1), 800
    correlated = np.array([[4.0, 1.9, 0.0], [1.9, 1.0, 0.0], [0.0, 0.0, 9.0]]) * 1e-4
    nominal = kick(friction=friction)
    ours = nominal.uncertainty(
        q=[0.004, 0.006, 0.008], v=correlated, restitution=0.01, normal=0.005, ball_mass=0.004
    )
    assert ours.branch_sigmas > 5
    draws = zip(
        Q + rng.normal(size=(n, 3)) * [0.004, 0.006, 0.008],
        rng.multivariate_normal(V, correlated, size=n),
        0.7 + 0.01 * rng.normal(size=n),
        nominal.contact.normal + 0.005 * rng.normal(size=(n, 3)),
        0.43 + 0.004 * rng.normal(size=n),
        strict=True,
    )
    impacts = [kick(q, v, e, friction, normal, mass) for q, v, e, normal, mass in draws]

    def check(covariance, samples):
        expected = np.cov(np.array(samples).T)
        error = sampled(n) * np.trace(expected) + 1e-24
        np.testing.assert_allclose(covariance, expected, rtol=0, atol=error)

    for result, read in RESULTS.items():
        check(getattr(ours, result), [read(impact) for impact in impacts])
    for result, read in SIZES.items():
        deviation = np.std([read(impact) for impact in impacts])
        assert getattr(ours, result) == pytest.approx(deviation, rel=sampled(n)), result
    loads = [kd.joint_loads(impact) for impact in impacts]
    for k, (name, joint) in enumerate(ours.joints.items()):
        samples, exact = np.array([one.joint_impulses[k] for one in impacts]), joint.impulse
        assert joint.force == pytest.approx(np.linalg.norm(nominal.joint_impulses[k][:3]))
        assert joint.moment == pytest.approx(np.linalg.norm(nominal.joint_impulses[k][3:]))
        deviations = [np.std(np.linalg.norm(part, axis=1)) for part in np.split(samples, 2, axis=1)]
        assert [joint.force_deviation, joint.moment_deviation] == pytest.approx(
            deviations, rel=sampled(n)
        ), name
        check(exact, samples)
        check(joint.structure, [load[name].structure for load in loads])
        check(joint.axis, [load[name].axis for load in loads])


def test_sizes_change_along_their_vectors():
    """By differences: impulse and velocity of a ball that moves point in different directions."""
    before, step = np.array([-4.0, 3.0, 1.0]), 1e-5

    def strike(velocity, e=0.7):
        spin = (3.0, -20.0, 5.0)
        return kick(e=e, friction=0.1, ball_velocity=velocity, ball_spin=spin)

    impact = strike(before)
    ours = impact.uncertainty(ball_velocity=0.1, restitution=0.02)
    for name, size in SIZES.items():
        slopes = [
            (size(strike(before + step * axis)) - size(strike(before - step * axis))) / (2 * step)
            for axis in np.eye(3)
        ]
        by_e = (size(strike(before, 0.7 + step)) - size(strike(before, 0.7 - step))) / (2 * step)
        expected = np.hypot(0.1 * np.linalg.norm(slopes), 0.02 * by_e)
        assert getattr(ours, name) == pytest.approx(expected, rel=differenced() * 1e3), name


def test_parts_add_up():
    """Variances of independent sources; shares of one; one source is its Jacobian."""
    spread = {"q": 0.01, "v": 0.05, "ball_spin": 1.0, "link_mass": [0.1, 0.05, 0.02]}
    impact = kick(friction=0.1)
    ours, slopes = impact.uncertainty(**spread), impact.sensitivity()
    alone = {name: impact.uncertainty(**{name: value}) for name, value in spread.items()}
    for result in (*RESULTS, *SIZES):
        power = 1 if result in RESULTS else 2
        total = sum(getattr(one, result) ** power for one in alone.values())
        agrees(getattr(ours, result) ** power, total, closed_form())
        shares = ours.share(result)
        assert list(shares) == list(spread)
        assert sum(shares.values()) == pytest.approx(1.0)
        variance = {name: np.trace(np.atleast_2d(getattr(one, result) ** power))
                    for name, one in alone.items()}  # fmt: skip
        assert shares["v"] == pytest.approx(variance["v"] / sum(variance.values()), rel=1e-10)
    for name, joint in ours.joints.items():
        deviations = [one.joints[name].force_deviation for one in alone.values()]
        assert list(joint.by_source.values()) == pytest.approx(deviations, rel=closed_form())
        assert joint.force_deviation == pytest.approx(np.hypot.reduce(deviations), rel=1e-12)
        assert sum(ours.share(name).values()) == pytest.approx(1.0)
    by_q = slopes.impulse["q"]
    agrees(alone["q"].impulse, 1e-4 * by_q @ by_q.T, closed_form())
    with pytest.raises(kd.InvalidInput, match=r"'size' is unknown.*impulse_size.*knee"):
        ours.share("size")


def test_a_deviation_is_a_diagonal_covariance_and_a_covariance_may_be_singular():
    impact = kick()
    number, vector, matrix = (
        impact.uncertainty(v=spread).velocity for spread in (0.2, [0.2] * 3, 0.04 * np.eye(3))
    )
    agrees(number, vector, closed_form())
    agrees(number, matrix, closed_form())
    slope = impact.sensitivity().velocity["v"] @ np.ones(3)
    together = impact.uncertainty(v=0.01 * np.ones((3, 3))).velocity
    agrees(together, 0.01 * np.outer(slope, slope), closed_form())


def test_a_change_that_only_turns_a_vector_leaves_its_size():
    """A frictionless ball goes along the normal, tilted here across the motion of the foot."""
    posture = LEG.posture(Q)
    v, contact = posture.joint_velocity((10, 0, 5)), kd.Contact((2, 0, 1), 0.8)
    impact = kd.strike(posture, v, kd.Ball(), contact)
    ours = impact.uncertainty(normal=np.diag([0.0, np.radians(2) ** 2, 0.0]))
    assert ours.speed < 1e-12
    expected = np.radians(2) * impact.ball_after.speed
    assert np.sqrt(ours.velocity[1, 1]) == pytest.approx(expected, rel=1e-9)


def test_results_that_cannot_change_have_no_share():
    """Without friction the ball does not turn."""
    impact = kick(friction=0.0)
    ours = impact.uncertainty(q=0.01, v=0.1, ball_mass=0.02, ball_radius=0.001, normal=0.02)
    assert not ours.spin.any()
    assert set(ours.share("spin").values()) == {0.0}
    spun = impact.uncertainty(q=0.01, ball_spin=0.1)
    assert spun.share("spin") == {"q": 0.0, "ball_spin": pytest.approx(1.0)}


def test_the_distance_to_the_other_branch():
    """A friction d above the edge is d / sigma away; independent sources add in quadrature."""
    impact = kick(friction=5.0)
    n, p = impact.contact.normal, impact.impulse
    edge = np.linalg.norm(p - (n @ p) * n) / (n @ p)
    for distance, sigmas in ((0.005, 0.5), (0.05, 5.0)):
        ours = kick(friction=edge + distance).uncertainty(friction=0.01)
        assert (ours.branch, ours.branch_sigmas) == ("stick", pytest.approx(sigmas, rel=1e-8))
    assert kick(friction=edge).uncertainty(friction=0.01).branch_sigmas == 0.0
    assert kick().uncertainty(v=0.1).branch_sigmas == np.inf
    slipping, spread = kick(friction=0.1), {"v": 0.1, "friction": 0.02}
    alone = [slipping.uncertainty(**{name: x}).branch_sigmas for name, x in spread.items()]
    expected = 1 / np.hypot(1 / alone[0], 1 / alone[1])
    assert slipping.uncertainty(**spread).branch_sigmas == pytest.approx(expected, rel=1e-12)
    strong, stronger = (kick(friction=mu).uncertainty(v=0.1) for mu in (1e100, 1e300))
    assert stronger.branch_sigmas == pytest.approx(strong.branch_sigmas)


def test_a_moment_that_is_0_deviates_by_the_turned_normal():
    """The moment in a planar leg's joints is rounding; a normal turned aside makes it finite."""
    posture, v = LEG.posture(np.radians([40, 30, -20])), np.array([8, -17, 6.5])
    normal, rng, n = np.array([2, 0, 1]) / np.sqrt(5), np.random.default_rng(4), 400

    def strike(direction):
        return kd.strike(posture, v, kd.Ball(), kd.Contact(direction, 0.8, 0.4))

    ours = strike(normal).uncertainty(normal=0.02)
    turns = rng.normal(0, 0.02, (n, 3))
    moments = [strike(normal + np.cross(turn, normal)).joint_impulses[:, 3:] for turn in turns]
    sizes = np.sqrt(np.mean(np.square(moments).sum(axis=2), axis=0))
    for joint, size in zip(ours.joints.values(), sizes, strict=True):
        assert joint.moment < 1e-12
        assert joint.moment_deviation == pytest.approx(size, rel=sampled(n))


def test_the_table_has_the_deviations_and_shares():
    ours = kick(friction=0.1).uncertainty(q=0.01, restitution=0.02, ball_mass=0.01)
    lines = [line.split() for line in str(ours).splitlines()]
    rows = {line[0]: line[1:] for line in lines if line}
    for source, variances in ours.by_source.items():
        for k, result in enumerate(("impulse_size", "speed", "velocity", "spin")):
            assert rows[source][2 * k] == f"{np.sqrt(np.trace(variances[result])):.3g}"
            assert rows[source][2 * k + 1] == f"{ours.share(result)[source]:.1%}"
    for name, joint in ours.joints.items():
        deviations = joint.force, joint.force_deviation, joint.moment, joint.moment_deviation
        assert [float(cell) for cell in rows[name]] == pytest.approx(deviations, rel=5e-3)
    assert f"{ours.branch_sigmas:.2g}" in str(ours)
    assert "slips" in str(ours)


@pytest.mark.parametrize(
    ("spread", "words"),
    [
        ({}, "no source"),
        ({"q": 0.1, "size": 0.1}, "source 'size' is unknown: .*q, v"),
        ({"q": -0.1}, r"spread of q is -0\.1"),
        ({"q": [0.1, 0.2]}, r"spread of q has shape \(2,\)"),
        ({"v": np.diag([1.0, 1.0, -1.0])}, "eigenvalue of -1"),
        ({"v": np.eye(3) + np.eye(3, k=2)}, "symmetric"),
        ({"restitution": [[0.1]]}, r"shape \(1, 1\)"),
        ({"q": 1e200}, r"spread of q is 1e\+200"),
        ({"friction": np.nan}, "friction is nan"),
        ({"q": 5}, "spread of q is 5 rad"),
        ({"normal": 4 * np.eye(3)}, "spread of normal is 2 rad"),
    ],
)
def test_bad_input(spread, words):
    with pytest.raises(kd.InvalidInput, match=words):
        kick().uncertainty(**spread)
