"""Checked records from the values of a file. An error names the first mistake and counts the others."""

from __future__ import annotations

import math
from types import UnionType
from typing import Annotated, Any, TypeVar, Union, get_origin

from pydantic import AfterValidator, BaseModel, BeforeValidator, Field, ValidationError

from gaitopt.core.errors import GaitoptError, found, nearest

Record = TypeVar("Record", bound=BaseModel)


def _shown(name: str) -> str:
    if not name.isprintable():
        raise ValueError(f"found {found(name)}; allowed: a name without control characters")
    return name


Name = Annotated[str, AfterValidator(_shown)]
"""A name from a file. It is printed on terminals and drawn in figures, so it has no control characters."""


def _no_text(value: object) -> object:
    if isinstance(value, (str, bool)):
        raise ValueError(f"found {found(value)}; allowed: a number")
    return value


PLAIN_NUMBER = BeforeValidator(_no_text)
"""A number that is written as one: pydantic alone takes the text ``"1_000"`` and ``true`` for numbers too."""


PlainNumber = Annotated[float, Field(ge=-1e100, le=1e100, allow_inf_nan=False), PLAIN_NUMBER]
"""A number that can be squared, added and printed."""


Figure = Annotated[float, BeforeValidator(lambda value: math.nan if value is None else value)]
"""A number that is null in the file if it is not finite; read back, it is NaN."""


def validated(record: type[Record], values: object, source: object) -> Record:
    """Return the values of a file as a checked record.

    Args:
        record: the record's type.
        values: the content of the file.
        source: the file, for messages.

    Raises:
        GaitoptError: one line that names the file, the first wrong key, what was found and what is
            allowed, and how many more are wrong.
    """
    try:
        return record.model_validate(values)
    except ValidationError as error:
        raise GaitoptError(_first_problem(error, record, source)) from None


def _first_problem(error: ValidationError, record: type[BaseModel], source: object) -> str:
    problems = error.errors(include_url=False)
    first = problems[0]
    key = ".".join(filter(str.strip, map(str, first["loc"]))) or "file"
    if first["type"] == "missing":
        text = f"{key}: missing; it is required"
    elif first["type"] == "extra_forbidden":
        siblings = _fields_at(record, first["loc"][:-1])
        known = f"; allowed: {', '.join(siblings)}" if siblings else ""
        text = f"{key}: unknown key{known}{nearest(first['loc'][-1], siblings)}"
    elif first["type"] == "value_error":
        text = f"{key}: {first['ctx']['error']}"
    else:
        allowed = first["msg"].replace("Input should be ", "")
        text = f"{key}: found {found(first['input'])}; allowed: {allowed}"
    more = f" (and {len(problems) - 1} more)" if len(problems) > 1 else ""
    return f"{source}: {text}{more}"


def _fields_at(record: type[BaseModel], location: tuple[int | str, ...]) -> list[str]:
    """Return the keys that the nested record at `location` accepts; none where the types do not say."""
    current: Any = record
    for part in location:
        if _is_record(current):
            fields = current.model_fields.items()
            current = next((f.annotation for n, f in fields if part in (n, f.alias)), None)
        else:  # a key of a dictionary of records
            current = next(iter(getattr(current, "__args__", ())[1:]), None)
        current = _without_none(current)
    if not _is_record(current):
        return []
    return [field.alias or name for name, field in current.model_fields.items()]


def _is_record(annotation: Any) -> bool:
    return isinstance(annotation, type) and issubclass(annotation, BaseModel)


def _without_none(annotation: Any) -> Any:
    """Return the type in `type | None`."""
    if get_origin(annotation) in (Union, UnionType):
        return next((part for part in annotation.__args__ if part is not type(None)), None)
    return annotation
