"""The library of unmodelled effects, by name, in the order in which they act."""

from gaitopt.effects.effect import Effect
from gaitopt.effects.library import body, camera, contact, hinge, servo

_IN_ORDER = (
    servo.SERVO_TORQUE_LIMIT,
    servo.SERVO_TRAVEL,
    servo.SERVO_TRIM,
    servo.SERVO_SPEED_LIMIT,
    servo.COMMAND_LATENCY,
    servo.CHANNEL_TIMING,
    servo.SERVO_GAIN,
    servo.SERVO_DAMPING,
    servo.SERVO_INERTIA,
    servo.SERVO_BACKLASH,
    servo.SERVO_SAG,
    servo.SERVO_DEADBAND,
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
    contact.PAD_FRICTION,
    contact.BODY_FRICTION,
    contact.CONTACT_COMPLIANCE,
    contact.FRICTION_ANISOTROPY,
    contact.FRICTION_DIRECTION,
    contact.FRICTION_LOAD,
    camera.CAMERA_SCALE,
    camera.CAMERA_TILT,
    camera.CLOCK_OFFSET,
    camera.CLOCK_RATE,
    camera.CLOCK_ROUNDING,
    camera.MARKER_OUTLIERS,
)
"""What is sent, then servos, hinges, bodies, contacts, then what is measured."""

EFFECTS: dict[str, Effect] = {effect.name: effect for effect in _IN_ORDER}
"""Every effect by name."""

__all__ = ["EFFECTS", "Effect"]
