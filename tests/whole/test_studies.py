"""Every study says what it asks, what it costs and how it is run; one command lists them all."""

from __future__ import annotations

import subprocess
import sys

import house


def test_one_command_lists_every_study_with_its_cost() -> None:
    folder = house.ROOT / "tests" / "studies"
    done = subprocess.run([sys.executable, folder], capture_output=True, text=True, check=True)
    runnable = {path.name for path in folder.glob("*.py") if "__main__" in path.read_text()} - {"__main__.py"}
    blocks = done.stdout.split("\n    cost: ")
    assert len(blocks) - 1 == len(runnable) > 15
    assert all(f"\n{name}: " in f"\n{done.stdout}" for name in runnable)
    assert all(block.partition("\n")[0] and "python tests/studies/" in block for block in blocks[1:])
