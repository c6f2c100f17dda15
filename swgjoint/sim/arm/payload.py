"""An arm with a payload at its tool."""

from __future__ import annotations

import mujoco
import numpy as np

from swgjoint.errors import InputError
from swgjoint.sim.arm.reading import ArmReading
from swgjoint.sim.arm.rigid_arm import RigidArm
from swgjoint.sim.scene.feature_sections import Payload
from swgjoint.units import mm

BODY = "payload"
POINT = 1e-9
"""Moment of inertia added to every payload, divided by its mass [m²], because the
engine rejects bodies without inertia."""


class LoadedArm(RigidArm):
    """A rigid arm that carries a payload at its tool site."""

    def __init__(
        self,
        reference: str,
        *,
        tool_site: str,
        payload: Payload,
        where: str,
        reading: ArmReading | None = None,
    ) -> None:
        """Load an arm with a payload.

        Args:
            reference: Path or bundled name.
            tool_site: Site at which the payload is fixed.
            payload: The payload.
            where: Start of messages about the payload.
            reading: Hinges that move, and pose of held joints; None moves every hinge.

        Raises:
            InputError: If the arm has no such site, or already has a body with the name
                of the payload.
        """
        # load the arm without the payload first, to check for the site
        self._payload: Payload | None = None
        self._site, self._where = tool_site, where
        super().__init__(reference, tool_site=tool_site, reading=reading)
        if self.tool < 0:
            raise InputError(
                f"{where}: payload: arm {reference!r} has no site {tool_site!r};"
                " accepted: the name of a site or body in tool_site"
            )
        self._payload = payload
        super().__init__(reference, tool_site=tool_site, reading=reading)

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


def arms_of(
    reference: str,
    *,
    tool_site: str,
    payload: Payload | None,
    where: str,
    reading: ArmReading | None = None,
) -> tuple[RigidArm, RigidArm]:
    """The arm of a scene, and the controller's model of the arm.

    Args:
        reference: Path or bundled name.
        tool_site: Name of the tool site.
        payload: Payload at the tool site; None without a payload.
        where: Start of messages about the payload.
        reading: Hinges that move, and pose of held joints; None moves every hinge.

    Returns:
        The arm with its payload, and the controller's model, which is the arm without
        the payload if the payload is not known.
    """
    if payload is None:
        arm = RigidArm(reference, tool_site=tool_site, reading=reading)
        return arm, arm
    loaded = LoadedArm(
        reference, tool_site=tool_site, payload=payload, where=where, reading=reading
    )
    if payload.known:
        return loaded, loaded
    return loaded, RigidArm(reference, tool_site=tool_site, reading=reading)
