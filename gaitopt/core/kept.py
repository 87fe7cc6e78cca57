"""Values that take long to make, kept for all threads of a process."""

from __future__ import annotations

import threading
from collections.abc import Callable, Hashable
from dataclasses import dataclass, field
from typing import Generic, TypeVar

Key = TypeVar("Key", bound=Hashable)
Value = TypeVar("Value")


@dataclass
class _Slot(Generic[Value]):
    """A place for a value, and the lock that the thread that makes it holds."""

    lock: threading.Lock = field(default_factory=threading.Lock)
    made: list[Value] = field(default_factory=list)


class Kept(Generic[Key, Value]):
    """The values used last, by their keys. Whoever gets one shares it, and changes nothing in it."""

    def __init__(self, most: int):
        """Keep at most so many values."""
        self._most = most
        self._slots: dict[Key, _Slot[Value]] = {}
        self._lock = threading.Lock()

    def get(self, key: Key, make: Callable[[], Value]) -> Value:
        """Return the value of a key, made on first use; what `make` raises is raised, and nothing is kept.

        Threads that need the same value wait for one of them to make it; others continue.
        """
        with self._lock:
            slot = self._slots.pop(key, None) or _Slot()
            self._slots[key] = slot  # the last one is used last
            while len(self._slots) > self._most:
                del self._slots[next(iter(self._slots))]
        with slot.lock:
            if not slot.made:
                slot.made.append(make())
            return slot.made[0]
