"""Values that take long to make: made once, shared by threads, the last ones kept."""

import threading
from concurrent.futures import ThreadPoolExecutor

import pytest

from gaitopt.core.kept import Kept


def test_a_value_is_made_once_for_all_threads() -> None:
    kept: Kept[str, object] = Kept(2)
    with ThreadPoolExecutor(4) as executor:
        assert len({id(one) for one in executor.map(lambda _: kept.get("key", object), range(20))}) == 1


def test_a_value_that_is_being_made_does_not_hold_up_others() -> None:
    kept: Kept[str, int] = Kept(2)
    making, go_on = threading.Event(), threading.Event()

    def patiently() -> int:
        making.set()
        assert go_on.wait(60.0)
        return 1

    with ThreadPoolExecutor(1) as executor:
        waiting = executor.submit(kept.get, "slow", patiently)
        assert making.wait(60.0)
        assert kept.get("quick", lambda: 2) == 2
        assert not waiting.done()
        go_on.set()
        assert waiting.result() == 1


def test_the_values_used_last_are_kept() -> None:
    kept: Kept[int, object] = Kept(2)
    first, second = kept.get(1, object), kept.get(2, object)
    assert kept.get(1, object) is first
    kept.get(3, object)
    assert kept.get(1, object) is first
    assert kept.get(2, object) is not second


def test_a_value_that_could_not_be_made_is_tried_again() -> None:
    kept: Kept[str, int] = Kept(2)
    with pytest.raises(ZeroDivisionError):
        kept.get("key", lambda: 1 // 0)
    assert kept.get("key", lambda: 1) == 1
