"""The truth of a case, and the folder in which it is sealed."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Annotated

from pydantic import AfterValidator, BaseModel, ConfigDict, Field, model_validator

from gaitopt.blind.kinds import KINDS
from gaitopt.core.errors import found
from gaitopt.core.files import read_json, write_text
from gaitopt.core.validation import PlainNumber, validated

SEALED_FOLDER = "sealed"
"""Where a folder of cases keeps their truth; nothing but `gaitopt blind score` reads it."""


def _known_kind(kind: str) -> str:
    if kind not in KINDS:
        raise ValueError(f"found {found(kind)}; allowed: {', '.join(KINDS)}")
    return kind


class PlantedEffect(BaseModel):
    """One effect or disturbance that was planted.

    Attributes:
        name: its name.
        target: ``all`` or one actuator.
        parameters: its figures by name.
    """

    model_config = ConfigDict(frozen=True)

    name: str
    target: str
    parameters: Annotated[dict[str, PlainNumber], Field(min_length=1)]


class Truth(BaseModel):
    """What was done to the robot of a case.

    Attributes:
        kind: one of `kinds.KINDS`.
        effects: what was planted.
        gap_over_floor: the change by these effects alone, the largest of all trials, in floors.
        figures: what else was drawn.
        seen: of several effects, how far each moves the robot beside the others, in floors; by effect.
        seen_beside_errors: the same, over how far other small errors move the robot.
        trials: names of the trials.
        misfits: those that do not fit the others, and what is wrong with each.
        misfits_beside_errors: how far each of these moved its trial, over how far small errors move it.
        errors: the robot's small errors, as effects, where it is a little wrong in everything.
        speeds_m_s: how fast the robot goes in the baselines that were not recorded, m/s, by their names.
    """

    model_config = ConfigDict(frozen=True)

    kind: Annotated[str, AfterValidator(_known_kind)]
    effects: tuple[PlantedEffect, ...]
    gap_over_floor: PlainNumber
    figures: dict[str, PlainNumber] = {}
    seen: dict[str, PlainNumber] = {}
    seen_beside_errors: dict[str, PlainNumber] = {}
    trials: tuple[str, ...] = ()
    misfits: dict[str, str] = {}
    misfits_beside_errors: dict[str, PlainNumber] = {}
    errors: tuple[PlantedEffect, ...] = ()
    speeds_m_s: dict[str, PlainNumber] = {}

    @model_validator(mode="after")
    def _planted(self) -> Truth:
        if bool(self.effects) == (self.kind == "none"):
            what = "an effect" if self.effects else "no effect"
            raise ValueError(f"found {what} in a case of the kind {self.kind}")
        return self


def truth_path(cases: Path, name: str) -> Path:
    """Return where the truth of a case is sealed."""
    return cases / SEALED_FOLDER / f"{name}.json"


def seal(cases: Path, name: str, truth: Truth) -> None:
    """Write the truth of a case."""
    path = truth_path(cases, name)
    path.parent.mkdir(parents=True, exist_ok=True)
    write_text(path, json.dumps(truth.model_dump(), indent=1) + "\n")


def read_truth(path: Path) -> Truth:
    """Return the truth in a sealed file.

    Raises:
        GaitoptError: it cannot be read, or does not hold a truth.
    """
    return validated(Truth, read_json(path), path)
