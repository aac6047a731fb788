"""What a command refuses: exit code 2 and one line for the fault, before anything is written."""

import pytest

import kickdyn as kd

SWEEP = "posture-sweep --joint hip=0:40:20 --joint knee=10 --joint ankle=0"
PLAN = "plan --distance 12 --time 1"
TUNE = "tune-mujoco free_kick"
MOVING = "--ball-position 2,0,-0.7042 --ball-velocity=-2.5,0,0"
PART = "identify match.csv --start 0 --end 80"
LONG = "x" * 5000

REFUSED = [
    # words that click cannot read, unknown names, empty values
    ("simulat", "'simulat'", "'simulate'"),
    (f"{PLAN} --json ''", "--json is empty"),
    ("plan --time 1", "--distance"),
    (f"{PLAN} --beside 9", "'9'", "DISTANCE:LEFT"),
    (f"{PLAN} --ball-at 0,0,inf", "'0,0,inf'", "finite"),
    # leg
    (f"{SWEEP} --leg {LONG}", "xxx...xxx", "testbed"),
    (f"{SWEEP} --package-dir .", "a file", "human"),
    (f"{SWEEP} --variables carry", "--variables", "--out"),
    (f"{SWEEP} --variables carry --out s.nc --where 'impulse > 1'", "'impulse'", "knee [deg]"),
    # ball, contact, air
    (f"{SWEEP} --ball tennis", "'tennis'", "MASS:RADIUS"),
    (f"{PLAN} --wind 1e300,0,0", "wind is 1e+300", "343"),
    # files
    (f"{SWEEP} --out no/where.zarr", "no/where.zarr", "cannot be written"),
    (f"{SWEEP} --out file.zarr", "file.zarr", "--resume"),
    (f"{SWEEP} --resume", "--resume", "--out DIR.zarr"),
    (f"{SWEEP} --view p.txt", "p.txt", ".html"),
    (f"{SWEEP} --leg page.html --json page.html", "page.html", "input"),
    ("view paper_kick", "--out, --png or --json"),
    ("view paper_kick --json a.json --at 1", "--at", "--png"),
    ("tradeoff --scene paper_kick --plot x.bmp", "x.bmp", ".png"),
    ("simulate free_kick --exact --tolerance 1", "--exact", "--tolerance 1"),
    # plans
    ("plan --distance 20 --height 1 --time 0.7 --wall 9.15:1.9 --no-limits", "wall", "edge"),
    (f"{PLAN} --out a.csv", "--out is 'a.csv'", "--motion"),
    (f"{PLAN} --both-feet", "--both-feet", "--motion"),
    (f"{PLAN} --corrections 2", "--corrections is 2", "--run mujoco"),
    (f"{PLAN} --corrections 0", "--corrections", "1<=x<=10"),
    (f"{PLAN} --foot plate", "--foot is plate", "--run mujoco"),
    (f"{PLAN} --trap 0,0,0", "--trap", "--ball-position and --ball-velocity"),
    (
        f"{PLAN} {MOVING} --trap 0,0,0 --choose-surface",
        "--trap excludes --distance, --time, --choose-surface",
    ),
    (f"{PLAN} {MOVING} --ball-height 0", "--ball-position excludes", "--ball-height"),
    # MuJoCo
    (f"{TUNE} --out - --json -", "--out and --json", "one"),
    ("tune-mujoco law.toml", "'stronge'", "'newton'"),
    ("tune-mujoco stiffness.toml", "'pressure'", "contact_time_s"),
    # measured tracks
    ("identify match.csv --start 50 --end 20", "--start 50 --end 20", "116"),
    (f"{PART} --marker ball", "'ball'", "C3D"),
    (f"{PART} --drag golf", "'golf'", "constant"),
]

SCENE = (
    '[leg]\nmodel = "human"\n[posture]\nfoot_velocity_m_s = [5, 0, 2]\n'
    "[contact]\nattack_deg = 30\nrestitution = 0.7\n"
)


@pytest.mark.parametrize(("line", "said"), [(line, said) for line, *said in REFUSED],
                         ids=[line[:90] for line, *_ in REFUSED])  # fmt: skip
def test_a_fault_is_one_line_with_the_value_and_what_is_valid(
    line, said, kickdyn, written, match_ball, tmp_path
):
    written("page.html", "<html><body/></html>")
    written("file.zarr", "no store")
    written("law.toml", f'{SCENE}law = "stronge"\n')
    written("stiffness.toml", f'{SCENE}stiffness = "pressure"\n[ball]\npressure_pa = 80e3\n')
    match_ball(2808, 2924)
    before = set(tmp_path.iterdir())
    ended = kickdyn(line, code=2)
    assert ended.out == ""
    assert ended.err.startswith("kickdyn: ")
    assert ended.err.count("\n") == 1, ended.err
    assert len(ended.err) < 2000
    for word in said:
        assert word in ended.err
    assert set(tmp_path.iterdir()) == before


@pytest.mark.parametrize("name", ["carry", "status", "a/b", "."])
def test_a_joint_whose_name_a_dataset_cannot_hold_is_refused(name, kickdyn, written):
    written("mine.urdf", kd.Leg.human().file.text.replace('"hip"', f'"{name}"'))
    ended = kickdyn(f"posture-sweep --leg mine.urdf --joint {name}=0:10:5 --out x.nc", code=2)
    assert f"joint '{name}' cannot be swept" in ended.err
