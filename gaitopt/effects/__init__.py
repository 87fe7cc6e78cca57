"""The library of unmodelled effects, by name, in the order in which they act."""

from gaitopt.effects.effect import Effect
from gaitopt.effects.library import (
    body,
    camera,
    clock,
    contact,
    friction,
    friction_direction,
    friction_load,
    grip,
    hinge,
    jitter,
    servo_back_emf,
    servo_command,
    servo_deadband,
    servo_friction,
    servo_lag,
    servo_motion,
    servo_play,
    servo_torque,
    supply,
    timing,
    tracker,
)

_IN_ORDER = (
    servo_torque.SERVO_TORQUE_LIMIT,
    servo_command.SERVO_RESOLUTION,
    jitter.COMMAND_JITTER,
    servo_command.SERVO_TRAVEL,
    servo_command.SERVO_TRIM,
    servo_command.SERVO_SPEED_LIMIT,
    timing.COMMAND_LATENCY,
    timing.CHANNEL_TIMING,
    servo_lag.SERVO_LAG,
    servo_motion.SERVO_GAIN,
    servo_motion.SERVO_DAMPING,
    servo_motion.SERVO_INERTIA,
    servo_play.SERVO_BACKLASH,
    servo_back_emf.SERVO_BACK_EMF,
    servo_friction.SERVO_FRICTION,
    servo_friction.SERVO_FRICTION_LOAD,
    servo_friction.SERVO_STICTION,
    supply.SERVO_SAG,
    servo_deadband.SERVO_DEADBAND,
    hinge.HINGE_STIFFNESS,
    hinge.HINGE_NONLINEARITY,
    hinge.HINGE_DAMPING,
    hinge.HINGE_FRICTION,
    hinge.HINGE_ASYMMETRY,
    hinge.HINGE_HYSTERESIS,
    body.GROUND_SLOPE,
    body.PAYLOAD_MASS,
    body.COM_OFFSET,
    body.LINK_INERTIA,
    body.GEOMETRY_SCALE,
    body.TETHER_DRAG,
    friction.PAD_FRICTION,
    friction.BODY_FRICTION,
    friction.PAD_IMBALANCE,
    contact.CONTACT_COMPLIANCE,
    friction_direction.FRICTION_ANISOTROPY,
    friction_direction.FRICTION_DIRECTION,
    friction_load.FRICTION_LOAD,
    grip.GRIP_VARIATION,
    camera.CAMERA_SCALE,
    camera.CAMERA_TILT,
    clock.CLOCK_OFFSET,
    clock.CLOCK_RATE,
    clock.CLOCK_ROUNDING,
    tracker.MARKER_OUTLIERS,
)
"""Commands and servos, then hinges, bodies and contacts, then measurement.

To add an effect, write its record in a file of `library` and add it here.
"""

EFFECTS: dict[str, Effect] = {effect.name: effect for effect in _IN_ORDER}
"""Every effect by name."""

__all__ = ["EFFECTS", "Effect"]
