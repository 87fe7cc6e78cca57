"""``summary.json``: what a run of `optimise` found, as one record that reads, checks and writes the file."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from pydantic import BaseModel, ConfigDict

from gaitopt.core.files import read_json
from gaitopt.core.validation import Figure, validated
from gaitopt.optimise.ladder import Rung
from gaitopt.optimise.pareto import FrontGait, speed, transport
from gaitopt.optimise.run import Optimised
from gaitopt.optimise.verification import Verified
from gaitopt.problem.problem import Problem


class _Row(BaseModel):
    """Part of a summary.

    What the command prints of a finished run is required. The rest has defaults, because earlier versions
    did not write all of it.
    """

    model_config = ConfigDict(frozen=True)


class GaitRow(_Row):
    """One gait over the verification scenarios, at the reference fidelity.

    Attributes:
        name: name of the gait.
        period_s: its period, s.
        speed_m_s: mean forward speed, m/s.
        speed_ci90_m_s: 90 % interval of the mean, m/s.
        speed_worst_m_s: forward speed in the worst scenario, m/s.
        stride_m: forward travel per period, m.
        constraints_met: whether every simulation went well and every constraint holds.
        violations: constraints that do not hold, each with its excess in units of its scale.
        status: ``ok``, or why a scenario failed.
        metrics: mean of each metric over the scenarios.
    """

    name: str
    period_s: float
    speed_m_s: Figure
    speed_ci90_m_s: tuple[Figure, Figure]
    speed_worst_m_s: Figure = math.nan
    stride_m: Figure = math.nan
    constraints_met: bool
    violations: dict[str, Figure]
    status: str
    metrics: dict[str, Figure] = {}

    @staticmethod
    def of(verified: Verified) -> GaitRow:
        """Return the row of a verified gait."""
        return GaitRow(**_gait_figures(verified))


class MarginRow(_Row):
    """One limit of the objective and what the winner leaves of it; its fields are those of `Margin`."""

    constraint: str
    side: str
    limit: float
    value: Figure
    worst: Figure
    margin: Figure
    broken_in: tuple[int, ...]
    scenarios: int
    allowed: str


class FindingRow(_Row):
    """What the audit finds of the winner.

    Attributes:
        name: kind of the finding.
        servo: the servo that shows it; empty where it is the whole robot.
        value: the figure found.
        limit: the figure allowed.
        message: what was found, in words.
    """

    name: str
    servo: str
    value: Figure
    limit: Figure
    message: str


class BestRow(GaitRow):
    """The winner.

    Attributes:
        found_by: the method, or the baseline, that the winner comes from.
        margins: every limit of the objective and what the winner leaves of it.
        findings: what the audit finds of the winner on the nominal robot.
        warnings: what the owner of a robot must know before it is played.
    """

    found_by: str = ""
    margins: tuple[MarginRow, ...] = ()
    findings: tuple[FindingRow, ...] = ()
    warnings: tuple[str, ...] = ()


class WarmStartRow(_Row):
    """The start from planned gaits.

    Attributes:
        predicted_speed_m_s: speed that the plan predicts for its best gait in MuJoCo, m/s.
        speed_m_s: verified mean speed of that gait, m/s.
        speed_ci90_m_s: 90 % interval of the mean, m/s.
        elites: planned gaits that were simulated.
        dropped: starts of the plan that were not used, and why.
        rank_correlation: Spearman's, of planar and MuJoCo speeds over random gaits.
    """

    predicted_speed_m_s: Figure
    speed_m_s: Figure
    speed_ci90_m_s: tuple[Figure, Figure] = (math.nan, math.nan)
    elites: int = 0
    dropped: tuple[str, ...] = ()
    rank_correlation: float | None = None


class FrontRow(_Row):
    """One gait of speed against cost of transport; its fields are columns of ``pareto.csv``.

    Attributes:
        name: name of the gait.
        evaluation: number of its evaluation.
        speed_m_s: verified mean speed, m/s.
        speed_ci90_low_m_s: lower end of its 90 % interval, m/s.
        speed_ci90_high_m_s: upper end of its 90 % interval, m/s.
        speed_worst_m_s: speed in the worst scenario, m/s.
        cost_of_transport: verified mean cost of transport.
        constraints_met: whether every constraint holds where it was verified.
        on_front: whether no other verified gait beats it in both.
        searched_speed_m_s: mean speed in the search, m/s.
        searched_cost_of_transport: mean cost of transport in the search.
    """

    name: str
    evaluation: int
    speed_m_s: Figure
    speed_ci90_low_m_s: Figure
    speed_ci90_high_m_s: Figure
    speed_worst_m_s: Figure
    cost_of_transport: Figure
    constraints_met: bool
    on_front: bool
    searched_speed_m_s: Figure
    searched_cost_of_transport: Figure

    @staticmethod
    def of(found: FrontGait) -> FrontRow:
        """Return the row of a gait of the front."""
        verified = found.verified
        low, high = verified.speed_ci90
        return FrontRow(
            name=verified.gait.name,
            evaluation=found.entry.index,
            speed_m_s=verified.speed,
            speed_ci90_low_m_s=low,
            speed_ci90_high_m_s=high,
            speed_worst_m_s=verified.worst,
            cost_of_transport=verified.evaluation.metrics["cost_of_transport"],
            constraints_met=verified.evaluation.constraints_met,
            on_front=found.efficient,
            searched_speed_m_s=speed(found.entry),
            searched_cost_of_transport=transport(found.entry),
        )


class VerifiedRow(_Row):
    """How the gaits were verified.

    Attributes:
        timestep_s: timestep, s.
        integrator: MuJoCo's integrator.
        scenarios: number of scenarios, none of which the search has seen.
        speed_m_s: mean forward speed of the winner, m/s.
        working_timestep_s: timestep of the search, s.
        working_speed_m_s: mean forward speed of the winner in the same scenarios with that, m/s.
        change_ci90_m_s: 90 % interval of what the reference fidelity changes, m/s.
        converged: whether that is as little as `gaitopt check` asks of a baseline.
    """

    timestep_s: float = math.nan
    integrator: str = ""
    scenarios: int = 0
    speed_m_s: Figure = math.nan
    working_timestep_s: float = math.nan
    working_speed_m_s: Figure = math.nan
    change_ci90_m_s: tuple[Figure, Figure] = (math.nan, math.nan)
    converged: bool | None = None


class MeasuredRow(_Row):
    """What was measured on the real robot, which the winner may lie beyond.

    Attributes:
        gaits: the baselines that were measured.
        period_s: the shortest and the longest of their periods, s.
        speed_m_s: the smallest and the largest of their measured speeds, m/s.
        rms_torque_n_m: the largest RMS torque of their servos, in simulation, N m.
    """

    gaits: tuple[str, ...]
    period_s: tuple[float, float]
    speed_m_s: tuple[float, float]
    rms_torque_n_m: Figure = math.nan

    @staticmethod
    def of(problem: Problem, baselines: Sequence[GaitRow]) -> MeasuredRow | None:
        """Return what a problem says was measured; None where it says nothing."""
        measured = problem.file.measured
        rows = [row for row in baselines if row.name in measured]
        if not rows:
            return None
        periods, speeds = [row.period_s for row in rows], [measured[row.name].speed_m_s for row in rows]
        torques = [row.metrics.get("rms_torque_n_m", math.nan) for row in rows]
        return MeasuredRow(
            gaits=tuple(row.name for row in rows),
            period_s=(min(periods), max(periods)),
            speed_m_s=(min(speeds), max(speeds)),
            rms_torque_n_m=max((torque for torque in torques if math.isfinite(torque)), default=math.nan),
        )


class Summary(_Row):
    """What a run found.

    Attributes:
        problem: name of the problem.
        seed, budget, method: the request.
        evaluations: gaits evaluated in the search.
        simulated_s: simulated seconds in all.
        wall_s: seconds it took.
        baselines: the hand-tuned gaits.
        warm_start: the start from planned gaits; None for a cold search.
        robots: robots of a posterior, of which each scenario has its own; 0 where all have the nominal one.
        over_scenarios: how costs of several scenarios become one.
        fidelity_ladder: cheaper rungs that were measured.
        pareto: gaits of speed against cost of transport; None if not requested.
        notes: what the user should know.
        best: the winner.
        measured: what was measured on the real robot; None where the problem does not say.
        verified: how the gaits were verified.
        ratio_to_best_baseline: speed of the winner over that of the fastest baseline; None where there is no
            baseline that goes forward.
        ratio_to_best_feasible_baseline: the same for baselines that meet the constraints.
    """

    problem: str = ""
    seed: int = 0
    budget: int = 0
    method: str = ""
    evaluations: int = 0
    simulated_s: Figure = math.nan
    wall_s: Figure = math.nan
    baselines: tuple[GaitRow, ...]
    warm_start: WarmStartRow | None = None
    robots: int = 0
    over_scenarios: str | dict[str, float] = ""
    fidelity_ladder: tuple[Rung, ...] = ()
    pareto: tuple[FrontRow, ...] | None = None
    notes: tuple[str, ...] = ()
    best: BestRow
    measured: MeasuredRow | None = None
    verified: VerifiedRow = VerifiedRow()
    ratio_to_best_baseline: float | None
    ratio_to_best_feasible_baseline: float | None = None

    @staticmethod
    def of(problem: Problem, optimised: Optimised) -> Summary:
        """Return the summary of a finished search."""
        best, request = optimised.best, optimised.request
        fastest = max((b.speed for b in optimised.baselines if math.isfinite(b.speed)), default=math.nan)
        feasible = [b.speed for b in optimised.baselines if b.evaluation.constraints_met]
        reference = problem.simulation.reference
        robots = {"robots": len(problem.robots)} if problem.robots else {}
        baselines = tuple(GaitRow.of(baseline) for baseline in optimised.baselines)
        measured = MeasuredRow.of(problem, baselines)
        return Summary(
            problem=problem.name,
            seed=request.seed,
            budget=request.budget,
            method=request.method,
            evaluations=len(optimised.entries),
            simulated_s=optimised.simulated_s,
            wall_s=optimised.wall_s,
            baselines=baselines,
            warm_start=_warm_start(optimised),
            **robots,
            over_scenarios=problem.to_dict()["objective"]["over_scenarios"],
            fidelity_ladder=tuple(optimised.rungs),
            pareto=tuple(FrontRow.of(found) for found in optimised.front) if request.pareto else None,
            notes=optimised.notes,
            best=BestRow(
                **_gait_figures(best),
                found_by=optimised.found_by,
                margins=tuple(MarginRow(**_fields(MarginRow, one)) for one in optimised.margins),
                findings=tuple(FindingRow(**_fields(FindingRow, one)) for one in optimised.findings),
                warnings=optimised.warnings,
            ),
            **({} if measured is None else {"measured": measured}),
            verified=VerifiedRow(
                timestep_s=reference.timestep_s,
                integrator=reference.integrator,
                scenarios=len(best.speeds),
                speed_m_s=best.speed,
                **_converged(problem, optimised),
            ),
            ratio_to_best_baseline=_ratio(best.speed, fastest),
            ratio_to_best_feasible_baseline=_ratio(best.speed, max(feasible, default=math.nan)),
        )

    @staticmethod
    def read(path: Path) -> Summary:
        """Return the summary that a file holds.

        Raises:
            GaitoptError: what the command prints of it is missing or wrong.
        """
        return validated(Summary, read_json(path), path)

    def to_dict(self) -> dict[str, Any]:
        """Return the content of the file; of a file that was read, the keys that it has."""
        return self.model_dump(mode="json", exclude_unset=True)

    @property
    def fastest_baseline(self) -> GaitRow | None:
        """The fastest baseline, or None without any; one whose simulation failed has no speed."""
        able = [row for row in self.baselines if math.isfinite(row.speed_m_s)]
        return max(able or self.baselines, key=lambda row: row.speed_m_s, default=None)


def _fields(kind: type[_Row], record: object) -> dict[str, Any]:
    """Return what a record holds of the fields of a row."""
    return {name: getattr(record, name) for name in kind.model_fields}


def _gait_figures(verified: Verified) -> dict[str, Any]:
    evaluation = verified.evaluation
    return {
        "name": verified.gait.name,
        "period_s": verified.gait.period_s,
        "speed_m_s": verified.speed,
        "speed_ci90_m_s": verified.speed_ci90,
        "speed_worst_m_s": verified.worst,
        "stride_m": verified.speed * verified.gait.period_s,
        "constraints_met": evaluation.constraints_met,
        "violations": {name: size for name, size in evaluation.violations.items() if size > 0.0},
        "status": evaluation.status,
        "metrics": evaluation.metrics,
    }


def _converged(problem: Problem, optimised: Optimised) -> dict[str, Any]:
    found = optimised.convergence
    if found is None:
        return {}
    return {
        "working_timestep_s": problem.simulation.working.timestep_s,
        "working_speed_m_s": found.working.speed,
        "change_ci90_m_s": found.change_ci90_m_s,
        "converged": found.converged,
    }


def _warm_start(optimised: Optimised) -> WarmStartRow | None:
    if optimised.warm_start is None or optimised.plan is None:
        return None
    verified = optimised.warm_start.verified
    return WarmStartRow(
        predicted_speed_m_s=optimised.warm_start.predicted_speed_m_s,
        speed_m_s=verified.speed,
        speed_ci90_m_s=verified.speed_ci90,
        elites=len(optimised.plan.elites),
        dropped=tuple(optimised.plan.dropped),
        rank_correlation=optimised.rank_correlation,
    )


def _ratio(speed: float, baseline: float) -> float | None:
    return speed / baseline if baseline > 0.0 else None
