"""Plays a gait table: pulse widths of RC servos, one set per frame, from a clock in microseconds.

Integers throughout and the same numbers as ``gait_player.c``, tick for tick; runs in MicroPython and
in Python alike, so that what is simulated before an export is what the robot gets. Call `tick` as
often as you like, at least once a frame; when it returns True, send ``pulse_us[i]`` to servo i
(0: send no pulses). Frames lie on a grid that begins at `start`, so jitter of the calls does not add
up, and a late call skips frames instead of slowing the gait down.
"""

RAMP_US = 1 << 20  # amplitude from none to full: 1.05 s
STAGGER_US = 1 << 18  # one servo after another is energised: 0.26 s
DUTY_BITS = 14  # timer resolution that every ESP32 has at 50 Hz
MAX_SERVOS = 16

OFF, ENERGISING, WALKING, STOPPING, HOLDING = range(5)

_CLOCK = (1 << 32) - 1
_CYCLE = (1 << 64) - 1
_WORD = (1 << 16) - 1


def duty(pulse_us: int, frame_us: int) -> int:
    """Return the duty of a pulse for a timer of `DUTY_BITS`."""
    return ((pulse_us << DUTY_BITS) + frame_us // 2) // frame_us


def _blend(start: int, end: int, weight: int) -> int:
    """Go from one pulse to another, weight 0 to 2^16, rounded to the nearest."""
    return (start * (65536 - weight) + end * weight + 32768) >> 16


def _check(name: str, value: object, low: int, high: int) -> None:
    """Refuse what is no whole number of a range: no fraction, no NaN."""
    if not (isinstance(value, int) and low <= value <= high):
        raise ValueError(f"{name}: found {value!r}; allowed: {low} to {high}")


def check_table(
    period_us: int,
    frame_us: int,
    servos: "tuple[tuple[int, int, int, int, int], ...]",
    pulses_us: "tuple[int, ...]",
) -> None:
    """Refuse a table that cannot be played, as ``gait_init`` does in C.

    Raises:
        ValueError: a line that says what was found and what is allowed.
    """
    _check("PERIOD_US", period_us, 1, _CLOCK)
    _check("FRAME_US", frame_us, 1, _CLOCK)
    _check("SERVOS: number of them", len(servos), 1, MAX_SERVOS)
    for row in servos:
        if len(row) != 5:
            raise ValueError(f"SERVOS: found a row of {len(row)}; allowed: pin, start, min, max, slew")
        _check("SERVOS: pin", row[0], -32768, 32767)
        _check("SERVOS: start", row[1], 0, _WORD)
        _check("SERVOS: max", row[3], 1, _WORD)
        _check("SERVOS: min", row[2], 1, row[3])
        _check("SERVOS: slew", row[4], 0, _WORD)
    if len(pulses_us) % len(servos):
        raise ValueError(f"PULSES_US: found {len(pulses_us)} pulses; allowed: rows of {len(servos)}")
    _check("PULSES_US: number of rows", len(pulses_us) // len(servos), 1, _WORD)
    for pulse in pulses_us:
        _check("PULSES_US", pulse, 0, _WORD)


class Player:
    """A table being played.

    Args:
        period_us: one cycle of the gait.
        frame_us: period of the servo signal.
        servos: per servo pin, start, shortest and longest pulse, and largest change per frame (0: none).
        pulses_us: pulses at uniform phases, row after row, one per servo.

    Raises:
        ValueError: it cannot be played; see `check_table`.
    """

    def __init__(
        self,
        period_us: int,
        frame_us: int,
        servos: "tuple[tuple[int, int, int, int, int], ...]",
        pulses_us: "tuple[int, ...]",
    ) -> None:
        check_table(period_us, frame_us, servos, pulses_us)
        self.frame_us = frame_us
        self.servos = servos
        self.pulses_us = pulses_us
        self.samples = len(pulses_us) // len(servos)
        self.phase = 0  # position in the cycle, 2^64 to a cycle
        self.frame_at_us = 0
        self.state = OFF
        self.set_period(period_us)
        self.release()

    def start(self, now_us: int) -> None:
        """Energise the servos one after another, then walk: gait time 0 is the first frame in WALKING."""
        if self.state == STOPPING:
            self.state = WALKING
        elif self.state not in (WALKING, ENERGISING):
            self.state = ENERGISING
            self.frame_at_us = (now_us - self.frame_us) & _CLOCK

    def stop(self) -> None:
        """Ramp out to the start pose and hold it."""
        if self.state == WALKING:
            self.state = STOPPING
        elif self.state == ENERGISING:
            self.release()

    def release(self) -> None:
        """Send no more pulses, at once."""
        self.state = OFF
        self.ramp_us = 0
        self.energised_us = 0
        self.pulse_us = [0] * len(self.servos)

    def set_period(self, period_us: int) -> None:
        """Walk faster or slower from here on, without a jump; a period of 0 is ignored."""
        _check("period_us", period_us, 0, _CLOCK)
        if period_us:
            self.phase_per_us = ((1 << 64) // period_us) & _CYCLE

    def tick(self, now_us: int) -> bool:
        """Return True once a frame, with new pulses."""
        passed_us = (now_us - self.frame_at_us) & _CLOCK
        if passed_us < self.frame_us:
            return False
        passed_us -= passed_us % self.frame_us
        self.frame_at_us = (self.frame_at_us + passed_us) & _CLOCK
        self._advance(passed_us)
        for servo in range(len(self.servos)):
            if self.energised_us > servo * STAGGER_US:
                self.pulse_us[servo] = self._next_pulse(servo)
        return True

    def led(self) -> bool:
        """Return the level of the sync LED: high from gait time 0 until the gait stops."""
        return self.state == WALKING

    def _advance(self, passed_us: int) -> None:
        if self.state == ENERGISING:
            all_us = len(self.servos) * STAGGER_US
            self.energised_us = min(self.energised_us + passed_us, all_us)
            if self.energised_us == all_us:
                self.state = WALKING
                self.phase = 0
                self.ramp_us = 0
        elif self.state in (WALKING, STOPPING):
            self.phase = (self.phase + passed_us * self.phase_per_us) & _CYCLE
            change_us = passed_us if self.state == WALKING else -passed_us
            self.ramp_us = min(max(self.ramp_us + change_us, 0), RAMP_US)
            if self.ramp_us == 0:
                self.state = HOLDING

    def _wave(self, servo: int) -> int:
        """Return the table's pulse at the player's phase."""
        position = (self.phase >> 32) * self.samples
        row = position >> 32
        following = 0 if row + 1 == self.samples else row + 1
        count = len(self.servos)
        return _blend(
            self.pulses_us[row * count + servo],
            self.pulses_us[following * count + servo],
            (position >> 16) & 0xFFFF,
        )

    def _next_pulse(self, servo: int) -> int:
        _, start_us, min_us, max_us, slew_us = self.servos[servo]
        last = self.pulse_us[servo]
        pulse = _blend(start_us, self._wave(servo), self.ramp_us >> 4)
        pulse = min(max(pulse, min_us), max_us)
        if last and slew_us:
            pulse = min(max(pulse, last - slew_us), last + slew_us)
        return pulse
