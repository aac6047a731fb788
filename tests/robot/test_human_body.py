"""Legs of persons by size: the published tables, scaling, mirror images and the planar limit."""

import math

import numpy as np
import pinocchio as pin
import pytest
import trimesh
from tolerances import EPSILON, agrees, closed_form

import kickdyn as kd
from kickdyn.robot.urdf_file import shipped_urdf

EXACT = {"rel": closed_form(10), "abs": 4 * EPSILON}

# de Leva 1996, Table 4, of the mean man (73.0 kg, 1.741 m) and woman (61.9 kg, 1.735 m): mass [%],
# length [mm], centre [%], radii of gyration about sagittal, transverse, longitudinal axes [%];
# the lower trunk from the navel
TABLE_4 = {
    "male": (73.0, 1.741, {
        "pelvis": (11.17, 145.7, 61.15, 61.5, 55.1, 58.7),
        "thigh": (14.16, 422.2, 40.95, 32.9, 32.9, 14.9),
        "shank": (4.33, 440.3, 43.95, 25.1, 24.6, 10.2),
        "foot": (1.37, 258.1, 44.15, 25.7, 24.5, 12.4),
    }),
    "female": (61.9, 1.735, {
        "pelvis": (12.47, 181.5, 49.20, 43.3, 40.2, 44.4),
        "thigh": (14.78, 368.5, 36.12, 36.9, 36.4, 16.2),
        "shank": (4.81, 438.6, 43.52, 26.7, 26.3, 9.2),
        "foot": (1.29, 228.3, 40.14, 29.9, 27.9, 13.9),
    }),
}  # fmt: skip
# Dumas et al. 2007, Table 2, of the mean man (1.77 m) and woman (1.61 m): mass [%], length [mm],
# centre [%] and roots of the inertia tensor xx, yy, zz, xy, xz, yz [%] in axes forward, up, right;
# a minus stands for the imaginary unit; of the pelvis, the right hip from the lumbar joint [m]:
# place in shares of the distance between the spines (Dumas & Wojtusch 2018), times that distance
DUMAS = {
    "male": (1.77, (0.224 * 0.240, -0.224 * 0.338, 0.224 * 0.361), {
        "pelvis": (14.2, 94, (2.8, -28.0, -0.6), (101, 106, 95, -25, -12, -8)),
        "thigh": (12.3, 432, (-4.1, -42.9, 3.3), (29, 15, 30, 7, -2, -7)),
        "shank": (4.8, 433, (-4.8, -41.0, 0.7), (28, 10, 28, -4, -2, 5)),
        "foot": (1.2, 183, (38.2, -15.1, 2.6), (17, 37, 36, 13, -8, 0)),
    }),
    "female": (1.61, (0.238 * 0.201, -0.238 * 0.385, 0.238 * 0.372), {
        "pelvis": (14.6, 107, (-0.9, -23.2, 0.2), (91, 100, 79, -34, -1, -1)),
        "thigh": (14.6, 379, (-7.7, -37.7, 0.9), (31, 19, 32, 7, -2, -7)),
        "shank": (4.5, 388, (-4.9, -40.4, 3.1), (28, 10, 28, 2, 1, 6)),
        "foot": (1.0, 165, (27.0, -21.8, 3.9), (17, 36, 35, -10, 6, -4)),
    }),
}  # fmt: skip
# Dumas & Wojtusch 2018: from heel to toes [m], and the centre of the foot from the heel over it
DUMAS_FOOT = {"male": (0.265, 0.436), "female": (0.233, 0.443)}
WOMAN = {"height": 1.65, "mass": 58.0, "sex": "female"}


@pytest.mark.parametrize("sex", TABLE_4)
@pytest.mark.parametrize(("side", "medial"), [("right", 1.0), ("left", -1.0)])
def test_segments_of_the_mean_person_are_those_of_de_leva(sex, side, medial):
    mass, height, table = TABLE_4[sex]
    leg = kd.Leg.human(height=height, mass=mass, sex=sex, side=side, base="floating")
    for inertia, (name, row) in zip(list(leg.model.inertias)[1:], table.items(), strict=True):
        share, length, centre, sagittal, transverse, longitudinal = np.array(row) / 100
        length *= 0.1  # mm
        lever, radii = [0.0, 0.0, -centre * length], (sagittal, transverse, longitudinal)
        if name == "foot":  # it lies forward, the ankle a quarter of it before the heel
            lever, radii = [(centre - 0.25) * length, 0.0, 0.0], radii[::-1]
        elif name == "pelvis":  # hips are 8.35 cm from the middle of a person of 1.80 m (Delp)
            lever = [0.0, medial * 0.0835 / 1.8 * height, (1 - centre) * length]
        assert inertia.mass == pytest.approx(share * mass, rel=closed_form(10)), name
        assert inertia.lever == pytest.approx(lever, **EXACT), name
        moments = np.diag(inertia.mass * (length * np.array(radii)) ** 2)
        assert inertia.inertia == pytest.approx(moments, **EXACT), name
    thigh, shank, foot = (row[1] * 1e-3 for row in list(table.values())[1:])
    straight = leg.posture(leg.configuration())
    assert straight.contact_point == pytest.approx([0.75 * foot, 0, -thigh - shank], **EXACT)


@pytest.mark.parametrize("sex", DUMAS)
@pytest.mark.parametrize(("side", "outwards"), [("right", -1.0), ("left", 1.0)])
def test_segments_are_those_of_dumas(sex, side, outwards):
    height, hip, table = DUMAS[sex]
    leg = kd.Leg.human(
        height=height, mass=70, sex=sex, side=side, segments="Dumas", base="floating"
    )
    for inertia, (name, row) in zip(list(leg.model.inertias)[1:], table.items(), strict=True):
        share, length, centre, roots = row
        assert inertia.mass == pytest.approx(0.01 * share * 70), name
        joint = hip if name == "pelvis" else (0.0, 0.0, 0.0)
        x, z, y = 1e-5 * length * np.array(centre) - joint
        assert inertia.lever == pytest.approx([x, outwards * y, z]), name
        xx, yy, zz, xy, xz, yz = (math.copysign((1e-5 * length * r) ** 2, r) for r in roots)
        # our y is their z outwards, our z their y
        tensor = [[xx, outwards * xz, xy], [outwards * xz, zz, outwards * yz],
                  [xy, outwards * yz, yy]]  # fmt: skip
        assert inertia.inertia == pytest.approx(inertia.mass * np.array(tensor), **EXACT), name
    thigh, shank, foot = list(table.values())[1:]
    length, from_heel = DUMAS_FOOT[sex]
    toe = [1e-5 * foot[1] * foot[2][0] + (1 - from_heel) * length, 0, -1e-3 * (thigh[1] + shank[1])]
    assert leg.posture(leg.configuration()).contact_point == pytest.approx(toe)


LEG_LEVELS = (
    "1L 3L 4L 5L 6L 8L 9L 1p 3p 4p 5p 6p 8p 9p 2p 7p 8w 9w 6d",
    "9.9 42.4 56.2 81.1 2.5 14.7 20.9 53.5 35 35 24 31 22 19 49 23 8.6 8.3 11",
)
"""Lengths, perimeters, widths and a depth of the levels of a leg by Yeadon [cm]."""


def measured_person():
    """Return a `yeadon.Human` with these legs, the right one thicker, a plain torso and arms."""
    yeadon = pytest.importorskip("yeadon")
    leg = {f"L{side}{name}": 0.01 * float(x) * (1.1 if side == "k" and name[1] == "p" else 1.0)
           for side in "jk"
           for name, x in zip(*(words.split() for words in LEG_LEVELS), strict=True)}  # fmt: skip
    arms = {name: 0.2 for name in yeadon.Human.measnames if name[1] in "ab" and name[3] == "p"}
    arms |= {name: 0.075 for name in yeadon.Human.measnames if name[1] in "ab" and name[3] == "w"}
    lengths = dict(zip("234567", (0.26, 0.33, 0.51, 0.02, 0.08, 0.17), strict=True))
    arms |= {f"L{side}{level}L": x for side in "ab" for level, x in lengths.items()}
    torso = dict(zip("12345678", (0.05, 0.19, 0.33, 0.47, 0.5, 0.15, 0.19, 0.29), strict=True))
    trunk = {f"Ls{level}L": x for level, x in torso.items()}
    trunk |= {f"Ls{level}p": 0.8 if level < 4 else 0.5 for level in (0, 1, 2, 3, 5, 6, 7)}
    trunk |= {f"Ls{level}w": 0.3 for level in range(5)} | {"Ls4d": 0.15}
    return yeadon.Human(leg | arms | trunk, symmetric=False)


@pytest.mark.parametrize(("side", "medial"), [("right", 1), ("left", -1)])
def test_a_measured_person_has_the_segments_of_yeadon(side, medial):
    """Masses, centres and inertia of `yeadon`, whose feet point down."""
    person = measured_person()
    leg = kd.Leg.human(height=1.8, mass=70, side=side, segments=person, base="floating")
    pelvis, thigh, shank, foot = list(leg.model.inertias)[1:]
    upper, lower = (person.K1, person.K2) if side == "right" else (person.J1, person.J2)
    share = 70 / person.mass
    assert thigh.mass == pytest.approx(share * upper.mass)
    assert shank.mass + foot.mass == pytest.approx(share * lower.mass)
    assert pelvis.mass == pytest.approx(share * person.P.mass)
    agrees(thigh.inertia, share * np.asarray(upper.inertia), closed_form(10))
    centre = np.ravel(upper.center_of_mass - upper.pos)
    assert thigh.lever == pytest.approx([0, 0, -abs(centre[2])], abs=closed_form(10))
    assert pelvis.lever[1] == pytest.approx(medial * abs(upper.pos[0, 0]))
    straight = leg.posture(leg.configuration())
    assert straight.contact_point == pytest.approx([0.209, 0, -0.811])  # of the levels 9L and 5L
    # the shank of 0.387 m and the foot as one body, as Yeadon has it
    shift, turn = np.diag([0.0, 0.0, -0.387]), np.array([[0, 0, 1], [0, 1, 0], [-1, 0, 0]])
    place = pin.SE3(turn, shift @ np.ones(3))
    whole = shank + place.act(foot)
    centre = np.ravel(lower.center_of_mass - lower.pos)
    assert whole.lever == pytest.approx([0, 0, -abs(centre[2])], abs=closed_form(10))
    moments = np.asarray(lower.inertia)[np.ix_([1, 0, 2], [1, 0, 2])]  # its x is our y
    agrees(np.diag(whole.inertia), share * np.diag(moments), closed_form(10))
    person.set_CFG("J1J2flexion", 0.5)
    person.set_CFG("K1K2flexion", 0.5)
    with pytest.raises(kd.InvalidInput, match="neutral"):
        kd.Leg.human(height=1.8, mass=70, side=side, segments=person)


def test_lengths_scale_with_height_and_torques_with_weight_and_height():
    small, tall = (kd.Leg.human(height=h, mass=m) for h, m in ((1.6, 60), (2.0, 90)))
    ratio, heavier = 2.0 / 1.6, 90 / 60
    for a, b in zip(list(small.model.inertias)[1:], list(tall.model.inertias)[1:], strict=True):
        assert b.mass == pytest.approx(heavier * a.mass)
        assert b.lever == pytest.approx(ratio * a.lever)
        assert b.inertia == pytest.approx(heavier * ratio**2 * a.inertia)
    paper = kd.Leg.human()
    for limit in ("velocity_limit", "lower", "upper"):
        assert getattr(tall, limit).tolist() == getattr(paper, limit).tolist()


@pytest.mark.parametrize(("sex", "strength"), [
    ("male", (0.161, 0.163, 0.095)), ("female", (0.181, 0.159, 0.104))])  # fmt: skip
def test_torques_are_those_of_anderson(sex, strength):
    """Anderson et al. 2007, Table 3: hip and knee extension, plantar flexion, 18-25 years."""
    leg = kd.Leg.human(height=1.7, mass=65, sex=sex)
    assert leg.effort_limit == pytest.approx(np.array(strength) * 65 * 9.81 * 1.7)


@pytest.mark.parametrize("frame", ["toe", "instep", "inside"])
@pytest.mark.parametrize("segments", ["de Leva", "Dumas"])
def test_the_left_leg_is_the_mirror_image_of_the_right_one(frame, segments):
    mirror, options = np.diag([1.0, -1.0, 1.0]), {"frame": frame, "segments": segments}
    q, v = np.random.default_rng(2).uniform(-0.4, 0.4, (2, 6))
    sides = ("right", "left")
    right, left = (kd.Leg.human(**WOMAN, **options, model="3d", side=side) for side in sides)
    a, b = right.posture(q), left.posture(q)
    agrees(b.contact_point, mirror @ a.contact_point, closed_form())
    agrees(b.jacobian, mirror @ a.jacobian, closed_form())
    agrees(b.inertia, a.inertia, closed_form())
    normal = np.array([0.6, 0.5, 0.4])
    normal *= math.copysign(1.0, normal @ a.point_velocity(v))
    one, other = (
        kd.strike(posture, v, kd.Ball(), kd.Contact(n, 0.8, 0.3))
        for posture, n in ((a, normal), (b, mirror @ normal))
    )
    agrees(other.impulse, mirror @ one.impulse, closed_form(a.condition))
    for leg, side in ((right, 1.0), (left, -1.0)):
        directions = {"toe": (1, 0, 0.5), "instep": (0.4, 0, 1), "inside": (0, side, 0.1)}
        for name, direction in directions.items():
            inside = (leg.contact_normal_cone @ direction > 0).all()
            assert inside == (name == frame), (name, side)


@pytest.mark.parametrize(("side", "medial"), [("right", 1.0), ("left", -1.0)])
def test_adduction_internal_rotation_and_inversion_are_positive(side, medial):
    """Ranges are of the joint examination norms and of the Merck Manual [deg]."""
    leg = kd.Leg.human(**WOMAN, model="3d", side=side)
    toe = leg.posture(np.zeros(6))
    sole = toe.with_contact_offset((0, 0, -0.05))
    for joint, posture, span in (
        ("hip_adduction", toe, (-45, 25)),  # the toe goes inwards
        ("hip_rotation", toe, (-60, 40)),
        ("subtalar", sole, (-25, 35)),  # the sole turns inwards
    ):
        index = leg.velocity_index(joint)
        assert medial * posture.jacobian[1, index] > 0.049, joint
        assert np.degrees(leg.joint_range(joint)) == pytest.approx(span), joint
        assert math.isinf(leg.velocity_limit[index])
        assert math.isinf(leg.effort_limit[index])


@pytest.mark.parametrize("side", ["right", "left"])
@pytest.mark.parametrize("frame", ["instep", "inside"])
@pytest.mark.parametrize("height", [1.5, 1.75])
def test_contact_points_lie_on_the_boot(side, frame, height):
    boot = trimesh.load(shipped_urdf("meshes/human_boot.stl"))
    leg = kd.Leg.human(height=height, mass=75, side=side, frame=frame)
    template, thick = kd.Leg.human(), height / 1.75  # whose shapes are those of a man of 1.75 m
    toe = leg.model.frames[leg.model.getFrameId("toe")].placement.translation[0]
    thigh, shank = (np.divide(*(robot.model.jointPlacements[joint].translation[2]
                                for robot in (leg, template))) for joint in (2, 3))  # fmt: skip
    stretches = {"base": thick, "thigh": (thick, thick, thigh), "shank": (thick, thick, shank),
                 "foot": (toe / 0.145, thick, thick)}  # fmt: skip
    for shape, original in zip(leg.file.visuals(), template.file.visuals(), strict=True):
        stretch = thick if shape.mesh.endswith("pin.stl") else stretches[shape.frame]  # stays round
        assert shape.size == pytest.approx(stretch * np.ones(3) * original.size), shape.mesh
        if shape.mesh.endswith("boot.stl"):
            boot.apply_scale(shape.size)
    _, distance, _ = trimesh.proximity.closest_point(boot, [leg.contact_lever])
    assert distance[0] < 1e-3
    medial = 1 if side == "right" else -1
    assert (medial * leg.contact_lever[1] > 0.02) == (frame == "inside")


@pytest.mark.parametrize(("change", "said"), [
    ({"height": 16.5}, "height is 16.5: .*at least 1.2"),
    ({"mass": 580}, "mass is 580.0: .*at least 30"), ({"sex": "f"}, "sex is 'f': .*female, male"),
    ({"base": "free"}, "base is 'free': .*fixed or floating"), ({"frame": "sole"}, "'sole'"),
    ({"segments": "Winter"}, "segments is 'Winter': .*de Leva, Dumas"),
    ({"height": None, "mass": None}, "height and mass are None"),
    ({"height": None, "mass": None, "sex": "f"}, "sex is 'f'")])  # fmt: skip
def test_bad_arguments_are_refused(change, said):
    with pytest.raises(kd.InvalidInput, match=f"^[^\n]*{said}[^\n]*$"):
        kd.Leg.human(**WOMAN | change)
