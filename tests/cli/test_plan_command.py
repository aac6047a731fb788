"""The planner's door, as a user opens it."""

import json
import math
import re
import subprocess
import sys
from html import escape

import numpy as np
import pytest
from click.testing import CliRunner

import kickdyn as kd
from kickdyn.cli.plan_command import plan
from kickdyn.core import console

MOVING = ["--ball-position", "2,0,-0.7042", "--ball-velocity=-2.5,0,0"]


def door(*arguments, cwd=None):
    noise = "ignore:zmq.eventloop.ioloop is deprecated"  # meshcat's
    command = [
        sys.executable,
        "-W",
        "error",
        "-W",
        noise,
        "-m",
        "kickdyn",
        "plan",
        *arguments,
    ]
    return subprocess.run(command, capture_output=True, text=True, timeout=3600, cwd=cwd)


def test_text_and_files(tmp_path):
    files = ["--view", "kick.html", "--json", "kick.json"]
    ended = door("--distance", "30", "--time", "1.5", "--leg", "human", *files, cwd=tmp_path)
    assert (ended.returncode, ended.stderr) == (0, "")
    for words in (
        "The ball reaches the target (30, 0, 0) m after 1.5 s",
        "launch  24.85",
        "wrote kick.html",
    ):
        assert words in ended.stdout
    page = (tmp_path / "kick.html").read_text()
    assert "The ball reaches the target (30, 0, 0) m" in page
    assert "still aloft" not in page
    report = json.loads((tmp_path / "kick.json").read_text())
    assert report["status"] == "met"
    assert report["landing_error"] < 1e-3
    assert set(report["leg"]["q_deg"]) == {"hip", "knee", "ankle"}


def test_a_drag_coefficient_is_a_number_or_a_name(tmp_path):
    found = {}
    for drag in ("0", "0.25", "brazuca"):
        words = ["--distance", "12", "--apex", "2", "--spin", "0,0,0", "--drag", drag]
        ended = CliRunner().invoke(plan, [*words, "--json", str(tmp_path / "plan.json")])
        assert ended.exception is None, ended.exception
        launch = json.loads((tmp_path / "plan.json").read_text())["launch"]
        found[drag] = launch["speed"]
    assert found["0"] < found["0.25"] < found["brazuca"]
    for words, said in (
        (["--drag", "-1"], "--drag is -1.0: it must be a finite number at least 0"),
        (["--drag", "golf"], "--drag is 'golf': it must be a number such as 0.25, or one of"),
        (["--drag", "0.2", "--air", "none"], "--drag is 0.2, but --air is none"),
    ):
        ended = CliRunner().invoke(plan, ["--distance", "12", "--apex", "2", *words])
        assert said in str(ended.exception)


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["--distance", "20000"], "distance is 20000.0: .* at most 10000"),
        (
            ["--ball-height", "0", "--ball-at", "0,0,0"],
            "--ball-height and --ball-at are both given",
        ),
        (["--time", "1"], "time and apex are given"),
        (["--motion", "--no-limits"], "limits is False: a motion is planned within limits"),
    ],
)
def test_messages_have_the_words_of_the_options(words, said):
    ended = CliRunner().invoke(plan, ["--distance", "12", "--apex", "2", *words])
    assert re.search(said, str(ended.exception))


def test_json_on_stdout_is_a_kick_that_can_be_done_again():
    over = ["--height", "2.2", "--over", "9.15:2.15"]
    ended = door("--distance", "20.3", *over, "--json", "-")
    report = json.loads(ended.stdout)
    leg = kd.Leg.human()
    q = leg.configuration(
        {k: v * 3.141592653589793 / 180 for k, v in report["leg"]["q_deg"].items()}
    )
    impact_target = kd.Contact(report["impact"]["normal"], 0.8, 0.4)
    hit = kd.strike(leg.posture(q), report["leg"]["v"], kd.Ball(), impact_target)
    path = kd.fly(hit.ball_after, kd.Ball(), kd.Air(), kd.Ground(-5.0))
    start = hit.ball_after.position
    assert path.arrival(start[0] + 20.3).position[2] - start[2] == pytest.approx(2.2, abs=1e-6)
    assert path.arrival(start[0] + 9.15).position[2] - start[2] == pytest.approx(2.15, abs=1e-6)


def test_a_planar_leg_is_turned_and_says_so():
    ended = door("--distance", "20", "--left", "3.4", "--time", "1.1")
    assert ended.returncode == 0
    assert "base    turned by 9.6" in ended.stdout


def test_a_free_kick_over_a_wall_into_the_corner(tmp_path):
    where = ["--distance", "20", "--left", "3.4", "--height", "2.1", "--wall", "9.15:1.9", "--goal"]
    ended = door(*where, "--view", "free.html", "--json", "free.json", cwd=tmp_path)
    assert (ended.returncode, ended.stderr) == (0, "")
    assert "The lower edge of the ball clears the wall by 0.1 m." in ended.stdout
    assert "The ball enters the goal" in (tmp_path / "free.html").read_text()
    report = json.loads((tmp_path / "free.json").read_text())
    assert report["goal"]["over"] == [9.15, 2.0]
    assert report["wall"]["above"] == pytest.approx(0.1, abs=1e-6)
    assert report["wall"]["beside"] < 0
    post, bar = 7.32 / 2 - 3.4 - kd.Ball().radius, 2.44 - 2.1 - 2 * kd.Ball().radius
    assert f"enters the goal, {post:.3g} m from the post and {bar:.3g} m under" in ended.stdout
    assert report["goal_mouth"]["post"] == pytest.approx(post, abs=1e-6)
    assert report["goal_mouth"]["bar"] == pytest.approx(bar, abs=1e-6)
    assert report["goal_mouth"]["end"] == "in"


def test_json_says_what_else_is_known():
    far = ["--distance", "50", "--time", "2", "--beside", "9.15:0.9", "--json", "-"]
    ended = door(*far, "--leg", "g1", "--no-limits")
    assert json.loads(ended.stdout)["goal"]["beside"] == [9.15, 0.9]


def test_python_plans_the_same_kick_where_it_is_told_where_the_ball_lies():
    leg = kd.Leg.human()
    plan = kd.plan_kick(leg, kd.Goal(25, time=1.6), kd.Ball(), kd.Air(), ball_position=-0.7042)
    ended = door("--distance", "25", "--time", "1.6", "--json", "-")
    kick = json.loads(ended.stdout)["leg"]
    assert kick["q_deg"] == pytest.approx(leg.angles_deg(plan.q), abs=0.02)
    assert kick["v"] == pytest.approx(plan.v.tolist(), abs=0.02)


def test_the_flight_s_warnings_are_in_table_page_and_json(tmp_path):
    files = ["--view", "kick.html", "--json", "kick.json"]
    ended = door("--distance", "100", "--time", "3", "--no-limits", *files, cwd=tmp_path)
    lines = json.loads((tmp_path / "kick.json").read_text())["warnings"]
    assert re.match(r"drag supercritical: \d+ % of the flight is outside its data", lines[0])
    page = (tmp_path / "kick.html").read_text()
    for line in lines:
        assert f"\nWarning: {line}.\n" in ended.stdout
        assert f'<p class="warning">{escape(line)}</p>' in page


def test_an_unreachable_goal_has_json_with_the_nearest():
    ended = door("--distance", "20", "--launch-speed", "5", "--json", "-")
    assert ended.returncode == 2
    report = json.loads(ended.stdout)
    assert (report["status"], report["limit"]) == ("unreachable", "least-speed")
    assert report["nearest"]["target_m"] == [20, 0, 0]
    assert report["nearest"]["speed"] > 5
    assert report["nearest"]["launch_speed"] == pytest.approx(report["nearest"]["speed"])
    ended = door("--distance", "20", "--time", "60", "--pass", "turf", "--json", "-")
    assert ended.returncode == 2
    report = json.loads(ended.stdout)
    assert report["limit"] == "rolling"
    assert 0 < report["nearest"]["time"] < 60


def test_a_wall_that_is_hit_is_an_error():
    flat = ["--distance", "20", "--height", "1", "--wall", "9.15:1.9"]
    ended = CliRunner().invoke(plan, [*flat, "--time", "0.7", "--no-limits"])
    assert isinstance(ended.exception, kd.InvalidInput)
    assert str(ended.exception).endswith("from its edge")
    assert (
        "clears the wall by 0.1 m" in CliRunner().invoke(plan, [*flat, "--over", "9.15:2"]).output
    )
    rolling = ["--distance", "8", "--time", "2", "--pass", "carpet", "--wall", "4:1"]
    assert str(CliRunner().invoke(plan, rolling).exception).endswith("from its edge")


def test_a_pass_of_a_robot_has_a_page(tmp_path):
    where = ["--distance", "4", "--left", "1", "--time", "2", "--pass", "carpet", "--leg", "g1"]
    ended = door(*where, "--view", "pass.html", cwd=tmp_path)
    assert (ended.returncode, ended.stderr) == (0, "")
    assert "m along the ground" in (tmp_path / "pass.html").read_text()


def test_a_robot_and_a_goal_beyond_its_limits():
    ended = door("--distance", "60", "--time", "2", "--leg", "g1", "--json", "-")
    report = json.loads(ended.stdout)
    assert ended.returncode == 0
    assert report["status"] == "beyond-limits"
    assert report["share"] < 1
    assert report["leg"]["speed_use"] <= 1


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["--time", "1"], "Missing option '--distance'"),
        (
            ["--trap", "0,0,0"],
            "--ball-position and --ball-velocity missing: --trap is for a moving",
        ),
        (
            [*MOVING, "--trap", "0,0,0", "--distance", "9", "--pass", "turf"],
            "--trap excludes --distance, --pass: a trap has no target",
        ),
        (["--distance", "30"], "nothing is given in addition to the target"),
        (
            ["--distance", "30", "--time", "1", "--launch-speed", "20"],
            "time and speed are",
        ),
        (["--distance", "30"], "give one of time, apex, speed, over"),
        (["--distance", "30", "--launch-speed", "-1"], "speed is -1.0"),
        (["--distance", "30", "--time", "1", "--height", "nan"], "target"),
        (["--distance", "30", "--time", "1", "--left", "inf"], "target"),
        (["--distance", "30", "--time", "1", "--ball-height", "1e300"], "ball_position is 1e+300"),
        (
            ["--distance", "30", "--time", "1", "--ball-at", "0,0,1e300"],
            "ball_position is [0.0, 0.0, 1e",
        ),
        (["--distance", "30", "--time", "1", "--json", ""], "--json is empty: it needs a value"),
        (["--distance", "30", "--time", "-1"], "time is -1.0"),
        (["--distance", "20", "--time", "1e-300"], "time is 1e-300: it must be"),
        (["--distance", "nan", "--time", "1"], "distance is nan"),
        (
            ["--distance", "30", "--apex", "1", "--height", "3"],
            "no flight to the target stays that low; ",
        ),
        (
            [
                "--distance",
                "20",
                "--time",
                "0.7",
                "--height",
                "2",
                "--wall",
                "9.15:1.9",
                "--no-limits",
            ],
            "the ball hits the wall",
        ),
        (["--distance", "20", "--wall", "9.15"], "wall is '9.15'"),
        (["--distance", "20", "--wall", "25:1.9"], "wall is at 25 m"),
        (["--distance", "20", "--time", "0", "--wall", "9.15:1.9"], "time is 0.0"),
        (
            ["--distance", "20", "--time", "1", "--beside", "9"],
            "Invalid value for '--beside': '9' is not DISTANCE:LEFT",
        ),
        (
            ["--distance", "4", "--apex", "1", "--pass", "turf"],
            "not valid for a pass: it must have a time",
        ),
        (
            ["--distance", "30", "--over", "3"],
            "Invalid value for '--over': '3' is not DISTANCE:HEIGHT",
        ),
        (
            ["--distance", "30", "--time", "1", "--spin", "1,2"],
            "Invalid value for '--spin': '1,2' is not X,Y,Z",
        ),
        (
            ["--distance", "30", "--time", "1", "--wind", "1,2,x"],
            "'--wind': '1,2,x' is not X,Y,Z, such as 0.1,0.2,0.3",
        ),
        (
            ["--distance", "30", "--time", "1", "--wind", "1,0,0", "--air", "none"],
            "but --air is none: there is no wind",
        ),
        (["--distance", "15", "--time", "1", "--spin", "0,0,9"], "cannot give this spin"),
        (
            ["--distance", "30", "--time", "1", "--leg", "dog"],
            "leg 'dog' is neither human, testbed",
        ),
        (
            ["--distance", "30", "--time", "1", "--ball-height", "3"],
            "can give a ball at a height of 3 m",
        ),
        (["--distance", "30", "--time", "1", "--restitution", "2"], "restitution is 2"),
        (["--distance", "30", "--time", "1", "--restitution", "5:1,6:0"], "a faster foot would"),
        (["--distance", "30", "--time", "1", "--restitution", "5:1:6"], "a table such as 5:0.8"),
        (["--distance", "30", "--time", "1", "--view", "no/where.html"], "cannot be written"),
        (["--distance", "30", "--time", "1", "--objective", "x"], "'x' is not one of"),
        (["--distance", "30", "--time", "1", "--plot", "a.png"], "so add --motion"),
        (
            ["--distance", "9", "--time", "1", "--ball-at", "1,2"],
            "Invalid value for '--ball-at': '1,2' is not X,Y,Z",
        ),
        (["--distance", "9", "--time", "1", "--motion", "--plot", "a.x"], "no known extension"),
    ],
)
def test_bad_input_is_one_line(arguments, words):
    from click.testing import CliRunner

    from kickdyn.cli.plan_command import plan

    ended = CliRunner().invoke(plan, arguments)
    assert words in (str(ended.exception) if ended.exit_code == 1 else ended.output)


def test_bad_input_leaves_with_two_and_no_traceback():
    ended = door("--distance", "30", "--time", "-1")
    assert (ended.returncode, ended.stdout) == (2, "")
    assert ended.stderr.startswith("kickdyn: time is -1.0")
    assert ended.stderr.count("\n") == 1


def test_a_motion_is_planned_drawn_and_shown(tmp_path):
    files = ["--view", "kick.html", "--plot", "motion.svg", "--json", "kick.json"]
    ended = door("--distance", "10", "--time", "1", "--motion", *files, cwd=tmp_path)
    assert (ended.returncode, ended.stderr) == (0, "")
    assert "The motion takes " in ended.stdout
    assert "The motion takes " in (tmp_path / "kick.html").read_text()
    assert (tmp_path / "motion.svg").stat().st_size > 10_000
    report = json.loads((tmp_path / "kick.json").read_text())
    motion, v = report["motion"], report["leg"]["v"]
    assert motion["v"][motion["time"].index(0.0)] == pytest.approx(v, abs=1e-9)
    assert motion["v"][0] == pytest.approx([0, 0, 0], abs=1e-9)
    assert motion["v"][-1] == pytest.approx([0, 0, 0], abs=1e-9)


def test_it_fits_the_screen(monkeypatch):
    wide = CliRunner().invoke(plan, ["--distance", "100", "--time", "3", "--no-limits"]).stdout
    monkeypatch.setattr(console, "screen_width", lambda: 80)
    narrow = CliRunner().invoke(plan, ["--distance", "100", "--time", "3", "--no-limits"]).stdout
    assert max(map(len, narrow.splitlines())) <= 80 < max(map(len, wide.splitlines()))
    assert narrow.split() == wide.split()


def test_the_ball_of_a_plan():
    options = ["--distance", "10", "--time", "1", "--json", "-", "--ball"]
    impulses = {}
    for ball in ("paper", "size-5"):
        ended = CliRunner().invoke(plan, [*options, ball])
        assert ended.exit_code == 0, ended.output
        impulses[ball] = json.loads(ended.stdout)["impact"]["impulse"]
    assert impulses["paper"] != impulses["size-5"]
    refused = CliRunner().invoke(plan, [*options, "inf:0.1"])
    assert "ball mass is inf: it must be a finite number" in str(refused.exception)


def test_wind_and_offset_are_those_of_the_plan(tmp_path):
    file = tmp_path / "kick.json"
    options = ["--wind", "2,-1,0", "--offset", "0.02,0,0.01"]
    where = ["--distance", "10", "--launch-speed", "14", "--ball-height", "-0.7"]
    assert CliRunner().invoke(plan, [*where, *options, "--json", str(file)]).exit_code == 0
    report, goal = json.loads(file.read_text()), kd.Goal(10, speed=14)
    launch = kd.plan_launch(goal, kd.Ball(), kd.Air(wind=(2, -1, 0)))
    assert report["launch"]["velocity"] == pytest.approx(launch.velocity.tolist(), abs=1e-6)
    angles = {name: math.radians(value) for name, value in report["leg"]["q_deg"].items()}
    leg = kd.Leg.human()
    foot = leg.posture(leg.configuration(angles)).with_contact_offset((0.02, 0, 0.01))
    centre = foot.contact_point + kd.Ball().radius * np.array(report["impact"]["normal"])
    assert centre[2] == pytest.approx(-0.7, abs=1e-4)


G1 = ["--leg", "g1", "--support", "left_ankle_roll_link:0.7", "--distance", "3", "--time", "0.4"]


def test_a_robot_on_a_support_says_how_it_stands(tmp_path):
    file = tmp_path / "kick.json"
    ended = CliRunner().invoke(plan, [*G1, "--json", str(file)])
    said = " ".join(ended.output.split())
    assert "The robot stands on left_ankle_roll_link, with its centre of mass" in said
    assert "this foot turns about the vertical: friction cannot supply" in said
    stance = json.loads(file.read_text())["stance"]
    assert stance["footing"] == {"left_ankle_roll_link": "turns"}
    assert 0.0 <= stance["balance"] < 0.1
    x, y, z, *_ = stance["impulse"]["left_ankle_roll_link"]
    assert math.hypot(x, y) / z == pytest.approx(stance["friction"]["left_ankle_roll_link"])
    assert stance["friction"]["left_ankle_roll_link"] <= 0.7


def test_feet_under_the_ground_are_announced(tmp_path):
    file = tmp_path / "kick.json"
    arguments = ["--leg", "g1", "--distance", "1.5", "--time", "0.5", "--json", str(file)]
    ended = CliRunner().invoke(plan, arguments)
    (line,) = (x for x in json.loads(file.read_text())["warnings"] if "under the ground" in x)
    assert line.startswith("bodies are under the ground at the impact: ")
    assert line in " ".join(ended.output.split())
    depths = {frame: float(depth) for frame, depth in re.findall(r"(\w+) by (0\.\d+) m", line)}
    assert 0.07 < depths["left_ankle_roll_link"] < 0.1
    assert depths["right_ankle_roll_link"] > 0.07


@pytest.mark.parametrize(
    ("more", "message"),
    [
        (
            ["--motion", "--objective", "foot-speed"],
            "objective is foot-speed: a motion",
        ),
        (["--ball-height", "0.5"], "lies on its ground, at 0.109817 m"),
        (["--support", "right_knee_link"], "support right_knee_link is on the kicking limb"),
        (["--support", "pelvis"], "stands on left_ankle_roll_link, pelvis: kicks are planned from"),
        (["--loop", "left_knee_link:torso_link"], "one support (Leg.with_supports) and no loops"),
        (["--support", "left_knee_link:much"], "--support is 'left_knee_link:much': it must be a"),
    ],
)
def test_a_robot_that_cannot_stand_so_is_refused_in_one_line(more, message):
    ended = CliRunner().invoke(plan, [*G1, *more])
    assert isinstance(ended.exception, kd.InvalidInput)
    assert message in str(ended.exception)
    assert "\n" not in str(ended.exception)


@pytest.mark.parametrize("wind", ["1e300,0,0", "0,-1e300,0", "0,0,1e300"])
def test_a_wind_faster_than_sound_is_refused_at_once(wind):
    ended = door("--distance", "20", "--time", "1", "--wind", wind)
    assert ended.returncode == 2
    assert "wind is 1e+300: it must be a finite number at most 343 [m/s]" in " ".join(
        ended.stderr.split()
    )


def test_the_page_shows_the_goal_at_the_target_and_its_warnings_are_printed(tmp_path, monkeypatch):
    shown, real = [], kd.page

    def page(made, **options):
        shown.append((made, options))
        saved = real(made, **options)
        saved.warnings = ("a mesh is missing",)
        return saved

    monkeypatch.setattr("kickdyn.view.page.page", page)
    where = ["--distance", "11", "--left", "2", "--height", "1", "--time", "0.6", "--goal"]
    ended = CliRunner().invoke(plan, [*where, "--view", str(tmp_path / "kick.html")])
    assert ended.exception is None, ended.exception
    assert "warning: a mesh is missing" in ended.stderr.splitlines()
    ((made, options),) = shown
    ball = made.path.launch.position
    foot = [ball[0], ball[1], ball[2] - kd.Ball().radius]
    corners = np.vstack([box.corners() for box in options["scenery"]]) - foot
    assert len(options["scenery"]) == 3
    assert corners[:, 0] == pytest.approx(np.full(len(corners), 11.0), abs=0.1)
    assert corners[:, 1].min() == pytest.approx(-corners[:, 1].max())
    assert corners[:, 2].min() == pytest.approx(0.0)


def test_a_ball_that_moves_is_trapped_or_drawn_with_its_meetings(tmp_path):
    files = ["--json", str(tmp_path / "plan.json"), "--plot", str(tmp_path / "plan.png")]
    ended = CliRunner().invoke(plan, [*MOVING, "--trap", "0,0,0", *files])
    assert ended.exception is None, ended.exception
    report = json.loads((tmp_path / "plan.json").read_text())
    assert report["launch"]["speed"] < 1e-9
    assert report["meetings"]
    assert (tmp_path / "plan.png").stat().st_size > 5000
    assert "The foot leaves the ball at rest" in ended.output


def test_commands_with_a_base_that_moves_are_those_in_another_frame(tmp_path):
    """In a vacuum; seen from the hip, ball and target move with the opposite velocity."""
    shared = ["--time", "0.8", "--air", "none", "--meet-at", "0", "--ball-position", "0.5,0,-0.7"]
    documents = []
    for arguments in (
        ["--base-velocity", "2,0,0.2", "--distance", "15", "--ball-velocity=-3,0,0.5"],
        ["--height=-0.16", "--distance", "13.4", "--ball-velocity=-5,0,0.3"],
    ):
        file = tmp_path / f"{len(documents)}.json"
        assert CliRunner().invoke(plan, [*shared, *arguments, "--json", str(file)]).exit_code == 0
        documents.append(json.loads(file.read_text()))
    here, there = documents
    impulses = here["impact"]["impulse"], there["impact"]["impulse"]
    assert impulses[0] == pytest.approx(impulses[1], rel=1e-13, abs=1e-13)
    assert here["impact"]["foot_velocity"] == pytest.approx(
        np.add(there["impact"]["foot_velocity"], [2, 0, 0.2]), rel=1e-13, abs=1e-13
    )
    assert here["leg"]["v"] == pytest.approx(there["leg"]["v"], abs=1e-11)
    assert here["leg"]["q_deg"] == pytest.approx(there["leg"]["q_deg"], abs=1e-10)
