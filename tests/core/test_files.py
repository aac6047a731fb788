"""Files are written whole or not at all, and lead nowhere else."""

import pytest

from kickdyn.core.files import check_outputs, check_writable, replacing, shipped, write_json
from kickdyn.errors import InvalidInput


def contents(folder):
    return {file.name: file.read_text() for file in folder.iterdir()}


def test_the_file_appears_whole_and_a_failure_leaves_the_old_one(tmp_path):
    with replacing(tmp_path / "a.txt") as draft:
        draft.write_text("new")
        assert (draft.suffix, (tmp_path / "a.txt").exists()) == (".txt", False)
    assert contents(tmp_path) == {"a.txt": "new"}
    with pytest.raises(KeyError), replacing(tmp_path / "a.txt") as draft:  # noqa: PT012
        draft.write_text("half")
        raise KeyError
    assert contents(tmp_path) == {"a.txt": "new"}


@pytest.mark.parametrize("exists", [True, False])
def test_a_link_is_refused_and_its_file_is_left_alone(tmp_path, exists):
    """In a folder that others may write to, it may lead to a file of the user."""
    precious, link = tmp_path / "precious.txt", tmp_path / "out.json"
    if exists:
        precious.write_text("precious")
    link.symlink_to(precious)
    with pytest.raises(InvalidInput, match=r"out\.json .*link"):
        write_json(str(link), {"x": 1})
    assert precious.exists() == exists
    assert not exists or precious.read_text() == "precious"


@pytest.mark.parametrize(("name", "word"), [
    ("", "empty"), ("missing/a.txt", "written"), ("a.txt/b.txt", "written"), (".", "folder"),
    ("a" * 300, "written"), ("loop", "written"), ("dangling", "written"), ("a\0b", "written"),
    ("a b/" * 500 + "c.txt", "written"), ("/dev/null", "regular")
], ids=lambda text: repr(text[:20]))  # fmt: skip
def test_places_that_cannot_be_written_are_refused_in_short(tmp_path, monkeypatch, name, word):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "a.txt").write_text("a file is no folder")
    (tmp_path / "loop").symlink_to(tmp_path / "loop")
    (tmp_path / "dangling").symlink_to(tmp_path / "nowhere" / "x")
    with pytest.raises(InvalidInput, match=word) as refused:
        check_writable(name)
    assert len(str(refused.value)) < 300


def test_outputs_are_writable_and_distinct(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "old.png").touch()
    (tmp_path / "-").mkdir()  # no file can be made there, nor need be
    assert check_outputs() == check_outputs(json_file="-") == []
    assert check_outputs(None, "b.png", tmp_path / "c.html", json_file="a.json") == []
    assert check_outputs("old.png", "new.png", inputs=["human", None]) == ["old.png"]
    for outputs, options, word in (
        (["a.json"], {"json_file": "./a.json"}, r"a\.json .*two outputs"),
        (["b", "b"], {}, "b .*two outputs"),
        (["no/b"], {}, "no/b"),
        ([None], {"json_file": "no/a.json"}, r"no/a\.json"),
        (["old.png"], {"inputs": ["./old.png"]}, r"old\.png .*input"),
    ):
        with pytest.raises(InvalidInput, match=word):
            check_outputs(*outputs, **options)
    assert {file.name for file in tmp_path.iterdir()} == {"-", "old.png"}


def test_shipped_files_are_in_the_checkout_or_in_the_wheel(tmp_path, monkeypatch):
    for folder, file in (("urdf", "leg_human.urdf"), ("scenes", "volley.toml")):
        assert (shipped(folder) / file).is_file()
    place = tmp_path / "kickdyn" / "core" / "files.py"
    monkeypatch.setattr("kickdyn.core.files.__file__", str(place))
    assert shipped("urdf") == tmp_path / "urdf"
    (tmp_path / "kickdyn" / "urdf").mkdir(parents=True)
    assert shipped("urdf") == tmp_path / "kickdyn" / "urdf"
