from kickdyn.core.files import shipped


def test_what_comes_along():
    for folder, file in (("urdf", "leg_human.urdf"), ("scenes", "volley.toml")):
        assert (shipped(folder) / file).is_file()


def test_the_wheel_has_them_beside_the_code(tmp_path, monkeypatch):
    monkeypatch.setattr(
        "kickdyn.core.files.__file__", str(tmp_path / "kickdyn" / "core" / "resources.py")
    )
    (tmp_path / "kickdyn").mkdir()
    assert shipped("urdf") == tmp_path / "urdf"
    (tmp_path / "kickdyn" / "urdf").mkdir()
    assert shipped("urdf") == tmp_path / "kickdyn" / "urdf"
