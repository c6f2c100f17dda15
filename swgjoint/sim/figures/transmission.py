"""Torque law between motor and link of one joint, evaluated on recorded arrays."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from swgjoint.joint.drive import JointDrive, JointSignals
from swgjoint.joint.native import native_map
from swgjoint.maps.drive_map import DriveMap
from swgjoint.maps.fit.error_spectrum import with_error
from swgjoint.maps.friction import FrictionCourse, continue_friction
from swgjoint.maps.hysteresis import stretches
from swgjoint.typing import Array

_CHUNK = 1024  # samples per call: the coefficient table of a chunk fits in the cache
STIFF = 1e3
"""Stiffness of the map that represents a drive without torsion, relative to the
stiffness of the drive itself. The torsion of this map is about 0.01 arcmin at rated
torque, which is negligible but well above round-off."""


@dataclass(frozen=True, kw_only=True)
class Rests:
    """Where hysteresis elements and the friction bristle of a drive are relaxed."""

    elements: tuple[float, ...] = ()
    """Torsion at which each element is relaxed [rad]."""
    bristle: float | None = None
    """Rotation beta at which the bristle is relaxed [rad]; None without friction."""


@dataclass(frozen=True, kw_only=True, eq=False)
class PlayedSignals(JointSignals):
    """Signals of a record, including history-dependent torques. Shapes (n,)."""

    slipping: Array
    """Hysteresis torque along the torsion [N·m]."""
    friction: Array
    """Friction torque of the wave generator on the flexspline [N·m]."""
    stored: float
    """Change of the energy stored in the hysteresis springs over the record [J]."""
    rests: Rests
    """Where elements and bristle were relaxed before the last sample, with which a
    record may continue there."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Transmission:
    """Drive of one joint as the compiled model contains it."""

    attached: JointDrive
    """The drive as it was attached to the model."""
    drive: DriveMap
    """The complete map, which provides ratings, name and validity."""
    law: DriveMap | None
    """The map that the model contains between motor and link. It has constant stiffness
    at level ``linear``, an elastic polynomial at ``native``, and no unresolved
    harmonics at ``full``; it has friction if the model has friction. None at the levels
    without a rotor, which are ``rigid`` and ``kinematic``."""

    @property
    def joint(self) -> str:
        """Name of the link joint."""
        return self.attached.joint

    @property
    def level(self) -> str:
        """One of :data:`swgjoint.joint.attach.LEVELS`."""
        return self.attached.level

    @property
    def ratio(self) -> float:
        """Signed ratio i, output = input / i."""
        return self.attached.ratio

    @property
    def rotor_inertia(self) -> float:
        """Rotor inertia about the motor axis [kg·m²]."""
        return self.attached.rotor_inertia

    @property
    def told(self) -> DriveMap:
        """Map of the drive as simulated, for the model of a controller.

        At levels with a rotor, it is :attr:`law`. At the other levels, it is a map of
        level ``rigid`` without friction. Its torsion is negligible, because it is
        :data:`STIFF` times as stiff as the drive, and it has a kinematic error at level
        ``kinematic`` only.
        """
        if self.law is not None:
            return self.law
        drive = self.attached.drive
        spring = _linear(drive, STIFF * self.attached.stiffness)
        if self.level == "kinematic":
            spring = with_error(spring, drive.orders, drive.kinematic_error)
        return replace(spring, level="rigid")

    def signals(
        self,
        theta: Array,
        psi: Array,
        theta_rate: Array,
        psi_rate: Array,
        *,
        course: FrictionCourse | None = None,
        rests: Rests | None = None,
    ) -> PlayedSignals:
        """Torsion, transmission error and torques of recorded states.

        The elastic law is evaluated at the positions and velocities of each state.
        Hysteresis and friction depend on the whole record. The method is for levels
        with a rotor only.

        Args:
            theta: Motor angles [rad]. Shape (n,).
            psi: Link angles [rad]. Shape (n,).
            theta_rate: Motor speeds [rad/s]. Shape (n,).
            psi_rate: Link speeds [rad/s]. Shape (n,).
            course: Friction that changes along the record; None for that of the drive.
            rests: Where elements and bristle are relaxed before the record; None at
                the start of a run.
        """
        evaluated = [
            self.attached.signals_and_law(
                theta[k : k + _CHUNK],
                psi[k : k + _CHUNK],
                theta_rate[k : k + _CHUNK],
                psi_rate[k : k + _CHUNK],
            )
            for k in range(0, theta.size, _CHUNK)
        ]
        pieces = [signals for signals, _ in evaluated]
        laws = [law for _, law in evaluated if law is not None]
        torsion = np.concatenate([p.torsion for p in pieces])
        torque = np.concatenate([p.torque for p in pieces])
        played, rubs = np.zeros((2, theta.size))
        stored, ends, bristle = 0.0, [], None
        elements = self.attached.elements
        if elements:
            elastic = np.concatenate([law.torque for law in laws]) if laws else 0.0
            # hysteresis starts relaxed
            relaxed = float(torsion[0])
            begins = rests.elements if rests else len(elements) * (relaxed,)
            for element, rest in zip(elements, begins, strict=True):
                stretch = stretches(torsion - rest, element.reach(elastic))
                played += element.stiffness * stretch
                change = stretch[-1] ** 2 - stretch[0] ** 2
                stored += 0.5 * element.stiffness * float(change)
                ends.append(float((torsion - stretch)[-2:][0]))
            # torque on the link per torque along the torsion
            slope = -np.concatenate([law.by_psi for law in laws]) if laws else 1.0
            torque = torque + played * slope
        friction = self.attached.friction
        if friction is not None:
            by_theta, by_psi = self.drive.friction_direction
            rubs, bristle = continue_friction(
                course or friction,
                by_theta * theta + by_psi * psi,
                by_theta * theta_rate + by_psi * psi_rate,
                torque / self.ratio,
                rests.bristle if rests else None,
            )
            torque = torque - by_psi * rubs
        return PlayedSignals(
            torsion=torsion,
            transmission_error=np.concatenate([p.transmission_error for p in pieces]),
            torque=torque,
            slipping=played,
            friction=rubs,
            stored=stored,
            rests=Rests(elements=tuple(ends), bristle=bristle),
        )


def transmission_of(attached: JointDrive, drive: DriveMap) -> Transmission:
    """Drive of one joint as the compiled model contains it.

    Args:
        attached: The attached drive.
        drive: The complete map.
    """
    law: DriveMap | None = None
    if attached.level == "full":
        law = attached.drive
    elif attached.native is not None:
        law = native_map(attached.drive, attached.native)
    elif attached.level == "linear":
        law = _linear(drive, attached.stiffness)
    return Transmission(attached=attached, drive=drive, law=law)


def _linear(drive: DriveMap, stiffness: float) -> DriveMap:
    """A map with constant stiffness and the name and ratings of a drive."""
    spring = DriveMap.linear(
        stiffness,
        layout=drive.layout,
        teeth_flexspline=drive.teeth_flexspline,
        teeth_circular_spline=drive.teeth_circular_spline,
        rated_torque=drive.ratings.rated_torque,
        name=drive.name,
    )
    return replace(spring, ratings=drive.ratings)
