"""What the next experiment is worth: the named set before and after it, compared with random gaits.

    python tests/studies/next_experiment.py --work /tmp/next --out results/blind

Blind cases of one effect are filmed in one gait, with the marker's x alone, until enough of them are
ambiguous. Each of these is then filmed in the gait that its diagnosis proposed, and in random ones. The robot
and the numerics stay the same, and the first recording stays the same to the last bit.
OUT/next-experiment.jsonl has one line for each finished case; nothing else is needed to continue on another
machine.

Cost: about 2 h of two cores.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable
from concurrent.futures import Executor
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import matplotlib.pyplot as plt
import numpy as np
from kept import read_kept, version, write_kept
from shared_rollouts import shared_rollouts

from gaitopt.blind.drawing import Draw, draw_case
from gaitopt.blind.factory import CaseFactory, RecordingPlan, walked_s
from gaitopt.blind.recording import record, write_recording
from gaitopt.blind.scoring import mean, rate
from gaitopt.core.errors import GaitoptError
from gaitopt.core.files import write_text
from gaitopt.core.json import to_json
from gaitopt.diagnose.diagnosis import Diagnosis, DiagnosisRequest, diagnose
from gaitopt.diagnose.judge.experiment import Experiment
from gaitopt.diagnose.record.dataset import load_dataset
from gaitopt.gait.gait import Gait, write_gait
from gaitopt.optimise.executors import open_executor
from gaitopt.problem.problem import load_problem

FIRST = "square-2s"
SECONDS = 8.0
SIGNALS = ("marker.x",)
RANDOM = 2
"""Random gaits per case."""


@dataclass(frozen=True)
class Study:
    """What all cases share, and the executor."""

    factory: CaseFactory
    seed: int
    executor: Executor

    def film(self, draw: Draw, index: int, folder: Path, gait: Gait | None = None) -> Path:
        """Write the case's data set, with the recording of one more gait if there is one."""
        factory = self.factory
        folder.mkdir(parents=True, exist_ok=True)
        if gait is not None:
            path = replace(factory.nominal.run(gait, 0, factory.walked_s(gait)), status="ok")
            factory = replace(
                factory,
                gaits={**factory.gaits, gait.name: gait},
                paths={**factory.paths, gait.name: path},
                floors={**factory.floors, gait.name: np.inf},
            )
            write_gait(folder / gait.name, gait)
        recording = record(factory, draw, np.random.default_rng([self.seed, 41, index]), self.executor)
        failed = [name for name, path in recording.paths.items() if path.status != "ok"]
        if failed:
            raise GaitoptError(f"{failed[0]}: the robot of the case cannot walk it")
        write_recording(factory, recording, folder, np.random.default_rng([self.seed, 42, index]))
        return folder

    def diagnosed(self, folder: Path, next_gait: bool) -> Diagnosis:
        """Return the diagnosis of a data set."""
        simulator = self.factory.nominal
        dataset = load_dataset(folder, self.factory.problem, [s for s in simulator.signals if s])
        return diagnose(simulator, dataset, DiagnosisRequest(1, None, next_gait), self.executor)

    def case(self, index: int, work: Path) -> dict[str, Any]:
        """Return the result of one case: the set before, and after each of the gaits."""
        rng = np.random.default_rng([self.seed, 40, index])
        draw = draw_case(self.factory, "single", rng, self.executor).draw
        truth = draw.planted[0].hypothesis.effect.name
        before = self.diagnosed(self.film(draw, index, work / f"{index:03d}"), True)
        row: dict[str, Any] = {"case": index, "seed": self.seed, "version": version(), "planted": truth}
        row["before"] = _answer(before, truth)
        experiment = before.experiment
        if before.verdict != "ambiguous" or experiment is None:
            return row
        if not isinstance(experiment, Experiment):
            raise TypeError(f"case {index}: after films of gaits, commands are proposed, not a gait")
        space = self.factory.problem.space
        proposed = replace(experiment.gait, name="next")
        row["expected_separation"] = experiment.separation
        row["proposed"] = self._after(draw, index, work, proposed, truth)
        row["random"] = []
        while len(row["random"]) < RANDOM:
            gait = replace(space.decode(rng.random(len(space.variables))), name=f"random{len(row['random'])}")
            row["random"].append(self._after(draw, index, work, gait, truth))
        return row

    def _after(self, draw: Draw, index: int, work: Path, gait: Gait, truth: str) -> dict[str, Any]:
        try:
            folder = self.film(draw, index, work / f"{index:03d}-{gait.name}", gait)
            return _answer(self.diagnosed(folder, False), truth) | {"period_s": gait.period_s}
        except GaitoptError as error:  # such as a gait that the robot cannot walk: it gives no information
            return {"verdict": f"not filmed: {error}", "named": None, "truth_in": None}


def _answer(found: Diagnosis, truth: str) -> dict[str, Any]:
    named = [*found.causes, *(found.found.ambiguous_with if found.found else [])]
    return {"verdict": found.verdict, "named": named, "truth_in": truth in named}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--work", type=Path, required=True)
    parser.add_argument("--out", type=Path, required=True)
    parser.add_argument("--seed", type=int, default=806)
    parser.add_argument("--ambiguous", type=int, default=16, help="cases wanted")
    options = parser.parse_args()
    problem = load_problem("arcfold")
    kept = options.out / "next-experiment.jsonl"
    rows = read_kept(kept, options.seed)
    first = problem.baselines[FIRST]
    longest = {first.key: walked_s(first, SECONDS)}
    with open_executor("threads", None) as executor, shared_rollouts(longest):
        factory = CaseFactory.of(problem, RecordingPlan([FIRST], SECONDS, SIGNALS), executor)
        study = Study(factory, options.seed, executor)
        while sum("proposed" in row for row in rows) < options.ambiguous:
            rows.append(study.case(len(rows), options.work))
            print(_line(rows[-1]), flush=True)
            write_kept(kept, rows)
    found = summary(rows)
    print("\n".join(sentences(found)))
    write(options.out, found, [row for row in rows if "proposed" in row])


def _line(row: dict[str, Any]) -> str:
    before = f"{row['case']:03d}: {row['planted']}: {row['before']['verdict']} {len(row['before']['named'])}"
    if "proposed" not in row:
        return before
    after = [row["proposed"], *row["random"]]
    return f"{before} -> " + ", ".join("–" if a["named"] is None else str(len(a["named"])) for a in after)


def summary(rows: list[dict[str, Any]]) -> dict[str, Any]:
    """Return the record of the ambiguous cases."""
    used = [row for row in rows if "proposed" in row]
    return {
        "cases_tried": len(rows),
        "ambiguous": len(used),
        "size_before": _mean([float(len(row["before"]["named"])) for row in used]),
        "named": _compared(used, _size),
        "named_with_the_truth": _compared(used, _size_if_true),
        "truth_in_before": _rate([row["before"] for row in used]),
        "truth_in_proposed": _rate([row["proposed"] for row in used]),
        "truth_in_random": _rate([r for row in used for r in row["random"]]),
    }


def _compared(used: list[dict[str, Any]], size: Callable[..., float]) -> dict[str, Any]:
    """Return the sizes after the proposed gait and after random ones, case by case."""
    proposed = [size(row["proposed"], row["before"]) for row in used]
    random = [float(np.mean([size(r, row["before"]) for r in row["random"]])) for row in used]
    return {
        "after_proposed": _mean(proposed),
        "after_random": _mean(random),
        "difference": _mean([r - p for p, r in zip(proposed, random, strict=True)]),
        "smaller": sum(p < r for p, r in zip(proposed, random, strict=True)),
        "larger": sum(p > r for p, r in zip(proposed, random, strict=True)),
    }


def _size(after: dict[str, Any], before: dict[str, Any]) -> float:
    """Return how many effects are named; as many as before if there is no new information."""
    return float(len(after["named"] or before["named"]))


def _size_if_true(after: dict[str, Any], before: dict[str, Any]) -> float:
    """Return the same, but an answer without the truth counts as no answer."""
    return _size(after, before) if after["truth_in"] else float(len(before["named"]))


def _rate(answers: list[dict[str, Any]]) -> dict[str, Any]:
    filmed: list[Any] = [answer for answer in answers if answer["named"] is not None]
    return rate(filmed, lambda answer: bool(answer["truth_in"])).to_dict()


def _mean(values: list[float]) -> dict[str, Any]:
    return mean(values).to_dict()


def sentences(record: dict[str, Any]) -> list[str]:
    """Return the record in words."""

    def said(found: dict[str, Any], digits: int = 2) -> str:
        low, high = found["ci90"]
        return f"{found['value']:.{digits}f} ({low:.{digits}f} to {high:.{digits}f})"

    lines = [
        f"{record['ambiguous']} ambiguous cases of {record['cases_tried']}",
        f"effects named before: {said(record['size_before'])}",
    ]
    for key, what in (
        ("named", "effects named"),
        ("named_with_the_truth", "the same, as before without the truth"),
    ):
        found = record[key]
        lines.append(
            f"{what}: after the proposed gait {said(found['after_proposed'])}, after a random one "
            f"{said(found['after_random'])}; fewer by {said(found['difference'])}; smaller in "
            f"{found['smaller']}, larger in {found['larger']} cases"
        )
    truth = [said(record[f"truth_in_{when}"]) for when in ("before", "proposed", "random")]
    return [*lines, f"truth named before, after the proposed, after a random gait: {', '.join(truth)}"]


def write(out: Path, record: dict[str, Any], used: list[dict[str, Any]]) -> None:
    """Write the record, its table and its plot."""
    write_text(out / "next-experiment.json", to_json(record))
    lines = [
        "| case | planted | named before | after the proposed gait | after random gaits |",
        "|---|---|---|---|---|",
    ]
    for row in used:
        cells = [_cell(row["before"]), _cell(row["proposed"]), "; ".join(map(_cell, row["random"]))]
        lines.append(f"| {row['case']} | {row['planted']} | {' | '.join(cells)} |")
    head = [f"- {sentence}" for sentence in sentences(record)]
    write_text(out / "next-experiment.md", "\n".join([*head, "", *lines]) + "\n")
    _draw(out / "next-experiment.png", used)


def _draw(path: Path, used: list[dict[str, Any]]) -> None:
    """Draw each case's number of effects named after the proposed gait, before, and after random ones."""
    sizes = np.array(
        [
            (
                _size(row["proposed"], row["before"]),
                float(len(row["before"]["named"])),
                float(np.mean([_size(r, row["before"]) for r in row["random"]])),
            )
            for row in used
        ]
    )
    figure, axes = plt.subplots(figsize=(4.6, 3.6), layout="constrained")
    axes.plot(range(3), sizes.T, color="0.75", linewidth=0.8)
    axes.plot(range(3), sizes.T, "o", color="#0072B2", markersize=4)
    axes.plot(range(3), sizes.mean(axis=0), "_", color="#D55E00", markersize=28, markeredgewidth=2.5)
    axes.set_xticks(range(3), ["after the\nproposed gait", "before", "after a\nrandom gait"])
    axes.set_ylabel("effects named")
    axes.set_ylim(bottom=0.0)
    figure.savefig(path, dpi=150)
    plt.close(figure)


def _cell(answer: dict[str, Any]) -> str:
    if answer["named"] is None:
        return "not filmed"
    mark = "" if answer["truth_in"] else " (not the truth)"
    return f"{len(answer['named'])}{mark}" if answer["named"] else f"none{mark}"


if __name__ == "__main__":
    main()
