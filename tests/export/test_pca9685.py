"""A simulated PCA9685 gets what the player says.

Compilers that are not installed are skipped; .ci/run installs them.
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st
from players import mock_commands, sketch_prints
from servo_boards import exported, on_the_board, table_for

from gaitopt.export.gait_player import STAGGER_US, Player
from gaitopt.export.output import PCA9685
from gaitopt.export.pca9685 import divider, pulse, setup, ticks, width_us
from gaitopt.export.stages import player_of


def test_the_clock_of_a_pca9685_is_the_datasheets() -> None:
    """NXP, PCA9685 Rev. 4, section 7.3.5: 200 Hz is a prescale of 30 (1Eh); 50 Hz is 121."""
    assert divider(5_000) - 1 == 30
    assert divider(20_000) - 1 == 121
    assert width_us(ticks(1500, 122), 122) == pytest.approx(1498.16)
    with pytest.raises(ValueError, match="FRAME_US: found 43000; allowed: 656 to 41943"):
        setup(43_000)


@given(st.integers(1, 65535), st.integers(656, 41_943))
def test_a_pulse_is_off_by_half_a_step_at_most(pulse_us: int, frame_us: int) -> None:
    step_us = divider(frame_us) / 25
    sent = PCA9685.rounded(pulse_us, frame_us)
    assert abs(sent - pulse_us) <= 0.5 * step_us + 1e-9 or sent == pytest.approx(4095 * step_us)
    words = pulse(3, pulse_us, frame_us)
    assert words[:3] == bytes((6 + 12, 0, 0))
    assert width_us(words[3] + 256 * words[4], divider(frame_us)) == pytest.approx(sent)


def steps_of(player: Player) -> list[int]:
    """What each output of a PCA9685 gets now, steps."""
    return [ticks(pulse_us, divider(20_000)) if pulse_us else 0 for pulse_us in player.pulse_us]


def pca9685_changes() -> Iterator[str]:
    """What the Python player gives for the commands of the mock's main.cpp, a line for each change."""
    player, last = player_of(table_for("pca9685-arduino")), [0, 0, 0]
    for ms, _ in mock_commands(player):
        for output, (before, steps) in enumerate(zip(last, steps_of(player), strict=True)):
            if steps != before:
                yield f"{ms} ms: {output} {steps}"
        last = steps_of(player)


@pytest.mark.parametrize("core", [2, 3])
def test_the_arduino_sketch_plays_on_a_pca9685(tmp_path: Path, core: int) -> None:
    printed = sketch_prints(exported(tmp_path, "pca9685-arduino") / "gait", "pca9685", core)
    assert printed[0] == "122 clocks a step, 400000 Hz"
    assert printed[1:] == list(pca9685_changes())


def test_micropython_plays_on_a_pca9685(tmp_path: Path) -> None:
    folder = exported(tmp_path, "pca9685-micropython")
    printed = on_the_board(folder, "gait_servos.run(1.5)\n", ("pca9685",))
    assert printed[0] == "0 21 22 400000"
    assert printed[1:6] == ["64 253 16", "64 0 16", "64 254 121", "64 1 4", "64 0 32"]
    sent = [[int(word) for word in line.split()] for line in printed[6:]]
    assert {tuple(words[:2]) for words in sent} == {(64, 6), (64, 10), (64, 14)}
    first = [words[4] + 256 * words[5] for words in sent if words[1] == 6 and words[5] != 16]
    player = player_of(table_for("pca9685-micropython"))
    player.start(0)
    wanted = []
    for frame in range(len(first)):
        player.tick(20_000 * frame)
        if player.state and frame == 3 * STAGGER_US // 20_000 + 1 + 75:
            player.stop()
        wanted.append(steps_of(player)[0])
    assert first[:100] == wanted[:100]
    assert [words[2:] for words in sent[-3:]] == [[0, 0, 0, 16]] * 3
