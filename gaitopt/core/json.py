"""Strict JSON, for every file and every ``--json``."""

from __future__ import annotations

import json
import math


def to_json(value: object, indent: int | None = 1) -> str:
    """Return strict JSON with a line end; numbers that JSON does not have (inf, NaN) become null.

    Args:
        value: dictionaries, lists, tuples, texts, numbers, booleans and None.
        indent: spaces a level; None for one line.
    """
    return json.dumps(_finite(value), indent=indent, allow_nan=False) + "\n"


def _finite(value: object) -> object:
    if isinstance(value, dict):
        return {str(key): _finite(item) for key, item in value.items()}
    if isinstance(value, (list, tuple)):
        return [_finite(item) for item in value]
    if isinstance(value, float) and not math.isfinite(value):
        return None
    return value
