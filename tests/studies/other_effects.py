"""What each effect does to the walking ArcFold, by `gaitopt` and by code of another hand (`other_walk`).

    python tests/studies/other_effects.py --out results/effects

Cost: about 3 minutes of one core.
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[1]))

from other_walk import apart
from two_hands import SIZES, by_another_hand, by_simulator

from gaitopt.core.files import write_text
from gaitopt.effects import EFFECTS
from gaitopt.problem.problem import load_problem


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--out", type=Path, required=True)
    options = parser.parse_args()
    options.out.mkdir(parents=True, exist_ok=True)
    problem = load_problem("arcfold")
    nominal = by_simulator(problem)
    lines = [
        f"Nominal robots are {1e3 * apart(nominal, by_another_hand(problem)):.2f} mm apart.",
        "",
        "| effect | value | moves the marker by, mm | the two are apart by, mm |",
        "|---|---|---|---|",
    ]
    for name, (target, value) in SIZES.items():
        own, other = by_simulator(problem, name), by_another_hand(problem, name)
        of = "" if target == "all" else f" of {target}"
        figures = f"{1e3 * apart(own, nominal):.1f} | {1e3 * apart(own, other):.1f}"
        lines.append(f"| {name}{of} | {value:g} {EFFECTS[name].unit} | {figures} |")
        print(lines[-1], flush=True)
    write_text(options.out / "other-hand.md", "\n".join(lines) + "\n")


if __name__ == "__main__":
    main()
