"""The PCA9685: sixteen pulses from one I2C address. Runs in MicroPython and in Python alike.

All numbers are from the datasheet: NXP, PCA9685, 16-channel 12-bit PWM Fm+ I2C-bus LED controller, Rev. 4.
"""

OSCILLATOR_HZ = 25000000  # internal oscillator (section 2); single boards are some per cent off
STEPS = 4096  # of a frame, 12 bits (section 7.3.3)
ADDRESS = 0x40  # of a board whose address bridges are all open (section 7.1.1)
MODE1, MODE2, PRE_SCALE = 0x00, 0x01, 0xFE  # registers (table 4)
LED0_ON_L = 0x06  # the first of four registers of each output: ON low, ON high, OFF low, OFF high (table 4)
ALL_LED_OFF_H = 0xFD  # table 4
SLEEP, AUTO_INCREMENT = 0x10, 0x20  # bits of MODE1 (section 7.3.1)
TOTEM_POLE = 0x04  # bit OUTDRV of MODE2 (section 7.3.2)
FULL_OFF = 0x10  # bit 4 of OFF high: no pulse (section 7.3.3)
WAKE_US = 500  # the oscillator starts within this time (section 7.3.1)


def divider(frame_us: int) -> int:
    """Return PRE_SCALE + 1, clocks of the oscillator a step: equation 1 of section 7.3.5."""
    return (OSCILLATOR_HZ // 1000000 * frame_us + STEPS // 2) // STEPS


def ticks(pulse_us: int, clocks: int) -> int:
    """Return the nearest number of steps of a pulse, at most what a frame holds."""
    return min((OSCILLATOR_HZ // 1000000 * pulse_us + clocks // 2) // clocks, STEPS - 1)


def width_us(steps: int, clocks: int) -> float:
    """Return the length of a pulse of some steps."""
    return steps * clocks * 1000000 / OSCILLATOR_HZ


def setup(frame_us: int) -> "tuple[bytes, ...]":
    """Return what is written first: no pulses, asleep, the frame's length, awake. Then wait `WAKE_US`."""
    clocks = divider(frame_us)
    if not 4 <= clocks <= 256:
        raise ValueError(f"FRAME_US: found {frame_us}; allowed: 656 to 41943")
    return (
        bytes((ALL_LED_OFF_H, FULL_OFF)),
        bytes((MODE1, SLEEP)),  # PRE_SCALE can be set only asleep (section 7.3.5)
        bytes((PRE_SCALE, clocks - 1)),
        bytes((MODE2, TOTEM_POLE)),
        bytes((MODE1, AUTO_INCREMENT)),
    )


def pulse(output: int, pulse_us: int, frame_us: int) -> bytes:
    """Return what is written to send pulses on an output; of 0 µs: none."""
    first = LED0_ON_L + 4 * output
    if pulse_us == 0:
        return bytes((first, 0, 0, 0, FULL_OFF))
    steps = ticks(pulse_us, divider(frame_us))
    return bytes((first, 0, 0, steps & 0xFF, steps >> 8))
