import pytest

from kickdyn.sweep.notes import Notes


def test_a_note_is_there_whole_or_not_at_all(tmp_path):
    (tmp_path / "progress").mkdir()
    notes = Notes(tmp_path)
    for k in (10, 9):
        notes.write(k, {"best": [1.5, k]})
    (tmp_path / "progress" / "3.draft").write_text('{"be')  # killed while it wrote
    assert notes.done() == [9, 10]
    assert notes.read(10) == {"best": [1.5, 10]}
    with pytest.raises(OSError, match="3"):
        notes.read(3)
    notes.clear()
    assert notes.done() == []
