"""States of the 2D model: equilibria and starts of their search."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from swgjoint.errors import Outcome
from swgjoint.fe.common.friction import SlipHistory
from swgjoint.fe.plane.contact_points import Contacts
from swgjoint.typing import Array, Mask


@dataclass(frozen=True, kw_only=True, eq=False)
class StateFigures:
    """Scalar results that equilibria of 2D and 3D models share."""

    wave_generator_angle: float = 0.0
    """Rotation of the wave generator in the global frame [rad]."""
    rotation: float = 0.0
    """Best-fit rotation of the flexspline's bore [rad]; of the bore of the diaphragm in
    a 3D model."""
    circular_spline_rotation: float = 0.0
    """Rotation of the circular spline in the global frame [rad]."""
    torque: float = 0.0
    """Torque T of the output on its load, whole drive [N·m]."""
    holding_torque: float = 0.0
    """External torque on the flexspline, whole drive [N·m]; on the bore of its
    diaphragm in a 3D model."""
    wave_generator_torque: float = 0.0
    """External torque on the wave generator, whole drive [N·m]."""
    tooth_moment: float = 0.0
    """Moment of the tooth forces on the flexspline, whole drive [N·m]."""
    energy: float = 0.0
    """Elastic energy of the whole drive, including that of the contacts [J]."""
    compliance: float = 0.0
    """Tangent compliance -d(output rotation)/dT at the active contacts [rad/(N·m)]; NaN
    in a 3D model whose torque is not prescribed.

    Compared with differences of output angles, the compliance of 2D models is at most
    0.1 % off: ``size-25-100``, the reference drive, also on four rollers, and
    ``dca-80-to-1`` at 10 to 100 % of their repeated peak.
    """
    outcome: Outcome = Outcome.CONVERGED
    """Outcome of the solve."""
    history: tuple[float, ...] = ()
    """Largest displacement increment of each iteration [m]."""


@dataclass(frozen=True, kw_only=True, eq=False)
class State(StateFigures):
    """One equilibrium, or the start of the search for one, in the global frame."""

    faces: Array
    """Positions of the first face of each sector (N, n_face, 2) [m]."""
    bores: Array
    """Positions of the bore nodes between the faces (N, n_bore, 2) [m]."""
    pressure: Array
    """Normal force (not pressure) on the bore at each of its contact stations (N, q)
    [N], see :mod:`swgjoint.fe.plane.bore_contact`."""
    touching: Mask
    """Whether each of these stations is in contact (N, q)."""
    flank_force: Array
    """Tooth forces as nodal forces in the sector frames (N, 2 n_b) [N]."""
    circular_spline_force: Array
    """Tooth forces on the circular spline as nodal forces in the frames of its teeth
    (N_c, 2 n_c) [N]."""
    race: Array | None = None
    """Coordinates of the wave generator's outer race (N, m, 2, 2) [m], see
    :class:`swgjoint.fe.plane.race.PlaneRace`; None for a rigid wave generator."""
    ball_force: Array | None = None
    """Forces of the balls of the whole drive (balls,) [N]; None without balls."""
    contacts: Contacts | None = None
    """Tooth contacts that carry force; None before the first solve."""
    tooth_force: Array = field(default_factory=lambda: np.zeros(0))
    """Normal force at each contact (n_contacts,) [N]."""
    friction_force: Array = field(default_factory=lambda: np.zeros(0))
    """Friction force on the flexspline at each contact, positive from tip to root
    (n_contacts,) [N]."""
    slip: SlipHistory | None = None
    """Contact candidates and their forces at the end of the last load step; None
    without friction."""
    candidates: SlipHistory | None = None
    """Contact candidates and their forces in the current iteration; None once the
    search has ended."""
    friction_work: float = 0.0
    """Work dissipated by friction since the rim was deflected, whole drive [J]."""
