"""Pictures of whole designs."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from swgjoint.gear.teeth.neutral_line import neutral_line
from swgjoint.gear.teeth.tooth_profile import tooth_profile
from swgjoint.gear.wave_generators.wave_generator import lobe_height, wave_generator
from swgjoint.pictures import png
from swgjoint.typing import Array
from swgjoint.units import mm

if TYPE_CHECKING:
    from swgjoint.gear.design.design import Design
    from swgjoint.gear.teeth.profile import ToothProfile

_FLEXSPLINE, _CIRCULAR_SPLINE, _WAVE_GENERATOR = "tab:blue", "tab:red", "tab:green"
"""Colours of the members."""
_FOLLOWS = 0.02
"""Largest relative difference between the lengths of wave-generator outline and bore at
which the rim is drawn along the outline [-]."""


def design_picture(design: Design) -> bytes:
    """Draw the mesh at a lobe, the magnified deflection, and the whole drive as PNG.

    The flexspline has rigid teeth on the neutral line that follows the wave generator.
    If the outline of the wave generator is much shorter than the bore, as with rollers,
    the neutral line is that of a ring deflected by w_0 cos(lobes phi). The picture
    shows neither forces nor elastic contact.
    """
    from matplotlib.figure import Figure

    figure = Figure(figsize=(10, 8.4), layout="constrained")
    axes: dict[str, Any] = figure.subplot_mosaic(
        [["mesh", "mesh"], ["outline", "whole"]], height_ratios=[3, 5]
    )
    _mesh(axes["mesh"], design)
    _exaggerated(axes["outline"], design)
    _whole(axes["whole"], design)
    for ax in axes.values():
        ax.set_aspect("equal")
        ax.set_xlabel("x [mm]")
        ax.set_ylabel("y [mm]")
    figure.suptitle(f"{design.drive.name}: {_summary(design)}")
    return png(figure, dpi=110)


def teeth_picture(design: Design) -> bytes:
    """Draw the teeth at a lobe, as in :func:`design_picture`, as PNG."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(10, 3.2), layout="constrained")
    ax = figure.subplots()
    _mesh(ax, design)
    ax.set_aspect("equal")
    ax.set_xlabel("x [mm]")
    ax.set_ylabel("y [mm]")
    ax.set_title(_summary(design), fontsize="medium")
    return png(figure, dpi=110)


def _summary(design: Design) -> str:
    drive = design.drive
    profiles = [m.profile.kind for m in (design.flexspline, design.circular_spline)]
    kinds = " and ".join(dict.fromkeys(profiles))
    return (
        f"{drive.teeth_flexspline}/{drive.teeth_circular_spline} teeth, module"
        f" {drive.module_mm:.4g} mm, ratio {design.ratio:.4g}, {kinds} teeth,"
        f" {design.wave_generator.kind.replace('_', ' ')} wave generator"
    )


def _flank(profile: ToothProfile, count: int) -> Array:
    """Tooth on +y, from its clockwise to its counter-clockwise root (n, 2) [m]."""
    right, _, _ = profile.evaluate(np.linspace(0.0, profile.stations[-1], count))
    return np.concatenate([right[::-1], right[1:] * np.array([-1.0, 1.0])])


def _flexspline(design: Design, theta: Array) -> tuple[Array, Array]:
    """Points (n, 2) [m] and rotations (n,) [rad] of the neutral line at rim angles.

    The angles count counter-clockwise from the +y axis [rad].
    """
    bore = 2.0 * np.pi * design.flexspline_inner_radius
    if abs(wave_generator(design).perimeter / bore - 1.0) < _FOLLOWS:
        pose = neutral_line(design).pose(theta)
        return pose.point, pose.angle
    # inextensible ring: w = w0 cos(n t), v = -w0/n sin(n t), rotation t + (v - w')/r
    n, w0 = design.lobes, lobe_height(design)
    r = design.flexspline_inner_radius + 0.5 * design.flexspline.rim_mm * mm
    w, v = w0 * np.cos(n * theta), -w0 / n * np.sin(n * theta)
    radial = np.stack([-np.sin(theta), np.cos(theta)], axis=-1)
    along = np.stack([-np.cos(theta), -np.sin(theta)], axis=-1)
    point = (r + w)[:, None] * radial + v[:, None] * along
    return point, theta + (v + n * w0 * np.sin(n * theta)) / r


def _teeth(design: Design, theta: Array, count: int) -> Array:
    """Outlines of the flexspline teeth at rim angles theta (n, n_points, 2) [m]."""
    tooth = _flank(tooth_profile(design, "flexspline"), count)
    r = design.flexspline_inner_radius + 0.5 * design.flexspline.rim_mm * mm
    point, angle = _flexspline(design, theta)
    return _turned(tooth - np.array([0.0, r]), angle) + point[:, None, :]


def _turned(points: Array, angle: Array) -> Array:
    """Points (n, 2) rotated counter-clockwise by every angle (k,), shape (k, n, 2)."""
    c, s = np.cos(angle)[:, None], np.sin(angle)[:, None]
    x, y = points.T
    return np.stack([c * x - s * y, s * x + c * y], axis=-1)


def _spaces(design: Design, which: Array, count: int) -> Array:
    """Outlines of circular-spline teeth (n, n_points, 2) [m].

    The tooth of a number is half a pitch counter-clockwise from the space of the same
    number; space 0 is on the +y axis.
    """
    tooth = _flank(tooth_profile(design, "circular_spline"), count)
    pitch = 2.0 * np.pi / design.drive.teeth_circular_spline
    return _turned(tooth, (which + 0.5) * pitch)


def _mesh(ax: Any, design: Design) -> None:
    """Draw the teeth of both members near the lobe, the bore and the wave generator."""
    pitch = 2.0 * np.pi / design.drive.teeth_flexspline
    which = np.arange(-5.0, 6.0)
    teeth = np.concatenate(_teeth(design, pitch * which, 160)) / mm
    ring = np.concatenate(_spaces(design, np.arange(-6.0, 6.0), 160)) / mm
    top = float(ring[:, 1].max()) + 0.5 * design.drive.module_mm
    ax.fill(
        np.append(ring[:, 0], [ring[-1, 0], ring[0, 0]]),
        np.append(ring[:, 1], [top, top]),
        color=_CIRCULAR_SPLINE,
        alpha=0.35,
        lw=0,
    )
    ax.plot(*ring.T, color=_CIRCULAR_SPLINE, lw=1.0, label="circular spline")
    rim = design.flexspline.rim_mm * mm
    angles = np.linspace(which[0] - 0.5, which[-1] + 0.5, 200) * pitch
    point, turn = _flexspline(design, angles)
    inward = np.stack([np.sin(turn), -np.cos(turn)], axis=-1)
    bore = (point + 0.5 * rim * inward) / mm
    ax.fill(*np.concatenate([teeth, bore[::-1]]).T, color=_FLEXSPLINE, alpha=0.35, lw=0)
    ax.plot(*teeth.T, color=_FLEXSPLINE, lw=1.0, label="flexspline")
    ax.plot(*bore.T, color=_FLEXSPLINE, lw=0.8)
    for index, curve in enumerate(wave_generator(design).outlines(4001)):
        label = "wave generator" if index == 0 else None
        ax.plot(*(curve / mm).T, color=_WAVE_GENERATOR, lw=1.2, label=label)
    # hide the outer halves of the last teeth
    half = 4.4 * np.pi * design.drive.module_mm
    ax.set_xlim(-half, half)
    ax.set_ylim(float(bore[:, 1].min()) - 1.2 * design.drive.module_mm, top)
    ax.set_title("teeth at the lobe")
    ax.legend(loc="lower center", fontsize=8, ncols=3)


def _exaggerated(ax: Any, design: Design) -> None:
    """Draw wave generator and bore with a magnified deflection."""
    bore, w0 = design.flexspline_inner_radius, lobe_height(design)
    factor = max(1.0, round(0.2 * bore / w0))
    turn = np.linspace(0.0, 2.0 * np.pi, 721)
    circle = bore / mm * np.stack([-np.sin(turn), np.cos(turn)], axis=-1)
    ax.plot(*circle.T, color="0.6", lw=0.9, ls="--", label="undeformed bore")
    for index, curve in enumerate(wave_generator(design).outlines(2881)):
        r = np.hypot(*curve.T)
        stretched = bore + factor * (r - bore)
        # hide points far inside the bore
        stretched[stretched < 0.25 * bore] = np.nan
        label = "wave generator" if index == 0 else None
        shown = curve * (stretched / r)[:, None] / mm
        ax.plot(*shown.T, color=_WAVE_GENERATOR, lw=1.6, label=label)
    point, angle = _flexspline(design, turn)
    inward = np.stack([np.sin(angle), -np.cos(angle)], axis=-1)
    line = point + 0.5 * design.flexspline.rim_mm * mm * inward
    r = np.hypot(*line.T)
    shown = line * ((bore + factor * (r - bore)) / r)[:, None] / mm
    ax.plot(*shown.T, color=_FLEXSPLINE, lw=0.9, label="bore of the flexspline")
    ax.set_title(f"distances from the undeformed bore, magnified {factor:g} times")
    ax.legend(loc="center", fontsize=8)


def _whole(ax: Any, design: Design) -> None:
    """Draw all teeth of both members and the wave generator to scale."""
    drive = design.drive
    count, circular_spline_teeth = drive.teeth_flexspline, drive.teeth_circular_spline
    theta = 2.0 * np.pi * np.arange(count) / count
    teeth = np.concatenate(_teeth(design, theta, 14)) / mm
    ring = np.concatenate(_spaces(design, np.arange(float(circular_spline_teeth)), 14))
    ax.plot(*_closed(ring / mm).T, color=_CIRCULAR_SPLINE, lw=0.5)
    ax.plot(*_closed(teeth).T, color=_FLEXSPLINE, lw=0.5)
    for curve in wave_generator(design).outlines(1441):
        ax.fill(*(curve / mm).T, color=_WAVE_GENERATOR, alpha=0.3, lw=0)
        ax.plot(*(curve / mm).T, color=_WAVE_GENERATOR, lw=0.9)
    rim = (
        tooth_profile(design, "circular_spline").dedendum_radius / mm
        + design.circular_spline.rim_mm
    )
    turn = np.linspace(0.0, 2.0 * np.pi, 361)
    ax.plot(rim * np.cos(turn), rim * np.sin(turn), color=_CIRCULAR_SPLINE, lw=0.9)
    ax.set_title("whole drive, rigid teeth")


def _closed(points: Array) -> Array:
    return np.concatenate([points, points[:1]])
