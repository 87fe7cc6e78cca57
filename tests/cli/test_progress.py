"""What a person sees on the terminal while a job runs."""

from gaitopt.cli.progress import _time_left
from gaitopt.optimise.recorder import SearchProgress


def test_time_left_is_at_the_pace_since_the_search_began_or_resumed() -> None:
    assert _time_left(SearchProgress("cma-es", 30, 90), 10, 5.0) == ", about 15 s left"
    assert _time_left(SearchProgress("cma-es", 10, 90), 10, 5.0) == ""
    assert _time_left(SearchProgress("cma-es", 90, 90), 10, 5.0) == ""
