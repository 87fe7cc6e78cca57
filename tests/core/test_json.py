"""Strict JSON."""

import json
import math

import pytest

from gaitopt.core.json import to_json


def test_json_is_strict() -> None:
    text = to_json({"a": [math.nan, math.inf, 1.0], 3: (True, None, "x")})
    assert json.loads(text, parse_constant=pytest.fail) == {"a": [None, None, 1.0], "3": [True, None, "x"]}
