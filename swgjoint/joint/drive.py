"""What attaching a drive to a joint leaves behind, and what can be read from it."""

from __future__ import annotations

from dataclasses import dataclass

import mujoco
import numpy as np
from numpy.typing import ArrayLike, NDArray

from swgjoint.errors import InputError
from swgjoint.maps.drive_map import DriveMap

Array = NDArray[np.float64]


@dataclass(frozen=True, kw_only=True)
class UnresolvedOrder:
    """A harmonic that was left out because the step cannot carry it."""

    order: float
    """Cycles per turn of the input, |n_theta + n_psi/i|."""
    error: float
    """Amplitude in the kinematic error [rad]."""
    torque: float
    """Amplitude in the output torque at rated torque, torsion held [N·m]."""


@dataclass(frozen=True, kw_only=True, eq=False)
class JointSignals:
    """What the drive does, sample by sample; arrays of one shape."""

    torsion: Array
    """theta/i + e0 - psi [rad]."""
    transmission_error: Array
    """psi - theta/i, output minus ideal output [rad]."""
    torque: Array
    """Torque on the link, elastic and damping [N·m]."""


@dataclass(frozen=True, kw_only=True, eq=False)
class JointDrive:
    """One drive on one joint of a model."""

    joint: str
    """Link joint."""
    rotor: str | None
    """Rotor joint, input side; None for ``rigid``."""
    tendon: str | None
    plugin: str | None
    """Plugin instance; only ``full`` has one."""
    level: str
    ratio: float
    rotor_inertia: float
    """Rotor and wave generator, input side [kg·m²]."""
    link_inertia: float
    """Inertia about the joint at qpos0, the other joints held [kg·m²]."""
    stiffness: float
    """Mean stiffness of the map [N·m/rad]."""
    damping: float
    """Torque per torsion rate, output side [N·m·s/rad]."""
    drive: DriveMap
    """The map as simulated: without the unresolved harmonics."""
    unresolved: tuple[UnresolvedOrder, ...]
    """Harmonics left out, lowest order first."""

    @property
    def kept_orders(self) -> tuple[float, ...]:
        """Orders per input turn that the map as simulated holds, increasing."""
        return tuple(sorted({float(n) for n in input_orders(self.drive)[1:]}))

    @property
    def natural_frequency(self) -> float:
        """Torsion mode of rotor against link, both else free [rad/s]; 0 for rigid."""
        if self.level == "rigid":
            return 0.0
        rotor = self.ratio**2 * self.rotor_inertia
        reduced = rotor * self.link_inertia / (rotor + self.link_inertia)
        return float(np.sqrt(self.stiffness / reduced))

    def signals(
        self,
        theta: ArrayLike,
        psi: ArrayLike,
        theta_rate: ArrayLike = 0.0,
        psi_rate: ArrayLike = 0.0,
    ) -> JointSignals:
        """Torsion, transmission error and torque from recorded joint states.

        Taken at the positions and velocities that are passed in, so pass ``qpos`` and
        ``qvel`` of the same instant, as they stand after a step. The discrete scheme
        evaluates its force half a step earlier; what is given here is the law itself
        at the true positions.

        Args:
            theta: Rotor positions [rad].
            psi: Link positions [rad].
            theta_rate: Rotor velocities [rad/s].
            psi_rate: Link velocities [rad/s].

        Raises:
            InputError: For level ``rigid``, which has no rotor; see :meth:`observe`.
        """
        if self.level == "rigid":
            raise InputError(
                f"joint {self.joint!r} is rigid: it has no rotor to take signals from; "
                "use observe(model, data)"
            )
        theta, psi, theta_rate, psi_rate = np.broadcast_arrays(
            *(np.asarray(x, float) for x in (theta, psi, theta_rate, psi_rate))
        )
        error = psi - theta / self.ratio
        if self.level == "linear":
            rate = theta_rate / self.ratio - psi_rate
            return JointSignals(
                torsion=-error,
                transmission_error=error,
                torque=-self.stiffness * error + self.damping * rate,
            )
        _, e_theta, e_psi = self.drive.error_at(self.drive.phases(theta, psi))
        g_theta, g_psi = 1.0 / self.ratio + e_theta, -1.0 + e_psi
        rate = g_theta * theta_rate + g_psi * psi_rate
        return JointSignals(
            torsion=self.drive.torsion(theta, psi),
            transmission_error=error,
            torque=self.drive.forces(theta, psi)[1] - self.damping * rate * g_psi,
        )

    def observe(self, model: mujoco.MjModel, data: mujoco.MjData) -> JointSignals:
        """The same from an ``MjData`` after a step; arrays of shape ().

        A rigid drive has no torsion and no error; its torque on the link is the
        torque at the joint less what the reflected rotor inertia takes.
        """
        joint = model.joint(self.joint)
        q, v = int(joint.qposadr[0]), int(joint.dofadr[0])
        if self.rotor is None:
            torque = data.qfrc_actuator[v] + data.qfrc_applied[v]
            torque = torque - self.ratio**2 * self.rotor_inertia * data.qacc[v]
            zero = np.zeros(())
            return JointSignals(
                torsion=zero, transmission_error=zero, torque=np.asarray(torque)
            )
        rotor = model.joint(self.rotor)
        return self.signals(
            data.qpos[int(rotor.qposadr[0])],
            data.qpos[q],
            data.qvel[int(rotor.dofadr[0])],
            data.qvel[v],
        )


def input_orders(drive: DriveMap) -> Array:
    """Order per input turn of every harmonic, |n_theta + n_psi/i|. (n_harmonics,)."""
    n_theta, n_psi = drive.angle_orders.T
    return np.asarray(np.abs(n_theta + n_psi / drive.ratio))


def prune(
    drive: DriveMap, *, timestep: float, max_input_speed: float, max_phase_step: float
) -> tuple[DriveMap, tuple[UnresolvedOrder, ...]]:
    """Leave out the harmonics whose phase moves too far in one step.

    Args:
        drive: Map with all its harmonics.
        timestep: Step h [s].
        max_input_speed: Largest speed of the input [rad/s].
        max_phase_step: Largest h n |theta rate| that is kept [rad].

    Returns:
        The map without them, and the list of what was left out.
    """
    orders = input_orders(drive)
    keep = timestep * orders * abs(max_input_speed) <= max_phase_step
    if keep.all():
        return drive, ()
    torsion = drive.mean_torsion(drive.ratings.rated_torque)
    torque = np.hypot(*drive.coefficients(torsion, 1).T)
    error = np.hypot(*drive.kinematic_error.T)
    left = [
        UnresolvedOrder(
            order=float(orders[k]), error=float(error[k]), torque=float(torque[k])
        )
        for k in np.flatnonzero(~keep)
    ]
    return drive.with_harmonics(keep), tuple(sorted(left, key=lambda u: u.order))
