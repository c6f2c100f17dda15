"""One equilibrium of the drive, as the solver leaves it."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from swgjoint.errors import Outcome
from swgjoint.fe.common.friction import SlipHistory
from swgjoint.fe.plane.contact_points import Contacts
from swgjoint.typing import Array, Mask


@dataclass(frozen=True, kw_only=True, eq=False)
class StateFigures:
    """Results that equilibria of 2D and 3D models share."""

    wave_generator_angle: float = 0.0
    """In the frame of the solver [rad]."""
    rotation: float = 0.0
    """Best-fit rotation of the bore, in space of the bore of the diaphragm [rad]."""
    ring_rotation: float = 0.0
    """Rotation of the circular spline [rad]."""
    torque: float = 0.0
    """Torque T that the output exerts on its load, whole drive [N·m]."""
    holding_torque: float = 0.0
    """External torque on the flexspline, in space on the bore of its diaphragm, whole
    drive [N·m]."""
    wave_generator_torque: float = 0.0
    """External torque on the wave generator, whole drive [N·m]."""
    tooth_moment: float = 0.0
    """Moment of the tooth forces on the flexspline, whole drive [N·m]."""
    energy: float = 0.0
    """Strain energy, whole drive [J]."""
    compliance: float = 0.0
    """Tangent -d(output rotation)/dT at the active contacts [rad/(N·m)], NaN where no
    torque is prescribed."""
    outcome: Outcome = Outcome.CONVERGED
    history: tuple[float, ...] = ()
    """Largest displacement increment of every iteration [m]."""


@dataclass(frozen=True, kw_only=True, eq=False)
class State(StateFigures):
    """One equilibrium, or the start of the search for one. Global frame, SI."""

    faces: Array
    """Positions of the first face of each sector (N, n_face, 2) [m]."""
    bores: Array
    """Positions of the bore nodes inside the sectors (N, n_bore, 2) [m]."""
    pressure: Array
    """Normal force of the wave generator on the stations of the bore (N, q) [N], see
    :mod:`swgjoint.fe.plane.bore_contact`."""
    touching: Mask
    """Which of those stations touch."""
    flank_force: Array
    """Tooth forces as nodal forces in the sector frames (N, 2 n_b) [N]."""
    ring_force: Array
    """The same on the circular spline, in the frames of its teeth (N_c, 2 n_c) [N]."""
    race: Array | None = None
    """Nodes of the wave generator's outer race (N, m, 2, 2), see
    :class:`swgjoint.fe.plane.race.PlaneRace` [m]; None for a rigid wave generator."""
    ball_force: Array | None = None
    """Force of the balls of the whole drive (balls,) [N]."""
    contacts: Contacts | None = None
    """Points that carry force."""
    tooth_force: Array = field(default_factory=lambda: np.zeros(0))
    """Normal force of every contact [N]. Shape (n_contacts,)."""
    friction_force: Array = field(default_factory=lambda: np.zeros(0))
    """Friction on the flexspline at every contact, tip to root [N]. (n_contacts,)."""
    slip: SlipHistory | None = None
    """Candidates and friction forces at the end of the step; None without friction."""
    candidates: SlipHistory | None = None
    """The same of the running iteration; None at its end."""
    friction_work: float = 0.0
    """Work of friction since the deflection, whole drive [J]."""
