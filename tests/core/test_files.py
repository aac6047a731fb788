import stat

import pytest

from kickdyn.core.files import (
    check_outputs,
    check_writable,
    replacing,
    shipped,
    write_json,
)
from kickdyn.errors import InvalidInput


def test_the_file_appears_whole(tmp_path):
    with replacing(tmp_path / "a.txt") as draft:
        draft.write_text("new")
        assert draft.suffix == ".txt"
        assert not (tmp_path / "a.txt").exists()
    assert [(f.name, f.read_text()) for f in tmp_path.iterdir()] == [("a.txt", "new")]


def test_nothing_is_left_of_a_failure(tmp_path):
    (tmp_path / "a.txt").write_text("old")

    def fail():
        with replacing(tmp_path / "a.txt") as draft:
            draft.write_text("half")
            raise KeyError

    with pytest.raises(KeyError):
        fail()
    assert [(f.name, f.read_text()) for f in tmp_path.iterdir()] == [("a.txt", "old")]


def test_a_long_name_is_cut_in_the_message(tmp_path):
    for name in ("a b/" * 500 + "c.txt", "x" * 5000 + ".txt"):
        with pytest.raises(InvalidInput, match=r"\.txt cannot be written") as refused:
            check_writable(tmp_path / name)
        assert len(str(refused.value)) < 300


@pytest.mark.parametrize("mode", [0o600, 0o640, 0o755])
def test_a_file_that_is_replaced_keeps_its_permissions(tmp_path, mode):
    file = tmp_path / "a.txt"
    file.write_text("old")
    file.chmod(mode)
    with replacing(file) as draft:
        draft.write_text("new")
    assert (file.read_text(), stat.S_IMODE(file.stat().st_mode)) == ("new", mode)


@pytest.mark.parametrize("there", [True, False])
def test_a_link_is_refused_and_its_file_is_left_alone(tmp_path, there):
    """In a folder that others may write, it may lead to a file of the user."""
    precious, link = tmp_path / "precious.txt", tmp_path / "out.json"
    if there:
        precious.write_text("precious")
    link.symlink_to(precious)
    with pytest.raises(InvalidInput, match=r"out\.json cannot be written \(it is a link"):
        write_json(str(link), {"x": 1})
    assert precious.exists() == there
    assert not there or precious.read_text() == "precious"


def test_a_link_that_comes_meanwhile_is_replaced(tmp_path):
    precious, out = tmp_path / "precious.txt", tmp_path / "out.txt"
    precious.write_text("precious")
    precious.chmod(0o604)
    with replacing(out) as draft:
        draft.write_text("new")
        out.symlink_to(precious)
    assert not out.is_symlink()
    assert not out.stat().st_mode & stat.S_IWOTH
    assert (precious.read_text(), out.read_text()) == ("precious", "new")


def test_permissions_of_someone_elses_file_are_not_taken(tmp_path, monkeypatch):
    file = tmp_path / "a.txt"
    file.write_text("old")
    file.chmod(0o666)
    monkeypatch.setattr("os.geteuid", lambda: file.stat().st_uid + 1)
    with replacing(file) as draft:
        draft.write_text("new")
        usual = stat.S_IMODE(draft.stat().st_mode)
    assert stat.S_IMODE(file.stat().st_mode) == usual != 0o666


def test_devices_are_left_alone():
    with pytest.raises(InvalidInput, match="not a regular file"):
        check_writable("/dev/null")


@pytest.mark.parametrize("name", ["", "missing/a.txt", "a.txt/b.txt"])
def test_bad_places(tmp_path, name):
    (tmp_path / "a.txt").write_text("a file is no folder")
    with pytest.raises(InvalidInput, match=r"cannot be written|is a folder"):
        check_writable(tmp_path / name)


@pytest.mark.parametrize("name", ["a" * 300, "loop", "dangling", "a\0b"])
def test_names_that_lead_nowhere(tmp_path, name):
    (tmp_path / "loop").symlink_to(tmp_path / "loop")
    (tmp_path / "dangling").symlink_to(tmp_path / "nowhere" / "x")
    with pytest.raises(InvalidInput, match="cannot be written"):
        check_writable(tmp_path / name)


def test_json_goes_to_a_file_or_to_stdout(tmp_path, capsys):
    write_json(str(tmp_path / "a.json"), {"x": [1.5]})
    write_json("-", {"x": [1.5]})
    assert (
        (tmp_path / "a.json").read_text()
        == capsys.readouterr().out
        == '{\n  "x": [\n    1.5\n  ]\n}\n'
    )


def test_outputs_are_writable_and_each_its_own(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    check_outputs(None, "b.png", tmp_path / "c.html", json_file="a.json")
    (tmp_path / "-").mkdir()  # no file can be made there, nor need be
    check_outputs(json_file="-")
    check_outputs()
    for outputs, json_file in ((("a.json", None), "./a.json"), (("b", "b"), "-")):
        with pytest.raises(InvalidInput, match="named for two outputs"):
            check_outputs(*outputs, json_file=json_file)
    for outputs, json_file in ((("no/b",), None), ((None,), "no/a.json")):
        with pytest.raises(InvalidInput, match=r"^.*no/.* cannot be written"):
            check_outputs(*outputs, json_file=json_file)
    assert {file.name for file in tmp_path.iterdir()} == {"-"}


def test_outputs_that_exist_are_named_and_inputs_are_kept(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "old.png").touch()
    assert check_outputs("old.png", "new.png", json_file="-", inputs=["human", None]) == ["old.png"]
    with pytest.raises(InvalidInput, match=r"^old.png is an input"):
        check_outputs(tmp_path / "old.png", inputs=["./old.png"])


def test_links_in_a_circle_are_no_output(tmp_path):
    loop = tmp_path / "loop"
    loop.symlink_to(loop)
    with pytest.raises(InvalidInput, match="cannot be written"):
        check_outputs("a.png", loop)


def test_what_comes_along():
    for folder, file in (("urdf", "leg_human.urdf"), ("scenes", "volley.toml")):
        assert (shipped(folder) / file).is_file()


def test_the_wheel_has_them_beside_the_code(tmp_path, monkeypatch):
    monkeypatch.setattr(
        "kickdyn.core.files.__file__", str(tmp_path / "kickdyn" / "core" / "files.py")
    )
    (tmp_path / "kickdyn").mkdir()
    assert shipped("urdf") == tmp_path / "urdf"
    (tmp_path / "kickdyn" / "urdf").mkdir()
    assert shipped("urdf") == tmp_path / "kickdyn" / "urdf"
