import numpy as np
import pytest

from kickdyn.sweeps.chunk_layout import Cut


@pytest.mark.parametrize(
    ("shape", "chunk"),
    [((7, 7, 6), (1, 7, 6)), ((10, 10, 300), (1, 1, 50)), ((3, 4), (3, 4)), ((100,), (50,)),
     ((51,), (26,)), ((9, 30), (1, 30)), ((4, 12), (4, 12)), ((5, 12), (3, 12))],
)  # fmt: skip
def test_chunks_are_consecutive_postures_of_like_size(shape, chunk):
    cut = Cut.of(shape, 50)
    assert cut.chunk == chunk
    number = np.arange(np.prod(shape)).reshape(shape)
    seen = []
    for k in range(len(cut)):
        first, count = cut.span(k)
        here = number[cut.region(k)].ravel().tolist()
        assert here == list(range(first, first + count))
        seen += here
    assert seen == list(range(number.size))
