"""Uncertainty budgets: by derivatives, by random draws, and as sums of their parts."""

import numpy as np
import pytest
from tolerances import agrees, closed_form, sampled

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
def test_covariances_follow_from_the_derivatives(friction):
    """J Sigma J^T summed over the sources, without friction, slipping and sticking."""
    spread = {"q": np.diag([0.004, 0.006, 0.008]) ** 2, "restitution": [[1e-4]],
              "v": np.array([[4.0, 1.9, 0.0], [1.9, 1.0, 0.0], [0.0, 0.0, 9.0]]) * 1e-4,
              "normal": 0.005**2 * np.eye(3), "ball_mass": [[1.6e-5]]}  # fmt: skip
    impact, deviations = kick(friction=friction), {"restitution": 0.01, "ball_mass": 0.004}
    ours, slopes = impact.uncertainty(**(spread | deviations)), impact.sensitivity()

    def covariance(jacobians):
        return sum(jacobians[name] @ np.array(s) @ jacobians[name].T for name, s in spread.items())

    for result, read in RESULTS.items():
        expected = covariance(getattr(slopes, result))
        agrees(getattr(ours, result), expected, closed_form(10))
        name = {"impulse": "impulse_size", "velocity": "speed"}.get(result)
        if name:  # the deviation along the vector
            direction = read(impact) / np.linalg.norm(read(impact))
            deviation = np.sqrt(direction @ expected @ direction)
            assert getattr(ours, name) == pytest.approx(deviation, rel=closed_form(10))
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


@pytest.mark.parametrize("friction", [0.0, 0.1, 3.0])
def test_covariances_are_those_of_random_draws(friction):
    rng, n = np.random.default_rng(1), 4000
    spread = np.array([[4.0, 1.9, 0.0], [1.9, 1.0, 0.0], [0.0, 0.0, 9.0]]) * 1e-4
    impact, deviations = kick(friction=friction), np.array([0.004, 0.006, 0.008])
    ours = impact.uncertainty(
        q=deviations, v=spread, restitution=0.01, normal=0.005, ball_mass=0.004
    )
    assert ours.branch_sigmas > 5
    normals = impact.contact.normal + 0.005 * rng.normal(size=(n, 3))
    contacts = [kd.Contact(normal, e, friction)
                for normal, e in zip(normals, rng.normal(0.7, 0.01, n), strict=True)]  # fmt: skip
    balls = [kd.Ball(mass) for mass in rng.normal(0.43, 0.004, n)]
    q, v = rng.normal(Q, deviations, (n, 3)), rng.multivariate_normal(V, spread, size=n)
    drawn = kd.strike_many(LEG, q, v, balls, contacts)
    for result, rows in (("impulse", drawn.impulse), ("velocity", drawn.ball_velocity),
                         ("spin", drawn.ball_spin)):  # fmt: skip
        covariance = np.cov(rows.T)
        gap = np.abs(getattr(ours, result) - covariance).max()
        assert gap <= sampled(n) * np.trace(covariance) + 1e-24, result
    sizes = {"impulse_size": drawn.impulse, "speed": drawn.ball_velocity}
    for name, rows in sizes.items():
        deviation = np.std(np.linalg.norm(rows, axis=1))
        assert getattr(ours, name) == pytest.approx(deviation, rel=sampled(n)), name
    for k, joint in enumerate(ours.joints.values()):
        covariance = np.cov(drawn.joint_impulses[:, k].T)
        assert np.abs(joint.impulse - covariance).max() <= sampled(n) * np.trace(covariance)
        force = np.std(np.linalg.norm(drawn.joint_impulses[:, k, :3], axis=1))
        assert joint.force_deviation == pytest.approx(force, rel=sampled(n)), k


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
