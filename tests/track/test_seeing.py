"""Tags are followed through pictures, also where a hand jerks, and nothing else is taken for one."""

import numpy as np
import pytest

from gaitopt.core.streams import seeded
from gaitopt.report.film.phone import tag_picture
from gaitopt.track.film import Picture
from gaitopt.track.opencv import opencv
from gaitopt.track.seeing import Eye, edge_of

EDGE = 64.0
"""Edge of the black squares, pixels."""


def picture(
    places: dict[int, tuple[float, float]], seed: int = 1, edge: float = EDGE, blur: float = 0.8
) -> Picture:
    """Tags with their upper left corners at some places, blurred, with noise."""
    cv2 = opencv()
    found = np.full((480, 640), 170.0, np.float32)
    for number, place in places.items():
        tag = tag_picture(number).astype(np.float32)
        scale = edge / (tag.shape[0] * 0.8)
        fit = np.array([[scale, 0.0, place[0] - edge / 8.0], [0.0, scale, place[1] - edge / 8.0]])
        smooth = cv2.GaussianBlur(tag, (0, 0), 0.5 / scale)
        cv2.warpAffine(smooth, fit, found.shape[::-1], dst=found, borderMode=cv2.BORDER_TRANSPARENT)
    noise = 2.0 * seeded(seed).standard_normal(found.shape)
    return np.clip(cv2.GaussianBlur(found, (0, 0), blur) + noise, 0.0, 255.0).astype(np.uint8)


def test_tags_are_followed_through_the_jerks_of_a_hand() -> None:
    eye = Eye([0, 1, 100], [100])
    for index, jerk in enumerate([(0, 0), (3, 1), (28, -9), (-14, 22), (-15, 23), (20, 6), (21, 6)]):
        places = {100: (60.0, 260.0), 0: (250.0 + 4.0 * index, 120.0), 1: (430.0, 130.0 - 3.0 * index)}
        places = {n: (x + jerk[0], y + jerk[1]) for n, (x, y) in places.items()}
        seen = eye.look(picture(places, index))
        assert sorted(seen) == [0, 1, 100]
        for number, place in places.items():
            assert seen[number][0] == pytest.approx(place, abs=0.3)


def test_a_tag_that_was_hidden_is_found_again() -> None:
    eye = Eye([0, 1, 100], [100])
    seen = []
    for index in range(16):
        places = {100: (60.0, 260.0), 0: (250.0, 120.0)}
        hidden = 4 <= index < 9
        seen.append(
            eye.look(picture(places if hidden else places | {1: (430.0 - 6.0 * index, 130.0)}, index))
        )
    assert [1 in found for found in seen[:9]] == [True] * 4 + [False] * 5
    assert 1 in seen[-1]
    assert all(0 in found and 100 in found for found in seen)


def test_what_is_no_tag_of_the_robot_is_not_taken_for_one() -> None:
    eye = Eye([0, 1, 100], [100])
    for index in range(8):
        seen = eye.look(
            picture({100: (60.0, 260.0), 7: (250.0 + 2 * index, 120.0), 8: (430.0, 130.0)}, index)
        )
        assert sorted(seen) == [100]
    assert eye.strangers == {7, 8}


@pytest.mark.parametrize("blur", [0.6, 1.0, 1.5])
def test_tags_look_as_large_as_they_are_however_blurred_a_film_is(blur: float) -> None:
    eye = Eye([0, 1, 100], [100])
    edges = []
    for index in range(6):
        places = {100: (60.3, 260.0), 0: (250.0 + 1.3 * index, 120.0), 1: (430.0, 130.0 - 1.7 * index)}
        seen = eye.look(picture(places, index, edge=40.0, blur=blur))
        edges += [edge_of(seen[n]) for n in (0, 1)]
    assert np.mean(edges) == pytest.approx(40.0, rel=1.5e-3)
