"""Plays a script on a player and gives a line for every step: what trace.c does in C.

Runs in Python and in MicroPython; there, `script.py` and `gait_table.py` lie beside it.
"""

from gait_player import duty


def lines(player, script):
    """Yield what each step of a script, (what, value), leaves behind."""
    for what, value in script:
        due = False
        if what == "g":
            player.start(value)
        elif what == "s":
            player.stop()
        elif what == "r":
            player.release()
        elif what == "p":
            player.set_period(value)
        else:
            due = player.tick(value)
        pulses = " ".join(f"{pulse}/{duty(pulse, player.frame_us)}" for pulse in player.pulse_us)
        yield f"{what} {int(due)} {player.state} {int(player.led())} {pulses}"
