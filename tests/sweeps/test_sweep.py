import math
import subprocess
import sys
import textwrap
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest
from chains import constraint_speed

import kickdyn as kd
from kickdyn.robot.urdf_file import shipped_urdf
from kickdyn.sweeps import chunk_solver
from kickdyn.sweeps.dataset import VARIABLES
from kickdyn.sweeps.grid import read_postures
from kickdyn.sweeps.queries import outcome_at
from kickdyn.sweeps.sweep import sweep_chunks
from kickdyn.sweeps.sweep_kick import PostureStatus, kick_from

LEG = kd.Leg.human()
KICK = kd.Kick(attack=0.0)


def swept(*joints, kick=KICK, leg=LEG, **how):
    return kd.sweep(leg, read_postures(leg, joints), kick, **how)


@pytest.fixture(scope="module")
def small():
    return swept("hip=0:90:45", "knee=0:30:15", "ankle=0:50:50")


def test_every_cell_is_the_posture_it_says(small):
    for hip in range(3):
        for ankle in range(2):
            cell = small.isel(hip=hip, knee=1, ankle=ankle)
            q = [float(cell.hip), float(cell.knee), float(cell.ankle)]
            outcome = kick_from(LEG.posture(q), KICK)
            assert float(cell.speed_ratio) == outcome.impact.speed_ratio
            assert float(cell.effective_mass) == outcome.impact.effective_mass
            assert float(cell.carry) == outcome.carry
            assert float(cell.worst_joint_impulse) == outcome.impact.worst_joint[1]


def test_many_are_what_each_is(monkeypatch):
    kick = kd.Kick(attack=0.0, speed=9.0)
    joints = ("hip=-20:100:8", "knee=0:130:13", "ankle=-20:50:7")
    one_by_one = swept(*joints, kick=kick)
    monkeypatch.setattr(chunk_solver, "KERNEL_FROM", 1)
    together = swept(*joints, kick=kick, tolerance=0, threads=2)
    assert set(np.unique(one_by_one.status)) == {0, 1}
    for name in {*VARIABLES, "status"} - {"restitution_residual", "momentum_residual"}:
        slack = 1e-8 if name == "carry" else 1e-12
        assert together[name].values == pytest.approx(one_by_one[name].values, rel=slack, abs=1e-12)
    within = swept(*joints, kick=kick, tolerance=1e-4)
    assert 0 < abs(within.carry - together.carry).max() <= 1e-4
    assert within.attrs["carry_tolerance_m"] == 1e-4


def test_units_and_provenance(small):
    assert {name: small[name].attrs["units"] for name in VARIABLES} == {
        name: unit for name, (unit, _) in VARIABLES.items()
    }
    assert small.hip.attrs["units"] == "rad"
    assert small.hip_deg.values == pytest.approx([0, 45, 90])
    assert small.attrs["source"].startswith(f"kickdyn {kd.__version__} (pin 4.")
    assert len(small.attrs["leg_sha256"]) == 64
    assert (small.attrs["attack_deg"], small.attrs["finished"]) == (0.0, 1)
    assert small.status.attrs["flag_meanings"] == (
        "ok too-fast out-of-reach not-closed not-computed"
    )
    assert small.status.attrs["flag_values"].tolist() == [0, 1, 2, 3, -1]


def test_nan_only_where_the_status_says_out_of_reach():
    model = LEG.model
    model.upperPositionLimit = np.array([2.0, 2.0, 2.0])
    leg = kd.Leg.from_model(model, "toe")
    data = swept("hip=90", "knee=0", "ankle=80:90:10", leg=leg, kick=kd.Kick(attack=0, speed=0.1))
    assert data.status.values.ravel().tolist() == [0, 2]
    for name in VARIABLES:
        assert np.isnan(data[name].values.ravel()).tolist() == [False, True]


def test_residuals_stay_at_rounding(small):
    assert float(small.restitution_residual.max()) < 1e-12
    assert float(small.momentum_residual.max()) < 1e-12


def test_progress_counts_postures(small):
    calls = []
    swept("hip=0:90:45", "knee=0:30:15", "ankle=0:50:50", progress=calls.append)
    assert sum(calls) == small.status.size


def test_attack_down_does_not_carry():
    data = swept("knee=10", kick=kd.Kick(attack=math.radians(-40)))
    assert float(data.carry[0]) == 0.0


def test_chunks_are_the_whole(small, monkeypatch):
    monkeypatch.setattr(chunk_solver, "SLOW_CHUNK", 5)
    postures = read_postures(LEG, ["hip=0:90:45", "knee=0:30:15", "ankle=0:50:50"])
    seen = list(sweep_chunks(LEG, postures, KICK, threads=2.0))  # a whole number of any type
    assert [chunk.status.size for chunk in seen] == [4, 2] * 3
    for name in (*VARIABLES, "status"):
        values = np.concatenate([chunk[name].values.ravel() for chunk in seen])
        assert (values == small[name].values.ravel()).all()
    assert seen[1].knee_deg.values == pytest.approx([30])


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"leg": "human"}, "leg is 'human': it must be a kickdyn.Leg"),
        ({"kick": 3.0}, "kick is 3.0: it must be a kickdyn.Kick"),
        ({"tolerance": -1.0}, "tolerance is -1"),
        ({"threads": 0}, "threads is 0"),
        ({"threads": 2, "executor": ThreadPoolExecutor(1)}, "exclude each other"),
        ({"resume": True}, "need a store"),
        ({"executor": ThreadPoolExecutor(1)}, "need a store"),
        ({"executor": 3}, "executor is 3: it must be a Executor or None"),
        ({"postures": {"hip": np.linspace(0, 1, 1001), "knee": np.linspace(0, 1, 1001)}},
         "1,002,001 postures .* name a store"),
    ],
)  # fmt: skip
def test_bad_input_is_one_line(change, words):
    arguments = {"leg": LEG, "postures": {"hip": 0.1}, "kick": KICK, **change}
    with pytest.raises(kd.InvalidInput, match=words) as refused:
        kd.sweep(**arguments)
    assert "\n" not in str(refused.value)


def test_a_leg_without_a_kernel_is_swept_one_by_one(monkeypatch):
    monkeypatch.setattr(chunk_solver, "KERNEL_FROM", 1)
    robot = kd.Leg.from_robot("bolt", base="floating")
    leg = robot.with_supports(kd.Support("FL_FOOT", point=True))
    data = swept("FR_HFE=-30:30:30", leg=leg, kick=kd.Kick(speed=2.0, air=None))
    q = leg.configuration({"FR_HFE": np.radians(30)})
    outcome = kick_from(leg.posture(q), kd.Kick(speed=2.0, air=None))
    assert float(data.ball_speed[-1]) == outcome.impact.ball_after.speed


def test_importing_compiles_nothing():
    script = """
        import sys
        import numba
        from numba.core.dispatcher import Dispatcher
        calls = []
        compile = Dispatcher.compile
        def watched(self, *signature):
            if self.py_func.__module__.startswith("kickdyn.sweeps"):
                calls.append(self)
            return compile(self, *signature)
        Dispatcher.compile = watched
        import kickdyn.sweeps.sweep, kickdyn.sweeps.kernel, kickdyn.sweeps.carry_table
        sys.exit(len(calls))
    """
    assert subprocess.run([sys.executable, "-c", textwrap.dedent(script)]).returncode == 0


def test_a_sweep_of_loops_and_supports_is_single_strikes():
    """Row by row, whatever joints close the loop; the best report closes it too."""
    fourbar = kd.Leg.from_urdf(shipped_urdf("leg_fourbar.urdf"))
    leg = fourbar.with_loops(("shank_pin", "rocker_b_tip"))
    robot = kd.Leg.from_robot("bolt", base="floating").with_supports("FL_FOOT")
    kick = kd.Kick(air=None)
    for each, joints in (
        (leg, {"rocker_a": [0.0, 0.2, 0.41], "hip": [0.0, 0.5]}),
        (robot, {"FR_KFE": [0.0, 0.6], "FR_HFE": [0.1, 0.3]}),
    ):
        data = kd.sweep(each, joints, kick)
        for index in np.ndindex(*data.status.shape):
            one = data.isel(dict(zip(joints, index, strict=True)))
            if one.status == PostureStatus.NOT_CLOSED.flag:
                assert float(one.rocker_a) == 0.41
                assert np.isnan([float(one[name]) for name in VARIABLES]).all()
                continue
            named = {name: float(one[name]) for name in joints}
            posture = each.posture(each.close_loops(each.configuration(named), keep=named))
            impact = kick_from(posture, kick).impact
            assert float(one.ball_speed) == pytest.approx(impact.ball_after.speed, rel=1e-12)
            assert impact.momentum_residual <= 1e-12
            assert constraint_speed(impact) <= 1e-10
            assert outcome_at(each, kick, one).impact.ball_after.speed == pytest.approx(
                impact.ball_after.speed, rel=1e-12
            )
