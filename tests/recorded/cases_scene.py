"""Scenes, shipped and made, simulated to tolerances and many times, and tuned for MuJoCo."""

from pathlib import Path

import kickdyn as kd
from kickdyn.scene.effects import effects_of
from recorded.parts import AIR, BALL, GROUND, HUMAN, POSTURE, ROOT, V, faults

SHIPPED = [file.stem for file in sorted((ROOT / "scenes").glob("*.toml"))]


def made(**more):
    return kd.Scene(
        POSTURE, V, BALL, kd.Contact((2, 0.3, 1), 0.7, 0.1),
        **{"air": AIR, "ground": kd.Ground(-2.0), "name": "a kick",
           "incoming": kd.BallState(velocity=(-3, 1, 0.5), spin=(5, -8, 3)), **more},
    )  # fmt: skip


def simulated(scene, tolerance=0.05):
    run = kd.simulate(scene, tolerance)
    return {
        "run": run,
        "summary": run.summary,
        "warnings": run.warnings,
        "effects": run.effect_sizes if tolerance else None,
    }


VARIANTS = {
    "plain": {},
    "compliant": {"law": kd.Compliance(contact_time=0.008)},
    "stiffness": {"law": kd.Compliance(stiffness=7e5)},
    "pressure": {"law": kd.Compliance(stiffness="pressure")},
    "stronge": {"law": "stronge"},
    "course": {"ground": GROUND},
    "plane": {"plane": kd.Plane((14, 4, 0), (-1, 0.1, 0), "back"), "wall": kd.Wall(6.0, 1.2)},
    "uncertain": {"uncertainty": {"q": 0.02, "v": 0.3, "restitution": 0.03, "normal": 0.02}},
    "vacuum": {"air": None},
}

WRONG = {
    "key": ("ball", "[ball]\nmas = 3"), "number": ("ball", '[ball]\nmass_kg = "x"'),
    "leg": ("leg", '[leg]\nmodel = "hooman"'), "angles": ("posture", "[posture]\nangles_deg = { hipp = 3 }"),
    "table": ("goal", "[goal]\nx = 1"), "plane": ("plane", "[plane]\npoint_m = [1, 2]\nnormal = [0, 0, 0]"),
    "law": ("law", '[law]\nname = "soft"'), "wall": ("wall", "[wall]\ndistance_m = -3\nheight_m = 2"),
    "air": ("air", '[air]\ndrag = "golf"\nwind_m_s = [1, 2]'),
    "slides": ("posture", "[posture]\npositions_m = { hip = 3 }\nangles_deg = { hip = 5 }\nfoot_velocity_m_s = [1, 0, 0]"),
    "uncertainty": ("uncertainty", "[uncertainty]\nangles = 1"),
}  # fmt: skip


def wrong(section, lines):
    """Return what a scene is refused for whose section is replaced."""
    text = (ROOT / "scenes" / "free_kick.toml").read_text()
    head, _, rest = text.partition(f"[{section}]")
    tail = rest[rest.find("\n\n") :] if rest else ""
    Path("wrong.toml").write_text(f"{head}\n{lines}\n{tail}")
    return kd.load_scene("wrong.toml")


def changed():
    scene = made(**VARIANTS["plane"], uncertainty={"q": 0.02})
    return [scene.replace(law="stronge"), scene.with_leg(HUMAN.with_armature({"hip": 0.1})), made(law=kd.Compliance(0.008)).as_instant(),
            scene.ahead, scene.ball_position, scene.is_compliant]  # fmt: skip


CASES = {
    **{f"shipped {name}": (lambda name=name: kd.load_scene(ROOT / "scenes" / f"{name}.toml")) for name in SHIPPED},
    **{f"simulated {name}": (lambda name=name: simulated(kd.load_scene(ROOT / "scenes" / f"{name}.toml"))) for name in SHIPPED},
    **{f"exact {name}": (lambda name=name: simulated(kd.load_scene(ROOT / "scenes" / f"{name}.toml"), None)) for name in SHIPPED},
    **{f"made {name}": (lambda more=more: [made(**more), repr(made(**more))]) for name, more in VARIANTS.items()},
    **{f"simulated made {name}": (lambda more=more: simulated(made(**more), 0.2)) for name, more in VARIANTS.items()},
    "a millimetre": lambda: simulated(made(), 1e-3),
    "changed": changed,
    "effects": lambda: [[type(e).__name__, e.name, e.is_in(made())] for e in effects_of(made())],
    "many": lambda: kd.simulate_many(made(uncertainty={"q": 0.02, "restitution": 0.03}), 7, None, seed=3),
    "many courses": lambda: kd.simulate_many(made(ground=GROUND, uncertainty={"v": 0.3, "friction": 0.05}), 7, seed=1),
    "many to a plane": lambda: kd.simulate_many(made(**VARIANTS["plane"], uncertainty={"v": 0.3, "ball_velocity": 0.4}), 7, seed=1),
    "many compliant": lambda: kd.simulate_many(made(**VARIANTS["compliant"], uncertainty={"v": 0.3}), 4, seed=1),
    "wrong": lambda: faults({name: (lambda args=args: wrong(*args)) for name, args in WRONG.items()}),
}  # fmt: skip
LOOSE = {"": 1e-5}
