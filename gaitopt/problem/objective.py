"""The objective of a problem file: what a search minimises, and the limits that must hold."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, Any, Literal

from pydantic import Field, field_validator, model_validator

from gaitopt.problem.fields import FileRecord, Finite, Positive


class Quantile(FileRecord):
    """A quantile over the scenarios.

    Attributes:
        quantile: share of the scenarios that are worse, 0 to 0.5.
    """

    quantile: Annotated[float, Field(strict=True, ge=0.0, le=0.5)]


class Constraint(FileRecord):
    """A limit on a metric.

    Attributes:
        max, min: the metric is at most `max` and at least `min`; one of them may be missing.
        scale: size of a serious violation, in the metric's unit.
        over_scenarios: how it is judged over the scenarios, where it is not as the other limits are; see
            `Objective`.
    """

    max: float | None = None
    min: float | None = None
    scale: Positive = 1.0
    over_scenarios: Literal["mean", "worst"] | Quantile | None = None

    @field_validator("over_scenarios", mode="before")
    @classmethod
    def _is_a_rule(cls, value: Any) -> Any:
        return _checked_rule(value)

    @model_validator(mode="after")
    def _has_a_limit(self) -> Constraint:
        if self.max is None and self.min is None:
            raise ValueError("allowed: `max`, `min` or both")
        return self


class Battery(FileRecord):
    """The battery, for the distance per charge.

    Attributes:
        energy_wh: energy of a charge, W h.
        efficiency: mechanical over electrical power of the servos. Assumed: small brushed motors with gears
            have 0.2 to 0.5.
        idle_w: power that is drawn at rest, W. Assumed: a board with radio and a few servos.
    """

    energy_wh: Positive
    efficiency: Annotated[float, Field(strict=True, gt=0.0, le=1.0)] = 0.3
    idle_w: Positive = 0.5


class Objective(FileRecord):
    """What to look for: weighted metrics to minimise, and limits that must hold.

    Attributes:
        terms: weight of each metric in the cost; negative where more of it is better.
        constraints: limits by metric name.
        penalty: cost of violating a constraint by its scale.
        search_margin: share by which the search tightens every limit. A search often ends on a limit, and
            its few scenarios cannot tell on which side.
        over_scenarios: how a gait is judged over its scenarios. By the ``mean``, limits hold for mean
            metrics. By the ``worst``, they hold in every scenario. By a quantile, at most this share of
            the scenarios may be worse, and may violate a limit.
        limits_over_scenarios: the same for the limits alone, where they are to be judged in another way.
        wanted_speed_m_s: forward speed that is wanted, for the metrics of it, m/s.
        battery: the battery, for the distance per charge.
    """

    terms: dict[str, Finite]
    constraints: dict[str, Constraint] = Field(default_factory=dict)
    penalty: Positive = 1.0
    search_margin: Annotated[float, Field(strict=True, ge=0.0, lt=1.0)] = 0.0
    over_scenarios: Literal["mean", "worst"] | Quantile = "mean"
    limits_over_scenarios: Literal["mean", "worst"] | Quantile | None = None
    wanted_speed_m_s: Positive | None = None
    battery: Battery | None = None

    @field_validator("over_scenarios", "limits_over_scenarios", mode="before")
    @classmethod
    def _is_a_rule(cls, value: Any) -> Any:
        return _checked_rule(value)

    @property
    def named(self) -> set[str]:
        """The metrics that it names."""
        return {*self.terms, *self.constraints}

    def weighted(self, metrics: Mapping[str, float]) -> float:
        """Return the weighted sum of the metrics: the cost without any penalty."""
        cost: float = sum(weight * metrics[name] for name, weight in self.terms.items())
        return cost

    @property
    def worse_share(self) -> float | None:
        """Share of the scenarios that may be worse than a gait's cost says; None for the mean."""
        return _worse_share(self.over_scenarios)

    def breaking_share(self, limit: Constraint) -> float | None:
        """Return the share of the scenarios that may break a limit; None for a limit on the mean."""
        rule = limit.over_scenarios or self.limits_over_scenarios
        return self.worse_share if rule is None else _worse_share(rule)


def _worse_share(rule: str | Quantile) -> float | None:
    if isinstance(rule, Quantile):
        return rule.quantile
    return 0.0 if rule == "worst" else None


def _checked_rule(value: Any) -> Any:
    """Return a rule over scenarios as its field takes it.

    Raises:
        ValueError: it is none.
    """
    if value is None:
        return None
    share = value.get("quantile") if isinstance(value, dict) and len(value) == 1 else None
    number = isinstance(share, (int, float)) and not isinstance(share, bool) and 0.0 <= share <= 0.5
    if not (number or value in ("mean", "worst") or isinstance(value, Quantile)):
        raise ValueError(f'found {value!r}; allowed: "mean", "worst" or {{ quantile = 0 to 0.5 }}')
    return {"quantile": float(share)} if share is not None else value
