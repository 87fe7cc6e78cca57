"""What a judgement works with: who simulates robots, the seed, and the settings."""

from __future__ import annotations

from concurrent.futures import Executor
from dataclasses import dataclass

from gaitopt.diagnose.fit.runner import Runner
from gaitopt.diagnose.judge.settings import DEFAULT, DiagnosisSettings


@dataclass(frozen=True)
class Context:
    """What a judgement works with.

    Attributes:
        runner: compares trials with robots.
        seed: seed of all randomness.
        settings: tuning constants.
    """

    runner: Runner
    seed: int
    settings: DiagnosisSettings = DEFAULT

    @property
    def executor(self) -> Executor:
        """Where robots are simulated."""
        return self.runner.executor
