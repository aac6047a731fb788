import numpy as np
import pytest

from kickdyn.sweeps.chunk_log import ChunkLog


def test_a_note_is_there_whole_or_not_at_all(tmp_path):
    (tmp_path / "progress").mkdir()
    notes, front = ChunkLog(tmp_path), np.array([[1 / 3, 0.1, 7.0], [0.2, 1e-300, 2.0**53]])
    for k in (10, 9):
        notes.write(k, {"best": [1.5, k], "front": front[: k - 8]})
    (tmp_path / "progress" / "3.draft").write_text('{"be')  # killed while it wrote
    assert notes.done() == [9, 10]
    chunk_summary = notes.read(10)
    assert chunk_summary["best"] == [1.5, 10]
    assert chunk_summary["front"].tolist() == front[:2].tolist()
    with pytest.raises(OSError, match="3"):
        notes.read(3)
    notes.clear()
    assert notes.done() == []
