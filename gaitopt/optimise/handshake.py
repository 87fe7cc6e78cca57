"""The greeting of a dask scheduler, read before dask reads it.

Dask waits without limit for the greeting of any program that answers, and reads its first bytes as a length
of any size. So another program at the address would block it, or exhaust the memory.
"""

from __future__ import annotations

import socket
import struct
import time
from urllib.parse import urlsplit

from gaitopt.core.errors import GaitoptError

DASK = "dask://"
"""How the address of a scheduler begins."""

_LENGTH = struct.Struct("<Q")
"""A message begins with the number of its other bytes."""

_MOST_BYTES = 65_536
"""A greeting of dask 2026.8 has 66 bytes."""

_PART = b"pickle-protocol"
"""A key that every greeting has."""


def check_scheduler(address: str, answer_s: float) -> None:
    """Check that a dask scheduler greets at an address.

    Args:
        address: host and port.
        answer_s: seconds within which it must have done so.

    Raises:
        GaitoptError: none does.
    """
    until = time.monotonic() + answer_s
    try:
        parts = urlsplit(f"tcp://{address}")
        with socket.create_connection((parts.hostname or "", parts.port or 0), answer_s) as connection:
            (length,) = _LENGTH.unpack(_received(connection, _LENGTH.size, until))
            greeting = _received(connection, length, until) if length <= _MOST_BYTES else b""
    except (OSError, ValueError):  # a timeout is an OSError, a port that is no number a ValueError
        raise no_answer(address) from None
    if _PART not in greeting:
        raise GaitoptError(f"--executor: what answers at {DASK}{address} is no dask scheduler")


def no_answer(address: str) -> GaitoptError:
    """Return the error for an address where no scheduler answers."""
    return GaitoptError(f"--executor: no dask scheduler answers at {DASK}{address}")


def _received(connection: socket.socket, length: int, until: float) -> bytes:
    """Return the next bytes of a connection.

    Raises:
        OSError: they have not come in time, or the connection has ended.
    """
    data = b""
    while len(data) < length:
        connection.settimeout(max(1e-3, until - time.monotonic()))
        more = connection.recv(length - len(data))
        if not more:
            raise OSError("it ended the connection")
        data += more
    return data
