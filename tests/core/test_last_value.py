import numpy as np
import pytest

from kickdyn.core.last_value import keep_last


def test_only_the_last_place_is_kept():
    places = []

    @keep_last
    def squared(place):
        places.append(place.tolist())
        return place**2

    for place in ([1.0, 2.0], [1.0, 2.0], [3.0, 2.0], [1.0, 2.0]):
        assert squared(np.array(place)).tolist() == [place[0] ** 2, 4.0]
    assert places == [[1.0, 2.0], [3.0, 2.0], [1.0, 2.0]]


def test_a_failure_is_not_kept():
    @keep_last
    def inverse(place):
        return 1.0 / float(place[0])

    assert inverse(np.array([2.0])) == 0.5
    with pytest.raises(ZeroDivisionError):
        inverse(np.array([0.0]))
    assert inverse(np.array([2.0])) == 0.5


def test_a_solver_may_change_its_array_afterwards():
    kept = keep_last(lambda place: place)
    place = np.array([1.0, 2.0])
    first = kept(place)
    place[0] = 5.0
    assert first.tolist() == [1.0, 2.0]
    assert kept(place).tolist() == [5.0, 2.0]
