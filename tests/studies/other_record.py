"""The diagnosis' record on cases of a second make (`other_walk`): made, diagnosed and scored, resumable.

    python tests/studies/other_record.py --work /tmp/blind-other --out results/blind

OUT/other.jsonl has one line for each finished case; nothing else is needed to continue on another machine.

Cost: about 1 minute of two cores to make a case, and 3 to 6 to diagnose it: 4 h for 40 cases.
"""

from __future__ import annotations

import argparse
import multiprocessing
import sys
import time
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1]))

from blind_record import diagnosed, longest, write_record
from kept import read_kept, write_kept
from other_cases import UNSEEN, Maker, speed_of, write_case
from shared_rollouts import shared_rollouts

from gaitopt.blind.sealed import truth_path
from gaitopt.optimise.executors import open_executor
from gaitopt.problem.model import nominal_mjcf
from gaitopt.problem.problem import load_problem

SEED = 887
KINDS = ("several", "single", "several", "single", "none") * 8


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--work", type=Path, required=True)
    parser.add_argument("--out", type=Path, required=True)
    parser.add_argument("--until", type=float, default=1e9, help="begin no case after so many seconds")
    parser.add_argument("--seed", type=int, default=SEED, help="another seed: to develop with")
    options = parser.parse_args()
    kept, begun, problem = options.out / "other.jsonl", time.monotonic(), load_problem("arcfold")
    done = {row["case"]: row for row in read_kept(kept, options.seed)}
    maker: Maker | None = None
    spawn = multiprocessing.get_context("spawn")
    with (
        ProcessPoolExecutor(2, mp_context=spawn) as pool,
        open_executor("threads", None) as executor,
        shared_rollouts(longest(problem)),
    ):
        for index, kind in enumerate(KINDS):
            name = f"case-{index:03d}"
            if name in done:
                continue
            if time.monotonic() - begun > options.until:
                break
            if not truth_path(options.work, name).exists():
                maker = maker or Maker.of(nominal_mjcf(problem), pool)
                make(maker, options.work, name, kind, np.random.default_rng([options.seed, index]))
            done[name] = diagnosed(problem, options.work, name, options.seed, executor)
            write_kept(kept, [done[each] for each in sorted(done)])
    write_record(options.out, "other", [done[each] for each in sorted(done)])


def make(maker: Maker, work: Path, name: str, kind: str, rng: np.random.Generator) -> None:
    """Make one case and seal its truth."""
    case, walks, gaps = maker.make(kind, rng)
    (unseen,) = maker.walks([case], UNSEEN)
    speeds = {gait: speed_of(unseen[gait], period) for gait, period in UNSEEN.items()}
    write_case(work, name, case, walks, gaps, speeds, rng)


if __name__ == "__main__":
    main()
