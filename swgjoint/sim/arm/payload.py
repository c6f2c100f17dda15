"""An arm with a payload at its tool."""

from __future__ import annotations

import mujoco
import numpy as np

from swgjoint.errors import InputError
from swgjoint.sim.arm.rigid_arm import RigidArm
from swgjoint.sim.scene.feature_sections import Payload
from swgjoint.sim.scene.scene import Scene
from swgjoint.units import mm

BODY = "payload"
POINT = 1e-9
"""Moment of inertia added to every payload, divided by its mass [m²], because the
engine rejects bodies without inertia."""


class LoadedArm(RigidArm):
    """A rigid arm that carries a payload at its tool site."""

    def __init__(self, scene: Scene, payload: Payload) -> None:
        """Load the arm of a scene with a payload.

        Args:
            scene: The scene.
            payload: The payload at its tool site.

        Raises:
            InputError: If the arm has no such site, or already has a body with the name
                of the payload.
        """
        # load the arm without the payload first, to check for the site
        self._payload: Payload | None = None
        self._site, self._where = scene.tool_site, scene.where
        arm, reading = scene.arm, scene.reading
        super().__init__(arm, tool_site=self._site, reading=reading)
        if self.tool < 0:
            raise InputError(
                f"{self._where}: payload: arm {arm!r} has no site {self._site!r};"
                " accepted: the name of a site or body in tool_site"
            )
        self._payload = payload
        super().__init__(arm, tool_site=self._site, reading=reading)

    def spec(self) -> mujoco.MjSpec:
        """A fresh editable copy of the arm with its payload."""
        spec = super().spec()
        if self._payload is not None:
            self._add(spec, self._payload)
        return spec

    def _add(self, spec: mujoco.MjSpec, payload: Payload) -> None:
        """Add the payload to the tool site of an editable model."""
        site = spec.site(self._site)
        if spec.body(BODY) is not None:
            raise InputError(
                f"{self._where}: payload: the arm already has a body named {BODY!r};"
                " accepted: another name for that body"
            )
        copy = spec.copy()
        copy.compiler.fusestatic = False  # the site stays on the body of the spec
        placed = copy.compile().site(self._site)
        body = site.parent.add_body(name=BODY, pos=placed.pos, quat=placed.quat)
        body.explicitinertial = True
        body.mass = payload.mass_kg
        body.ipos = np.array(payload.centre_mm) * mm
        body.inertia = np.array(payload.inertia_kgm2) + POINT * payload.mass_kg


def arms_of(scene: Scene) -> tuple[RigidArm, RigidArm]:
    """The arm of a scene, and the controller's model of the arm.

    Returns:
        The arm with its payload, and the controller's model, which is the arm without
        the payload if the payload is not known.
    """

    def bare() -> RigidArm:
        return RigidArm(scene.arm, tool_site=scene.tool_site, reading=scene.reading)

    if scene.payload is None:
        arm = bare()
        return arm, arm
    loaded = LoadedArm(scene, scene.payload)
    return loaded, loaded if scene.payload.known else bare()
