import numpy as np
import pytest

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


def outline(start, end):
    """Middle and both sides of an arrow in the plane of the picture, as `draw_arrow` draws it."""
    way, origin = (end - start)[[0, 2]] / 5, start[[0, 2]] / 5
    shares = np.linspace(0.0, 1.0, 101)[:, None]
    wide = np.where(shares < 0.72, 0.028, 3 * 0.028 * (1 - shares) / 0.28)
    sides = (k * wide * (-way[1], way[0]) for k in (-1, 0, 1))
    return np.concatenate([origin + shares * way + side for side in sides])


@pytest.mark.parametrize("seed", range(20))
def test_no_label_and_no_line_to_one_covers_an_arrow_where_there_is_room(seed):
    random = np.random.default_rng(seed)
    starts = random.uniform(-0.3, 0.3, (4, 3)) * (1, 0, 1)
    tips = starts + random.uniform(-0.5, 0.5, (4, 3)) * (1, 0, 1)
    places = LabelPlaces(ASIDE)
    arrows = list(zip(starts, tips, strict=True))
    for start, tip in arrows:
        places.keep_clear(start, tip)
    drawn = np.concatenate([outline(start, tip) for start, tip in arrows])
    for _, tip in arrows:
        label = places.label("1.23 N s", 0, tip)
        centre, half = frame(label, tip)
        assert not (abs(drawn - centre) < half).all(axis=1).any()
        if label.row:
            edge = centre - (-half[0] if label.left else half[0], 0.0)
            begin = ASIDE.across(tip)
            line = begin + np.linspace(0.35, 1, 50)[:, None] * (edge - begin)
            apart = np.linalg.norm(drawn[:, None] - line, axis=2)
            assert apart.min() > 1e-3  # of 0.8, the height of the picture


def test_an_arrow_is_as_wide_as_it_is_drawn():
    """A line that only its centre keeps clear would have its head under the label."""
    places = LabelPlaces(ASIDE)
    start, tip = np.array([0.08, 0.0, 0.9]), np.array([-0.03, 0.0, 0.0])
    places.keep_clear(start, tip)
    places.keep_clear(tip - (1.0, 0.0, 0.0), tip)  # so that it stands at the right
    label = places.label("1.23 N s", 0, tip)
    assert not label.left
    assert label.row < 0.0
