"""Uncertainty budgets: against Monte Carlo, and as sums that must come out."""

import math

import numpy as np
import pytest

import kickdyn as kd

LEG = kd.Leg.human()
Q, V = np.radians([5, 10, -5]), np.array([0.1, -2.0, -1.0])


def kick(q=Q, v=V, e=0.7, friction=0.0, normal=(2, 0.3, 1), mass=0.43):
    return kd.strike(LEG.posture(q), v, kd.Ball(mass), kd.Contact(normal, e, friction))


@pytest.mark.parametrize("friction", [0.0, 0.1, 3.0])
def test_monte_carlo(friction):
    rng = np.random.default_rng(1)
    correlated = np.array([[4.0, 1.9, 0.0], [1.9, 1.0, 0.0], [0.0, 0.0, 9.0]]) * 1e-4
    ours = kick(friction=friction).uncertainty(
        q=[0.004, 0.006, 0.008], v=correlated, restitution=0.01, normal=0.005, ball_mass=0.004
    )
    assert ours.branch_sigmas > 5
    n = 4000
    draws = zip(
        Q + rng.normal(size=(n, 3)) * [0.004, 0.006, 0.008],
        rng.multivariate_normal(V, correlated, size=n),
        0.7 + 0.01 * rng.normal(size=n),
        kick().contact.normal + 0.005 * rng.normal(size=(n, 3)),
        0.43 + 0.004 * rng.normal(size=n),
        strict=True,
    )
    hits = [kick(q, v, e, friction, normal, mass) for q, v, e, normal, mass in draws]
    for result, values in (
        ("impulse", [hit.impulse for hit in hits]),
        ("velocity", [hit.ball_after.velocity for hit in hits]),
        ("spin", [hit.ball_after.spin for hit in hits]),
    ):
        covariance = np.cov(np.array(values).T)
        scale = np.trace(covariance)
        assert np.abs(getattr(ours, result) - covariance).max() <= 0.06 * scale + 1e-24
    speeds = np.std([hit.ball_after.speed for hit in hits])
    assert ours.speed == pytest.approx(speeds, rel=0.04)
    sizes = np.std([np.linalg.norm(hit.impulse) for hit in hits])
    assert ours.impulse_size == pytest.approx(sizes, rel=0.04)
    loads = [kd.joint_loads(hit, contact_time=0.01) for hit in hits]
    for k, (name, joint) in enumerate(ours.joints.items()):
        drawn = np.array([hit.joint_impulses[k] for hit in hits])
        nominal = kick(friction=friction).joint_impulses[k]
        assert joint.force == pytest.approx(np.linalg.norm(nominal[:3]))
        assert joint.moment == pytest.approx(np.linalg.norm(nominal[3:]))
        for deviation, part in (
            (joint.force_deviation, drawn[:, :3]),
            (joint.moment_deviation, drawn[:, 3:]),
        ):
            assert deviation == pytest.approx(np.std(np.linalg.norm(part, axis=1)), rel=0.03)
        for covariance, part in (
            (joint.impulse, drawn),
            (joint.structure, [load[name].structure for load in loads]),
            (joint.axis, [load[name].axis for load in loads]),
        ):
            expected = np.cov(np.array(part).T)
            scale = np.trace(expected) + 1e-24
            assert np.abs(covariance - expected).max() <= 0.06 * scale
        peaks = np.array([load[name].peak_force for load in loads])
        relative = joint.force_deviation / joint.force
        assert np.std(peaks) / np.mean(peaks) == pytest.approx(relative, rel=0.03)


def test_a_moving_ball_has_an_impulse_of_another_direction():
    """Sizes of impulse and velocity change along their own directions."""
    contact = kd.Contact((2, 0.3, 1), 0.7, 0.1)

    def struck(ball_velocity, e=0.7):
        options = {"ball_velocity": ball_velocity, "ball_spin": (3.0, -20.0, 5.0)}
        rough = kd.Contact(contact.normal, e, 0.1)
        return kd.strike(LEG.posture(Q), V, kd.Ball(), rough, **options)

    before = np.array([-4.0, 3.0, 1.0])
    hit = struck(before)
    cosine = hit.impulse @ hit.ball_after.velocity / hit.ball_after.speed
    assert abs(cosine) < 0.9 * np.linalg.norm(hit.impulse)
    ours, step = hit.uncertainty(ball_velocity=0.1, restitution=0.02), 1e-5
    for name, size in (
        ("impulse_size", lambda hit: np.linalg.norm(hit.impulse)),
        ("speed", lambda hit: float(hit.ball_after.speed)),
    ):
        slopes = [
            (size(struck(before + step * axis)) - size(struck(before - step * axis))) / (2 * step)
            for axis in np.eye(3)
        ]
        by_e = (size(struck(before, 0.7 + step)) - size(struck(before, 0.7 - step))) / (2 * step)
        expected = np.hypot(0.1 * np.linalg.norm(slopes), 0.02 * by_e)
        assert getattr(ours, name) == pytest.approx(expected, rel=1e-6)


def test_the_distance_to_the_other_branch_counts_every_source():
    hit = kick(friction=0.1)
    spread = {"v": 0.1, "friction": 0.02}
    alone = [hit.uncertainty(**{name: size}).branch_sigmas for name, size in spread.items()]
    together = hit.uncertainty(**spread).branch_sigmas
    assert together == pytest.approx(1 / np.hypot(1 / alone[0], 1 / alone[1]), rel=1e-12)
    assert together < 0.99 * min(alone)


def test_one_source_is_its_jacobian():
    hit = kick(friction=0.1)
    ours = hit.uncertainty(restitution=0.02)
    slope = hit.sensitivity().impulse["restitution"][:, 0]
    assert ours.impulse == pytest.approx(0.02**2 * np.outer(slope, slope), rel=1e-13)
    assert ours.share("impulse") == {"restitution": pytest.approx(1.0)}


def test_parts_add_up():
    spread = {"q": 0.01, "v": 0.05, "ball_spin": 1.0, "link_mass": [0.1, 0.05, 0.02]}
    hit = kick(friction=0.1)
    ours = hit.uncertainty(**spread)
    for result in ("impulse", "velocity", "spin", "impulse_size", "speed"):
        power = 1 if result in ("impulse", "velocity", "spin") else 2
        alone = [
            getattr(hit.uncertainty(**{name: value}), result) ** power
            for name, value in spread.items()
        ]
        assert getattr(ours, result) ** power == pytest.approx(sum(alone), rel=1e-12)
        shares = ours.share(result)
        assert list(shares) == list(spread)
        assert sum(shares.values()) == pytest.approx(1.0)
    for name, joint in ours.joints.items():
        assert np.hypot.reduce(list(joint.by_source.values())) == pytest.approx(
            joint.force_deviation, rel=1e-12
        )
        assert sum(ours.share(name).values()) == pytest.approx(1.0)
        for source, deviation in joint.by_source.items():
            alone = hit.uncertainty(**{source: spread[source]}).joints[name]
            assert alone.force_deviation == pytest.approx(deviation, rel=1e-12)


def test_a_deviation_is_a_diagonal_covariance():
    hit = kick()
    by_number, by_vector, by_matrix = (
        hit.uncertainty(v=spread).velocity for spread in (0.2, [0.2] * 3, 0.04 * np.eye(3))
    )
    assert by_number == pytest.approx(by_vector, rel=1e-15)
    assert by_number == pytest.approx(by_matrix, rel=1e-14)


def test_the_table():
    ours = kick(friction=0.1).uncertainty(q=0.01, restitution=0.02)
    lines = str(ours).splitlines()
    assert lines[0].split() == [
        "impulse",
        "size",
        "ball",
        "speed",
        "velocity",
        "vector",
        "spin",
        "vector",
    ]
    assert lines[1].split() == [
        "source",
        "N",
        "s",
        "share",
        "m/s",
        "share",
        "m/s",
        "share",
        "rad/s",
        "share",
    ]
    assert [line.split()[0] for line in lines[2:5]] == ["q", "restitution", "all"]
    assert [float(cell) for cell in lines[4].split()[1:]] == pytest.approx(
        [
            ours.impulse_size,
            ours.speed,
            np.sqrt(np.trace(ours.velocity)),
            np.sqrt(np.trace(ours.spin)),
        ],
        rel=5e-3,
    )
    assert lines[5].startswith("standard deviations; for vectors: root of the trace")
    assert lines[6].startswith("the contact slips; sticking is")
    assert lines[8].split() == ["joint", "impulse", "N", "s", "+-", "moment", "N", "m", "s", "+-"]
    for line, (name, joint) in zip(lines[9:], ours.joints.items(), strict=True):
        shown = [joint.force, joint.force_deviation, joint.moment, joint.moment_deviation]
        assert line.split()[0] == name
        assert [float(cell) for cell in line.split()[1:]] == pytest.approx(shown, rel=5e-3)
    assert lines[6].endswith("standard deviations away")
    assert max(map(len, lines)) <= 80
    assert "away" not in str(kick().uncertainty(q=0.01))


def test_the_rows_of_the_table_are_the_deviations_by_each_source():
    ours = kick(friction=0.1).uncertainty(q=0.01, restitution=0.02, ball_mass=0.01)
    results = ("impulse_size", "speed", "velocity", "spin")
    for line in str(ours).splitlines()[2:5]:
        source, *cells = line.split()
        deviations = [math.sqrt(np.trace(ours.by_source[source][result])) for result in results]
        assert cells[::2] == [f"{deviation:.3g}" for deviation in deviations]
        assert cells[1::2] == [f"{ours.share(result)[source]:.1%}" for result in results]
    assert f"is {ours.branch_sigmas:.2g} standard deviations" in str(ours).splitlines()[7]


def test_what_only_turns_a_vector_is_not_of_its_size():
    """A frictionless ball goes along the normal: tilted to the foot's way, it loses nothing."""
    posture = LEG.posture(Q)
    hit = kd.strike(
        LEG.posture(Q), posture.joint_velocity((10, 0, 5)), kd.Ball(), kd.Contact((2, 0, 1), 0.8)
    )
    tilted = np.zeros((3, 3))
    tilted[1, 1] = np.radians(2) ** 2  # out of the plane that holds the foot's way
    ours = hit.uncertainty(normal=tilted)
    assert ours.speed < 1e-12
    assert np.sqrt(ours.velocity[1, 1]) == pytest.approx(
        np.radians(2) * hit.ball_after.speed, rel=1e-9
    )


def test_what_cannot_change_shows_no_share():
    """Without friction the ball does not turn: what rounding leaves of that is not shared out."""
    hit = kick(friction=0.0)
    ours = hit.uncertainty(q=0.01, v=0.1, ball_mass=0.02, ball_radius=0.001, normal=0.02)
    assert not ours.spin.any()
    assert set(ours.share("spin").values()) == {0.0}
    rows = [line.split() for line in str(ours).splitlines()[2:8]]
    assert [row[-1] for row in rows] == ["0"] * 6
    assert rows[3] == ["ball_radius", "0", "0.0%", "0", "0.0%", "0", "0.0%", "0"]
    turned = hit.uncertainty(q=0.01, ball_spin=0.1)
    assert turned.share("spin") == {"q": 0.0, "ball_spin": pytest.approx(1.0)}
    assert not kick(friction=0.4).uncertainty(ball_radius=0.001).velocity.any()


def test_a_result_is_chosen_by_name():
    ours = kick().uncertainty(q=0.01)
    with pytest.raises(kd.InvalidInput, match="'size' is unknown: choose impulse_size, speed, imp"):
        ours.share("size")


def test_a_strike_near_the_boundary_says_so():
    hit = kick(friction=5.0)
    n, p = hit.contact.normal, hit.impulse
    edge = np.linalg.norm(p - (n @ p) * n) / (n @ p)
    near, far = (kick(friction=edge + more).uncertainty(friction=0.01) for more in (0.005, 0.05))
    assert near.branch == far.branch == "stick"
    assert near.branch_sigmas == pytest.approx(0.5, rel=1e-9)
    assert far.branch_sigmas == pytest.approx(5.0, rel=1e-9)
    assert kick(friction=edge).uncertainty(friction=0.01).branch_sigmas == 0.0
    assert kick().uncertainty(v=0.1).branch_sigmas == np.inf


@pytest.mark.parametrize(
    ("spread", "words"),
    [
        ({}, "no source is named: choose among q, v, restitution"),
        ({"speed": 0.1}, "source 'speed' is unknown: choose among q, v"),
        ({"q": 0.1, "size": 0.1, "v": 0.2}, "source 'size' is unknown: choose among q, v"),
        ({"q": -0.1}, r"spread of q is -0\.1: it must be 0 or more"),
        ({"q": [0.1, 0.2]}, r"spread of q has shape \(2,\): it must be a number, \(3,\) or"),
        ({"v": np.diag([1.0, 1.0, -1.0])}, "smallest eigenvalue of -1: .*semidefinite"),
        ({"v": np.eye(3) + np.eye(3, k=2)}, "must be symmetric"),
        ({"restitution": [[0.1]]}, r"has shape \(1, 1\): it must be a number$"),
        ({"q": 1e200}, r"spread of q is 1e\+200: at most 1e\+100"),
        ({"friction": np.nan}, "spread of friction is nan: every entry must be finite"),
        ({"q": 5}, r"^spread of q is 5 rad: it must be at most 1, because covariances describe"),
        ({"normal": 4 * np.eye(3)}, r"^spread of normal is 2 rad: it must be at most 1"),
    ],
)
def test_bad_input(spread, words):
    with pytest.raises(kd.InvalidInput, match=words):
        kick().uncertainty(**spread)


def test_other_laws_are_refused():
    hit = kd.strike(LEG.posture(Q), V, kd.Ball(), kd.Contact((1, 0, 0.2), 0.8, 0.4), "paper")
    with pytest.raises(kd.InvalidInput, match="has no sensitivities"):
        hit.uncertainty(v=0.1)


def test_a_covariance_may_be_singular():
    """All components move together: one deviation, in one direction."""
    hit = kick()
    slope = hit.sensitivity().velocity["v"] @ np.ones(3)
    ours = hit.uncertainty(v=0.01 * np.ones((3, 3))).velocity
    assert ours == pytest.approx(0.01 * np.outer(slope, slope), abs=1e-15)
    assert np.isfinite(hit.uncertainty(v=np.zeros((3, 3))).speed)


def test_a_lopsided_covariance_is_said_to_be_one():
    posture = kd.Leg.human().posture([0.1, 0.4, -0.1])
    hit = kd.strike(
        posture, posture.joint_velocity((9, 0, 3)), kd.Ball(), kd.Contact((3, 0, 1), 0.7)
    )
    lopsided = np.eye(3) + np.eye(3, k=1)
    with pytest.raises(kd.InvalidInput, match="covariance of q differs from its transpose by 1"):
        hit.uncertainty(q=lopsided)


def test_sigmas_with_a_friction_whose_square_overflows():
    strong, stronger = (kick(friction=mu).uncertainty(v=0.1) for mu in (1e100, 1e300))
    assert stronger.branch_sigmas == pytest.approx(strong.branch_sigmas)


def test_a_moment_that_is_0_deviates_by_what_the_normal_turns():
    """The moment in a planar leg's joints is rounding; a normal turned aside makes it finite."""
    posture = kd.Leg.human().posture(np.radians([40, 30, -20]))
    v, ball = np.array([8, -17, 6.5]), kd.Ball()
    normal = np.array([2, 0, 1]) / math.sqrt(5)
    nominal = kd.strike(posture, v, ball, kd.Contact(normal, 0.8, 0.4)).uncertainty(normal=0.02)
    rng = np.random.default_rng(4)
    drawn = []
    for turn in rng.normal(0, 0.02, (1000, 3)):
        contact = kd.Contact(normal + np.cross(turn, normal), 0.8, 0.4)
        drawn.append(kd.strike(posture, v, ball, contact).joint_impulses[:, 3:])
    sizes = np.sqrt(np.mean(np.square(drawn).sum(axis=2), axis=0))
    for joint, size in zip(nominal.joints.values(), sizes, strict=True):
        assert joint.moment < 1e-12
        assert joint.moment_deviation == pytest.approx(size, rel=0.06)


def test_the_table_has_the_joints_with_the_largest_impulses():
    leg = kd.Leg.human(height=1.8, mass=75, model="3d", base="floating")
    posture = leg.posture(leg.configuration({"hip": 0.4, "knee": 0.6}))
    hit = kd.strike(
        posture, posture.joint_velocity([9.0, 0.0, 2.0]), kd.Ball(), kd.Contact((1, 0, 0), 0.7)
    )
    spread = hit.uncertainty(restitution=0.02)
    table = str(spread).split("joint ")[1]
    assert len(spread.joints) == 7
    assert "root_joint" not in table
    assert "knee" in table
    assert table.endswith("1 more with smaller impulses: see `joints`")
