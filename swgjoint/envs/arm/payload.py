"""Payloads of an arm whose mass every episode draws."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from mujoco.batch import Batch
from numpy.typing import NDArray

from swgjoint.errors import InputError
from swgjoint.sim.arm.payload import BODY, POINT, arms_of
from swgjoint.sim.arm.rigid_arm import RigidArm
from swgjoint.sim.assembly import Assembly
from swgjoint.sim.equilibrium import start_state
from swgjoint.typing import Array


class DrawnPayloads:
    """Point masses at the tool of simulated arms, unknown to their controllers.

    The nominal payload of the scene stays known. The arms start in the pose in which
    their motor loops carry the drawn payload.
    """

    def __init__(self, assembly: Assembly, bounds: tuple[float, float]) -> None:
        """Prepare the payload of an assembled scene.

        Args:
            assembly: The scene with its nominal payload, a point mass.
            bounds: Smallest and largest mass [kg].
        """
        scene = assembly.scene
        self._assembly, self._bounds = assembly, bounds
        # a second arm, whose payload can change without that of the assembly
        self._arm, _ = arms_of(scene)
        self._body = int(self._arm.model.body(BODY).id)

    def link_inertia_missing(self) -> Array:
        """Nominal link inertia minus that with the lightest payload [kg·m²].

        Shape (n_joints,).
        """
        qpos = self._arm.model.qpos0
        lightest = self._loaded(self._bounds[0]).inertia(qpos)
        return np.asarray(self._assembly.arm.inertia(qpos) - lightest)

    def heaviest(self) -> tuple[float, Array]:
        """Largest mass [kg], and the drive torques that carry it [N·m]."""
        mass = self._bounds[1]
        return mass, self._carried(mass)[1]

    def attach_to(self, batch: Batch) -> None:
        """Give every simulation its own payload, at first the nominal one."""
        assembly, count = self._assembly, batch.nsim
        payload = assembly.scene.payload
        assert payload is not None
        self._batch = batch
        self._in_model = int(assembly.model.body(BODY).id)
        self._mass = batch.expand("body_mass")
        self._inertia = batch.expand("body_inertia")
        self.mass: Array = np.full(count, payload.mass_kg)
        """Payloads of all simulations [kg]. Shape (n,)."""
        theta, torque = start_of(assembly)
        self._start = np.tile(theta, (count, 1)), np.tile(torque, (count, 1))

    def draw(self, rows: Sequence[int], rngs: Sequence[np.random.Generator]) -> None:
        """Draw the payloads of some simulations, and find their starts.

        Args:
            rows: Indices of the simulations.
            rngs: Random generators, one for each of them.
        """
        self.mass = self.mass.copy()
        for k, rng in zip(rows, rngs, strict=True):
            self.mass[k] = mass = rng.uniform(*self._bounds)
            self._mass[k, self._in_model] = mass
            self._inertia[k, self._in_model] = POINT * mass
            self._start[0][k], self._start[1][k] = self._carried(mass)
        self._batch.set_const(list(rows))

    def start_of(self, rows: NDArray[np.intp]) -> tuple[Array, Array]:
        """Motor angles [rad] and drive torques [N·m] at the start of simulations."""
        theta, torque = self._start
        return theta[rows], torque[rows]

    def _loaded(self, mass: float) -> RigidArm:
        """The arm with a payload of a mass [kg]."""
        model = self._arm.model
        model.body_mass[self._body] = mass
        model.body_inertia[self._body] = POINT * mass
        return self._arm

    def _carried(self, mass: float) -> tuple[Array, Array]:
        """Motor angles and drive torques with which the motor loops carry a mass."""
        assembly, arm = self._assembly, self._loaded(mass)
        path = assembly.trajectory
        first = path.position[:2], path.velocity[:2], path.acceleration[:2]
        link_torque = assembly.load + arm.torques(*first)
        return start_of(replace(assembly, arm=arm, link_torque=link_torque))


def check_strength(
    assembly: Assembly, drawn: DrawnPayloads | None, strength: Array
) -> None:
    """Reject a load that the drives cannot carry at the start of an episode.

    Args:
        assembly: The scene with its nominal payload.
        drawn: Drawn payloads, of which the heaviest must be carried; None for none.
        strength: Largest torques of the drives [N·m]. Shape (n_joints,).

    Raises:
        InputError: If an episode would end at its first step.
    """
    scene = assembly.scene
    mass = scene.payload.mass_kg if scene.payload is not None else 0.0
    if drawn is None:
        torque = start_of(assembly)[1]
    else:
        mass, torque = drawn.heaviest()
    excess = np.abs(torque) / strength
    worst = int(excess.argmax())
    if not excess[worst] <= 1.0:
        raise InputError(
            f"scene {scene.name!r} with a payload of {mass:g} kg: joint"
            f" {assembly.joints[worst]!r} carries {abs(torque[worst]):.4g} N·m at the"
            f" start; accepted: up to {strength[worst]:.4g} N·m, its momentary peak or"
            " ratcheting torque"
        )


def start_of(assembly: Assembly) -> tuple[Array, Array]:
    """Motor angles [rad] and drive torques [N·m] at the start of a scene."""
    qpos, _ = start_state(assembly)
    theta, psi = qpos[assembly.motor_position], qpos[assembly.link_position]
    torque = [
        float(t.law.forces(a, b)[1])
        for t, a, b in zip(assembly.transmissions, theta, psi, strict=True)
        if t.law is not None
    ]
    return theta, np.array(torque)
