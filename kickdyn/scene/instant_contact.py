"""A scene with its contact as an instant, and what that leaves out."""

from __future__ import annotations

import math
from dataclasses import replace

from kickdyn.errors import KickdynError
from kickdyn.scene.effects import changed
from kickdyn.scene.scene import Scene
from kickdyn.scene.simulate import simulate
from kickdyn.scene.simulation import Simulation, Verdict


def simulate_as_instant(scene: Scene) -> Simulation:
    """Model everything a scene names, but for the time that its contact takes.

    Only an instant has joint impulses. What it leaves out is measured: the bound on `compliance`
    is how far its end lies from that of the whole scene, and inf where that cannot be computed.

    Args:
        scene: the kick.

    Raises:
        NoImpact: foot and ball do not approach each other.
        InvalidInput: what the scene names cannot be computed as an instant either.
        KickdynError: an integrator gave up.
    """
    answer = simulate(changed(scene, contact_time=None), None)
    if scene.contact_time is None:
        return answer
    moved, why, evaluations = math.inf, "", answer.evaluations
    try:
        whole = simulate(scene, None)
    except KickdynError as error:
        why = f"not known: {error}"
    else:
        x, y, z = whole.end.position.round(3) + 0.0  # no -0
        why = f"with it {whole.status} at ({x:.3f}, {y:.3f}, {z:.3f}) m"
        moved = math.dist(answer.end.position, whole.end.position) + whole.numerical_error
        evaluations += whole.evaluations
    others = (verdict._replace(why="all else is modelled") for verdict in answer.verdicts)
    verdicts = (Verdict("compliance", False, moved, why), *others)
    return replace(answer, scene=scene, verdicts=verdicts, evaluations=evaluations)
