"""Parts of the records of a problem file: checked numbers and intervals, and their base class."""

from __future__ import annotations

from typing import Annotated

from pydantic import BaseModel, ConfigDict, Field

Positive = Annotated[float, Field(strict=True, gt=0.0, allow_inf_nan=False)]
Period = Annotated[float, Field(strict=True, ge=1e-3, le=1e6, allow_inf_nan=False)]
NonNegative = Annotated[float, Field(strict=True, ge=0.0, allow_inf_nan=False)]
Finite = Annotated[float, Field(strict=True, allow_inf_nan=False)]
Number = Annotated[float, Field(strict=True)]
Interval = tuple[Finite, Finite]


class FileRecord(BaseModel):
    """A frozen record that takes no unknown keys."""

    model_config = ConfigDict(frozen=True, extra="forbid", populate_by_name=True)


def check_ordered(key: str, interval: tuple[float, float]) -> None:
    """Check that an interval is not reversed.

    Raises:
        ValueError: it is; pydantic makes it an error of the file.
    """
    if interval[0] > interval[1]:
        raise ValueError(f"{key}: found {list(interval)}; allowed: [low, high] with low <= high")
