"""What effects, metrics and reports act on in any robot: roles instead of names."""

from __future__ import annotations

import math
from typing import Annotated

import numpy as np
from numpy.typing import NDArray
from pydantic import BaseModel, ConfigDict, Field, model_validator

from gaitopt.core.validation import PLAIN_NUMBER, Name

_Component = Annotated[float, Field(ge=-1e6, le=1e6, allow_inf_nan=False), PLAIN_NUMBER]
_Vector = tuple[_Component, _Component, _Component]


class Roles(BaseModel):
    """What effects, metrics and reports act on, by the names in the MJCF.

    Attributes:
        marker: site whose motion is the robot's motion; None where only joints are of interest.
        trunk: body that heading, tilt, payload and mass are of; None for the root of the tree that the
            actuators move (see `tree.trunk`).
        pads: geoms that are meant to grip; none where nothing grips.
        body: other geoms that may touch the ground.
        hinges: passive joints.
        forward: direction of travel in the world.
        up: direction against gravity in the world.
    """

    model_config = ConfigDict(frozen=True, extra="forbid")

    marker: Name | None = None
    trunk: Name | None = None
    pads: list[Name] = []
    body: list[Name] = []
    hinges: list[Name] = []
    forward: _Vector = (1.0, 0.0, 0.0)
    up: _Vector = (0.0, 0.0, 1.0)

    @model_validator(mode="after")
    def _span_a_plane(self) -> Roles:
        (a, b, c), (u, v, w) = self.forward, self.up
        across = math.hypot(b * w - c * v, c * u - a * w, a * v - b * u)
        if not across > max(1e-12, 1e-6 * math.hypot(a, b, c) * math.hypot(u, v, w)):
            raise ValueError(f"forward: found {[a, b, c]}; allowed: a direction across up {[u, v, w]}")
        return self

    @property
    def axes(self) -> NDArray[np.float64]:
        """Forward, left and up as the rows of a (3, 3) rotation; forward is projected across up."""
        up = np.array(self.up) / np.linalg.norm(self.up)
        forward = np.array(self.forward)
        forward = forward - up * (forward @ up)
        forward /= np.linalg.norm(forward)
        return np.stack([forward, np.cross(up, forward), up])
