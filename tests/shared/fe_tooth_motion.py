"""Motion of the teeth from the 2D model, for conjugate profiles.

The neutral line of :mod:`swgjoint.gear.teeth.neutral_line` follows the wave generator
and does not stretch. A real rim also bends between its teeth, lifts off where it is not
supported and carries some tension. Here the 2D model deflects the flexspline, and the
motion of a tooth is the best-fit rigid-body motion of its flanks.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from math import pi

import numpy as np
from numpy.typing import ArrayLike
from scipy.interpolate import CubicSpline

from swgjoint.errors import ComputationError
from swgjoint.fe.plane.continuation import Continuation
from swgjoint.fe.plane.corotation import rotate, rotate_right_angle
from swgjoint.fe.plane.drive2d import sector_model
from swgjoint.gear.design.design import Design, MemberName
from swgjoint.gear.teeth.conjugate import conjugate_profile
from swgjoint.gear.teeth.neutral_line import Pose
from swgjoint.gear.teeth.profile import ToothProfile
from swgjoint.gear.teeth.tooth_motion import tooth_motions
from swgjoint.gear.teeth.tooth_profile import tooth_profile
from swgjoint.typing import Array
from swgjoint.units import mm


@dataclass(frozen=True, kw_only=True, eq=False)
class DeflectedRim:
    """Poses of the teeth on a deflected rim, interpolated smoothly between teeth."""

    lobes: int
    """Number of lobes of the wave generator."""
    radius: float
    """Radius of the reference point of a tooth [m]."""
    place: Array
    """Angles of the teeth on the undeflected rim, from a lobe (n + 1,) [rad]; the last
    entry is the first one plus a period."""
    moved: Array
    """Tangential (counter-clockwise) and radial displacement of the reference point [m]
    and rotation of the tooth [rad], at the place of the tooth on the undeflected rim
    (n + 1, 3)."""

    @cached_property
    def _spline(self) -> CubicSpline:
        """Periodic spline of ``moved`` over ``place``."""
        return CubicSpline(self.place, self.moved, bc_type="periodic")

    def pose(self, theta: ArrayLike) -> Pose:
        """Pose of a tooth at rim angles theta, in the frame of the wave generator.

        Args:
            theta: Angles of the undeflected rim from a lobe, counter-clockwise (n,)
                [rad].

        Returns:
            Positions [m], angles [rad] and their derivatives with respect to theta.
        """
        theta = np.asarray(theta, dtype=float)
        value, slope = self._spline(theta), self._spline(theta, 1)
        # +x of the tooth frame points clockwise
        local = np.stack([-value[:, 0], self.radius + value[:, 1]], axis=-1)
        rate = np.stack([-slope[:, 0], slope[:, 1]], axis=-1)
        rate += rotate_right_angle(local)
        return Pose(
            point=rotate(local, theta),
            angle=theta + value[:, 2],
            d_point=rotate(rate, theta),
            d_angle=1.0 + slope[:, 2],
        )


def deflected_rim(design: Design) -> DeflectedRim:
    """Poses of the teeth when the wave generator deflects the flexspline.

    Raises:
        DesignError: If the design cannot be built or has manufacturing errors.
        ComputationError: If the deflection fails.
    """
    model = sector_model(
        design,
        half="auto",
        elastic_circular_spline=False,
        friction=False,
        bearing=False,
    )
    state = Continuation(model=model, ratio=design.ratio).deflect()
    if not state.outcome.ok:
        raise ComputationError(
            f"{design.drive.name}: deflection by the wave generator failed: "
            f"{state.outcome.value}"
        )
    element, frames = model.element, model.frames(state)
    stations = element.mesh.flank_stations[:-1]
    right, _, _ = element.profile.evaluate(stations)
    still = np.concatenate([right, right * np.array([-1.0, 1.0])])
    flank = frames.displacement @ element.flank_from_skeleton.T
    nodes = still + flank.reshape(model.sectors, -1, 2)
    # best-fit rigid motion of the flanks of each tooth in its sector frame
    centre, middle = still.mean(axis=0), nodes.mean(axis=1)
    about, seen = still - centre, nodes - middle[:, None]
    cross = np.einsum("ni,sni->s", rotate_right_angle(about), seen)
    turn = np.arctan2(cross, np.einsum("ni,sni->s", about, seen))
    radius = design.flexspline_inner_radius + 0.5 * design.flexspline.rim_mm * mm
    foot = middle + rotate(
        np.broadcast_to(np.array([0.0, radius]) - centre, middle.shape), turn
    )
    spin = frames.angle - model.place
    foot = rotate(foot, spin)
    moved = np.stack([-foot[:, 0], foot[:, 1] - radius, spin + turn], axis=-1)
    return DeflectedRim(
        lobes=design.lobes,
        radius=radius,
        place=np.append(model.place, 2.0 * pi / model.copies),
        moved=np.concatenate([moved, moved[:1]]),
    )


def conjugate_by_fe(design: Design, member: MemberName) -> ToothProfile:
    """Profile of a member, conjugate to that of the other one under the tooth motion.

    Args:
        design: The drive.
        member: Member whose profile is returned.

    Raises:
        DesignError: If no conjugate tooth exists; the message names the design key.
        ComputationError: If the deflection of the flexspline fails.
    """
    motions = tooth_motions(design, line=deflected_rim(design))
    other = "circular_spline" if member == "flexspline" else "flexspline"
    generating = tooth_profile(design, other)
    return conjugate_profile(design, member, generating, motions=motions)
