"""A synthetic phone compresses its films as a phone does."""

from dataclasses import replace

import pytest
from phone import SMALL, Walk

from gaitopt.report.film.phone import Phone


@pytest.mark.parametrize(("fps", "mb_a_minute"), [(30.0, 130.0), (60.0, 175.0)])
def test_the_usual_bit_rate_is_what_a_phone_says_of_a_minute(fps: float, mb_a_minute: float) -> None:
    assert Phone(fps=fps).usual_bit_rate * 60.0 / 8e6 == pytest.approx(mb_a_minute)


def test_films_of_another_size_are_as_fine_by_pixel() -> None:
    small = replace(Phone(), size=(960, 540))
    assert small.usual_bit_rate == pytest.approx(0.25 * Phone().usual_bit_rate)


def test_a_film_has_the_bit_rate_of_its_phone(filmed: Walk) -> None:
    seconds = filmed.times[-1] + 1.0 / SMALL.fps
    assert 8.0 * filmed.path.stat().st_size / seconds == pytest.approx(SMALL.usual_bit_rate, rel=0.3)
