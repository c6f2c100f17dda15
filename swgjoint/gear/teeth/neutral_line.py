"""Motion of rigid flexspline teeth on the deflected neutral line of the rim.

The rim follows the wave generator: its neutral line is the outline, offset by half the
rim thickness, and the teeth are normal to this line. The undeflected neutral line is a
circle of radius r_m. The arc length of a point from the lobe does not change when the
rim is deflected, except for the correction in :class:`NeutralLine`.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike

from swgjoint.errors import DesignError
from swgjoint.gear.design.design import Design
from swgjoint.gear.wave_generators.wave_generator import WaveGenerator, wave_generator
from swgjoint.typing import Array
from swgjoint.units import mm


@dataclass(frozen=True, kw_only=True)
class Pose:
    """Position of a tooth and its derivative with respect to the motion parameter.

    A point p of the tooth frame moves to R(angle) (p - (0, r_m)) + point, with the
    rotation matrix R and the radius r_m of the undeflected neutral line.
    """

    point: Array
    """Position of the point where the tooth axis meets the neutral line (n, 2) [m]."""
    angle: Array
    """Rotation of the tooth, counter-clockwise (n,) [rad]."""
    d_point: Array
    """Derivative of ``point`` with respect to the parameter (n, 2) [m/rad]."""
    d_angle: Array
    """Derivative of ``angle`` with respect to the parameter (n,) [-]."""


@dataclass(frozen=True, kw_only=True, eq=False)
class NeutralLine:
    r"""Neutral line of the rim on a wave generator, as a motion of one tooth.

    A tooth at the angle :math:`\theta` of the undeflected rim (counter-clockwise from
    a lobe) is at the arc length :math:`\sigma(\theta)` of the deflected line. Between
    two lobes, the deflected line is longer than the circle by a small difference
    :math:`\delta`, which may be negative. An inextensible rim could not accommodate
    this difference, so the model stretches the rim where teeth do not touch:

    .. math:: \sigma = r_m\theta + \delta\,\bigl(u - \tfrac{\sin 2\pi u}{2\pi}\bigr)

    where u goes from 0 at one lobe to 1 at the next. The stretch of the line is zero at
    the lobes, grows there with the square of u, and is largest half-way between them.
    If the real rim does not follow the outline everywhere (reduced minor axis,
    rollers), the rim of the model still does, like a taut string. The positions of
    teeth near a lobe are then correct, but those half-way between lobes are not.
    """

    outline: WaveGenerator
    """Outline of the wave generator."""
    lobes: int
    """Number of lobes."""
    radius: float
    """Radius r_m of the undeflected neutral line [m]."""
    offset: float
    """Distance from the outline to the neutral line, half the rim thickness [m]."""

    @property
    def length(self) -> float:
        """Length of the deflected neutral line [m]."""
        return self.outline.perimeter + 2.0 * np.pi * self.offset

    @cached_property
    def _lobe_stations(self) -> Array:
        """Arc lengths of the deflected line at the lobes (lobes + 1,) [m]."""
        wanted = 2.0 * np.pi * np.arange(self.lobes + 1) / self.lobes
        perimeter = self.outline.perimeter
        low = np.full(self.lobes + 1, -0.25 * perimeter)
        high = np.full(self.lobes + 1, 1.25 * perimeter)
        for _ in range(60):
            middle = 0.5 * (low + high)
            point, normal, _ = self.outline.evaluate(middle)
            below = _turn(point + self.offset * normal, middle, perimeter) < wanted
            low, high = np.where(below, middle, low), np.where(below, high, middle)
        s = 0.5 * (low + high)
        _, normal, _ = self.outline.evaluate(s)
        return np.asarray(s + self.offset * _turn(normal, s, perimeter))

    @property
    def extension(self) -> float:
        """Largest magnitude of the stretch, which occurs half-way between lobes [-]."""
        gaps = np.diff(self._lobe_stations)
        arc = 2.0 * np.pi * self.radius / self.lobes
        return float(np.max(np.abs(2.0 * (gaps - arc) / arc)))

    def _arc_length(self, theta: Array) -> tuple[Array, Array]:
        """Arc length sigma [m] of the deflected line and d sigma/d theta [m/rad]."""
        pitch = 2.0 * np.pi / self.lobes
        turns = np.floor(theta / pitch)
        u = theta / pitch - turns
        k = np.mod(turns, self.lobes).astype(int)
        gaps = np.diff(self._lobe_stations)[k]
        delta = gaps - pitch * self.radius
        wave = 2.0 * np.pi * u
        start = self._lobe_stations[k] + np.floor(turns / self.lobes) * self.length
        sigma = start + pitch * self.radius * u + delta * (u - np.sin(wave) / 2 / np.pi)
        rate = self.radius + delta * (1.0 - np.cos(wave)) / pitch
        return sigma, rate

    def pose(self, theta: ArrayLike) -> Pose:
        """Pose of the tooth at the rim angle theta, in the frame of the wave generator.

        Args:
            theta: Angles on the undeflected rim from the first lobe, counter-clockwise
                and over any number of turns (n,) [rad].
        """
        theta = np.asarray(theta, dtype=float)
        sigma, rate = self._arc_length(theta)
        perimeter, d = self.outline.perimeter, self.offset
        # the offset line has the arc length s + d turn(s)
        s = sigma * perimeter / self.length
        for _ in range(50):
            points, normals, curvature = self.outline.evaluate(s)
            step = (s + d * _turn(normals, s, perimeter) - sigma) / (1 + d * curvature)
            s = s - step
            # Newton's method: after such a step, the next one is below round-off
            if np.max(np.abs(step), initial=0.0) < 1e-9 * self.radius:
                break
        points, normals, curvature = self.outline.evaluate(s)
        tangent = np.stack([-normals[:, 1], normals[:, 0]], axis=-1)
        return Pose(
            point=points + d * normals,
            angle=_turn(normals, s, perimeter),
            d_point=rate[:, None] * tangent,
            d_angle=rate * curvature / (1.0 + d * curvature),
        )


def _turn(vectors: Array, s: Array, perimeter: float) -> Array:
    """Angle of vectors from +y, counter-clockwise and continuous over turns [rad].

    The arc lengths ``s`` of the vectors select the multiple of 2 pi.
    """
    angle = np.arctan2(-vectors[:, 0], vectors[:, 1])
    near = 2.0 * np.pi * s / perimeter
    return np.asarray(angle + 2.0 * np.pi * np.round((near - angle) / (2.0 * np.pi)))


def neutral_line(design: Design) -> NeutralLine:
    """Neutral line of the rim of a design on its wave generator.

    Raises:
        DesignError: If the wave generator cannot be built, if the rim bridges a lobe
            without following the outline, or if the lengths of outline and bore differ
            too much.
    """
    half = 0.5 * design.flexspline.rim_mm * mm
    outline = wave_generator(design)
    line = NeutralLine(
        outline=outline,
        lobes=design.lobes,
        radius=design.flexspline_inner_radius + half,
        offset=half,
    )
    at_lobe = line.pose(2.0 * np.pi * np.arange(line.lobes) / line.lobes)
    if not (at_lobe.d_angle > 0.1).all():
        raise DesignError(
            f"{design.drive.name}: wave_generator.kind = "
            f"{design.wave_generator.kind!r}: the rim bridges the lobe without "
            "following the outline; accepted for rigid tooth kinematics: a kind that "
            "supports the rim at the lobe"
        )
    if line.extension >= 0.5:
        raise DesignError(
            f"{design.drive.name}: wave_generator: the length of its outline, "
            f"{outline.perimeter / mm:.4g} mm, differs too much from that of the bore, "
            f"{2 * np.pi * design.flexspline_inner_radius / mm:.4g} mm; accepted: a "
            "smaller difference"
        )
    return line
