import numpy as np

from kickdyn.view.camera import LEFT, Camera
from kickdyn.view.label_places import LabelPlaces

ASIDE = Camera(np.array([0.0, -5.0, 0.0]), np.zeros(3))


def frame(label, at):
    centre, half = label.frame
    return ASIDE.across(at) + centre, half


def test_no_label_covers_another():
    places = LabelPlaces(ASIDE)
    spots = [np.array([0.02 * number, 0.0, 0.0]) for number in range(12)]
    frames = [frame(places.label("1.23 N s", 0, spot), spot) for spot in spots]
    for number, (centre, half) in enumerate(frames):
        for other, its in frames[:number]:
            assert (abs(centre - other) > 0.999 * (half + its)).any()


def test_where_there_is_no_room_there_is_no_label():
    places = LabelPlaces(ASIDE)
    labels = [places.label("1.23 N s", 0, np.zeros(3)) for _ in range(60)]
    placed = [label is not None for label in labels]
    assert placed[:30] == [True] * 30
    assert not placed[-1]


def test_a_label_stays_off_its_own_arrow():
    """One that points to the right has it at the right, one to the left at the left."""
    for way in (1.0, -1.0):
        places = LabelPlaces(ASIDE)
        tip = np.array([0.5 * way, 0.0, 0.0])
        places.keep_clear(np.zeros(3), tip)
        label = places.label("1.23 N s", 0, tip)
        assert (label.left, label.row) == (way < 0, 0.0)


def test_a_label_is_in_the_picture_and_not_under_the_caption():
    for x, left in ((3.5, True), (-0.99 * 5 * LEFT, False)):
        at = np.array([x, 0.0, 0.0])
        places = LabelPlaces(ASIDE)
        if not left:  # where it would stand otherwise
            places.keep_clear(np.zeros(3), at)
        assert places.label("1.23 N s", 0, at).left is left
