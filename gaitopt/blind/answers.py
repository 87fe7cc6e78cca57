"""A sealed case and its diagnosis: which parts of the answer are right."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from pydantic import BaseModel, ConfigDict, Field

from gaitopt.blind.sealed import SEALED_FOLDER, Truth, read_truth
from gaitopt.core.errors import GaitoptError
from gaitopt.core.files import read_json
from gaitopt.core.validation import PLAIN_NUMBER, PlainNumber, validated

TIED = 0.995
"""If the whitened signatures of two effects have this cosine, no likelihood separates the two."""

_Probability = Annotated[float, Field(ge=-1e-9, le=1.0 + 1e-9), PLAIN_NUMBER]
"""A probability, to within the rounding of a sum."""


class _Estimated(BaseModel):
    """A figure with its 90 % interval; a number that is not finite is null in ``diagnosis.json``."""

    model_config = ConfigDict(frozen=True)

    ci90: tuple[PlainNumber | None, PlainNumber | None]

    def covers(self, value: float) -> bool:
        """Whether a value lies in the 90 % interval."""
        low, high = self.ci90
        return low is not None and high is not None and low <= value <= high


class FittedParameter(_Estimated):
    """A parameter as ``diagnosis.json`` has it."""

    value: PlainNumber | None


class ExpectedSpeed(_Estimated):
    """A speed as ``diagnosis.json`` predicts it, m/s."""

    mean: PlainNumber | None


class AnsweredEffect(BaseModel):
    """One row of ``effects`` in ``diagnosis.json``, as far as it is scored."""

    model_config = ConfigDict(frozen=True)

    name: str
    target: str
    probability: _Probability
    parameters: dict[str, FittedParameter]
    heldout_shrinkage: PlainNumber | None
    alike: PlainNumber


class AnsweredGap(BaseModel):
    """``gap`` in ``diagnosis.json``, as far as it is scored."""

    model_config = ConfigDict(frozen=True)

    shrinkage: PlainNumber | None


class PredictedSpeed(BaseModel):
    """A row of ``predictions`` in ``diagnosis.json``, as far as it is scored: logs have no speed."""

    model_config = ConfigDict(frozen=True)

    gait: str
    speed_m_s: ExpectedSpeed | None = None


class Answer(BaseModel):
    """A ``diagnosis.json``, as far as it is scored."""

    model_config = ConfigDict(frozen=True)

    verdict: str
    causes: tuple[str, ...]
    ambiguous_with: tuple[str, ...]
    effects: tuple[AnsweredEffect, ...]
    other_probability: _Probability | None
    gap: AnsweredGap
    misfit_trials: dict[str, PlainNumber] = {}
    predictions: tuple[PredictedSpeed, ...] = ()


class KnownParameter(BaseModel):
    """The true value of a planted parameter, and the fitted one."""

    model_config = ConfigDict(frozen=True)

    true: float
    fitted: FittedParameter


class Case(BaseModel):
    """One sealed case and its diagnosis.

    Attributes:
        name: the case's name.
        truth: what was planted.
        diagnosis: what the diagnosis says.
    """

    model_config = ConfigDict(frozen=True)

    name: str
    truth: Truth
    diagnosis: Answer

    @property
    def kind(self) -> str:
        """One of `kinds.KINDS`."""
        return self.truth.kind

    @property
    def planted(self) -> list[str]:
        """The effects planted."""
        return [effect.name for effect in self.truth.effects]

    def visible(self, least: float) -> list[str]:
        """Return the planted effects that move the robot by so many floors beside the others."""
        gap = self.truth.gap_over_floor
        return [name for name in self.planted if self.truth.seen.get(name, gap) >= least]

    def visible_beside_errors(self, least: float) -> list[str]:
        """Return the planted effects that move the robot so many times as far as small errors do."""
        return [name for name, moved in self.truth.seen_beside_errors.items() if moved >= least]

    @property
    def false_causes(self) -> list[str]:
        """The causes that were not planted."""
        return [name for name in self.diagnosis.causes if name not in self.planted]

    @property
    def absent_causes(self) -> list[str]:
        """Those of them that are no small error of the robot either: their interval does not hold it."""
        return [name for name in self.false_causes if not self._is_small_error(name)]

    def _is_small_error(self, name: str) -> bool:
        row = self.row(name)
        if row is None:
            return False
        own = [error for error in self.truth.errors if (error.name, error.target) == (name, row.target)]
        return any(
            row.parameters[parameter].covers(true)
            for error in own
            for parameter, true in error.parameters.items()
            if parameter in row.parameters
        )

    def misfits(self, least: float) -> list[str]:
        """Return the misfit trials that were moved so many times as far as small errors move them."""
        return [name for name, moved in self.truth.misfits_beside_errors.items() if moved >= least]

    @property
    def speeds(self) -> dict[str, tuple[float, ExpectedSpeed]]:
        """The true speed of each baseline that was not recorded, m/s, and what the diagnosis expects."""
        true = self.truth.speeds_m_s
        rows = [row for row in self.diagnosis.predictions if row.gait in true]
        return {row.gait: (true[row.gait], row.speed_m_s) for row in rows if row.speed_m_s is not None}

    @property
    def answer(self) -> list[str]:
        """Everything that the answer names."""
        return [*self.diagnosis.causes, *self.diagnosis.ambiguous_with]

    @property
    def top(self) -> str | None:
        """The first cause named."""
        return next(iter(self.diagnosis.causes), None)

    @property
    def top_right(self) -> bool:
        """Whether the top cause is right; a tie that no data can split counts as right."""
        return self.top in self.planted or (self.in_set and self._tied())

    @property
    def in_set(self) -> bool:
        """Whether the truth is among the effects named."""
        return all(name in self.answer for name in self.planted)

    def _tied(self) -> bool:
        """Whether the planted effect has the signature of the one cause named; with two there is no tie."""
        row = self.row(self.planted[0])
        return len(self.diagnosis.causes) == 1 and row is not None and row.alike >= TIED

    def row(self, effect: str | None) -> AnsweredEffect | None:
        """Return the diagnosis' row of an effect."""
        return next((row for row in self.diagnosis.effects if row.name == effect), None)

    @property
    def parameter(self) -> KnownParameter | None:
        """The parameter of a single case whose effect and target were found."""
        planted = self.truth.effects[0]
        row = self.row(planted.name)
        if row is None or row.target != planted.target:
            return None
        name, true = next(iter(planted.parameters.items()))
        return KnownParameter(true=true, fitted=row.parameters[name])

    def check(self, source: Path) -> None:
        """Check that the rows of effects that were planted have their parameters.

        Args:
            source: the diagnosis' file, for messages.

        Raises:
            GaitoptError: one is missing.
        """
        for planted in self.truth.effects:
            row = self.row(planted.name)
            missing = [name for name in planted.parameters if row and name not in row.parameters]
            if missing:
                key = f"effects.{planted.name}.parameters.{missing[0]}"
                raise GaitoptError(f"{source}: {key}: missing; it is required")


def read_cases(folder: Path, diagnoses: Path) -> list[Case]:
    """Return every sealed case that has been diagnosed.

    Args:
        folder: the folder of the cases, with its ``sealed`` truth.
        diagnoses: the folder with a run folder for each case.

    Raises:
        GaitoptError: there is no sealed truth, or a file does not hold what it should.
    """
    sealed = sorted((folder / SEALED_FOLDER).glob("case-*.json"))
    if not sealed:
        raise GaitoptError(f"{folder}: no {SEALED_FOLDER}/case-*.json there")
    cases = []
    for path in sealed:
        found = diagnoses / path.stem / "diagnosis.json"
        if found.is_file():
            answer = validated(Answer, read_json(found), found)
            cases.append(Case(name=path.stem, truth=read_truth(path), diagnosis=answer))
            cases[-1].check(found)
    return cases
