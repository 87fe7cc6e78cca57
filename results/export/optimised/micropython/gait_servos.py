# Plays gait_table on the servos of this board:
#
#     import gait_servos
#     gait_servos.run(20)
#
# walks for 20 seconds and comes to rest in its start pose; Ctrl-C lets the servos go at once.

import time

from machine import PWM, Pin

import gait_table
from gait_player import HOLDING, WALKING, Player


class Clock:
    """Microseconds, 32 bits: MicroPython's own counter wraps earlier."""

    def __init__(self):
        self.ticks = time.ticks_us()
        self.now_us = 0

    def read(self):
        ticks = time.ticks_us()
        self.now_us = (self.now_us + time.ticks_diff(ticks, self.ticks)) & 0xFFFFFFFF
        self.ticks = ticks
        return self.now_us


def new_player():
    """Return a player of the table."""
    return Player(gait_table.PERIOD_US, gait_table.FRAME_US, gait_table.SERVOS, gait_table.PULSES_US)


def run(seconds, period_us=None):
    """Walk for some seconds, at another period if one is given, then stop in the start pose."""
    player, clock = new_player(), Clock()
    player.set_period(period_us or gait_table.PERIOD_US)
    freq = round(1000000 / gait_table.FRAME_US)
    servos = [PWM(Pin(servo[0]), freq=freq, duty_ns=0) for servo in gait_table.SERVOS]
    led = None if gait_table.LED_PIN < 0 else Pin(gait_table.LED_PIN, Pin.OUT, value=0)
    frames = int(seconds * 1000000 / gait_table.FRAME_US)
    try:
        player.start(clock.read())
        while player.state != HOLDING:
            if player.tick(clock.read()):
                for servo, pulse_us in zip(servos, player.pulse_us):
                    servo.duty_ns(pulse_us * 1000)
                if led:
                    led.value(1 if player.led() else 0)
                if player.state == WALKING:
                    frames -= 1
                    if frames <= 0:
                        player.stop()
            time.sleep_ms(1)
    finally:
        for servo in servos:
            servo.duty_ns(0)
            servo.deinit()
        if led:
            led.value(0)
