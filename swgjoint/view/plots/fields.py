"""Pictures of the fields of a 2D simulation of meshing."""

from __future__ import annotations

from collections.abc import Sequence
from math import pi
from typing import TYPE_CHECKING, Any

import numpy as np

from swgjoint.fe.plane.corotation import rotate
from swgjoint.fe.plane.fields import (
    MemberField,
    circular_spline_field,
    flexspline_field,
    root_stress,
    tooth_angles,
    tooth_forces,
    wave_generator_contact,
)
from swgjoint.pictures import png
from swgjoint.units import deg, mm

if TYPE_CHECKING:
    from swgjoint.fe.meshing_run import MeshingRun
    from swgjoint.fe.plane.state import State


KINDS = ("tensile", "|compressive|", "von Mises")
SHOWN_TEETH = 6.0
"""Number of tooth pitches drawn on either side of an axis."""
LEVELS = 12
"""Number of contour bands."""
PALE = (0.9, 0.92, 0.97, 1.0)
"""Colour of the lowest band."""
SNAPSHOTS = 4
"""Largest number of wave-generator positions that are drawn individually."""
MPa, N_mm = 1e6, 1e3


def field_pictures(run: MeshingRun) -> dict[str, bytes]:
    """PNG files by name: stress contours, tooth forces, root stress, contact arcs.

    The contours are those of the last solved position. The result is empty if no
    position was solved.
    """
    states = run.states
    if not states:
        return {}
    return {
        "contours": contour_picture(run, states[-1]),
        "tooth_forces": tooth_force_picture(run, states),
        "root_stress": root_stress_picture(run, states),
        "contact_arcs": contact_arc_picture(run, states),
    }


def contour_picture(run: MeshingRun, state: State) -> bytes:
    """Draw the stresses of both members near a lobe and near the minor axis as PNG.

    Every row shows one kind of stress with a common scale. The wave generator is grey;
    arrows show the forces of the circular spline on the flexspline.

    Args:
        run: The simulation.
        state: Equilibrium to draw.
    """
    figure = _figure(14.0, 6.9)
    axes = figure.subplots(3, 2)
    model = run.model
    members = [flexspline_field(model, state)]
    ring = circular_spline_field(model, state)
    members += [] if ring is None else [ring]
    half_width = SHOWN_TEETH * 2.0 * pi / model.element.sectors
    places = {"a lobe": 0.0, "the minor axis": pi / run.design.lobes}
    for row, kind in enumerate(KINDS):
        top = float(members[0].maxima[row].max()) / MPa
        levels = np.linspace(0.0, top, LEVELS + 1)
        for column, (name, place) in enumerate(places.items()):
            ax = axes[row, column]
            turn = -(state.wave_generator_angle + place)
            for member in members:
                shades = _contour(ax, member, row, turn, half_width, levels)
            for outline in model.wave_generator.outlines(2000):
                ax.fill(*(rotate(outline, -place) / mm).T, color="0.85", zorder=-1)
            _force_arrows(ax, run, state, turn, half_width)
            _frame(ax, run, half_width)
            ax.set_title(f"{kind} stress near {name}", fontsize="medium")
        figure.colorbar(
            shades, ax=axes[row], label="stress [MPa]", pad=0.01, format="%.0f"
        )
    figure.suptitle(_title(run, state), fontsize="medium")
    return _png(figure)


def _contour(
    ax: Any, member: MemberField, row: int, turn: float, half_width: float, levels: Any
) -> Any:
    """Draw filled contours of the sectors that a rotation [rad] brings near +y."""
    from matplotlib import colormaps

    points = rotate(member.points, turn)
    centre = points.mean(axis=1)
    polar = np.arctan2(-centre[:, 0], centre[:, 1])
    pitch = 2.0 * pi / len(points)
    near = np.flatnonzero(np.abs(polar) < half_width + 2.0 * pitch)
    x, y = (points[near] / mm).reshape(-1, 2).T
    a, b, c, d = member.quads
    triangles = np.concatenate([[a, b, c], [a, c, d]], axis=1).T
    nodes = points.shape[1]
    cells = (triangles + nodes * np.arange(len(near))[:, None, None]).reshape(-1, 3)
    ax.plot(*(points[near][:, member.outline] / mm).T, "k", lw=0.6)
    values = np.clip(member.maxima[row][near].ravel() / MPa, levels[0], levels[-1])
    # the lowest band is pale, so that single teeth remain distinguishable
    colours = [PALE, *colormaps["turbo"](np.linspace(0.1, 1.0, len(levels) - 2))]
    return ax.tricontourf(x, y, cells, values, levels=levels, colors=colours)


def _force_arrows(
    ax: Any, run: MeshingRun, state: State, turn: float, half_width: float
) -> None:
    """Draw the tooth forces on the flexspline as arrows that end at their points."""
    contacts, model = state.contacts, run.model
    if contacts is None or not len(contacts):
        return
    angle = model.frames(state).angle[contacts.sector]
    for copy in range(model.copies):
        whole = angle + turn + 2.0 * pi * copy / model.copies
        points = rotate(contacts.point, whole) / mm
        push = rotate(contacts.normal, whole) * state.tooth_force[:, None]
        polar = np.arctan2(-points[:, 0], points[:, 1])
        near = np.abs(polar) < half_width
        scale = float(state.tooth_force.max()) / (1.5 * run.design.drive.module_mm)
        ax.quiver(
            *(points - push / scale)[near].T,
            *(push / scale)[near].T,
            angles="xy",
            scale_units="xy",
            scale=1.0,
            width=0.004,
            color="w",
            edgecolor="k",
            linewidth=0.6,
        )


def _frame(ax: Any, run: MeshingRun, half_width: float) -> None:
    profile = run.model.circular_spline.profile
    bore = float(np.hypot(*run.model.element.skeleton.T).min()) / mm
    depth = run.design.drive.module_mm
    top = profile.dedendum_radius / mm + depth
    x = bore * np.sin(half_width)
    ax.set_xlim(-x, x)
    ax.set_ylim(bore * np.cos(half_width) - 1.5 * depth, top + depth)
    ax.set_aspect("equal")
    ax.set_facecolor("white")
    ax.set_ylabel("y [mm]")


def tooth_force_picture(run: MeshingRun, states: Sequence[State]) -> bytes:
    """Draw the flank forces at selected positions, and at all of them, as PNG.

    Args:
        run: The simulation.
        states: Its equilibria.
    """
    model, pitch = run.model, 2.0 * pi / run.model.element.sectors
    angles = np.array([tooth_angles(model, state) for state in states])
    forces = np.array([tooth_forces(model, state) for state in states])
    # position of the tooth from its closest lobe in tooth pitches
    window = 2.0 * pi / run.design.lobes
    place = ((angles + 0.5 * window) % window - 0.5 * window) / pitch
    chosen = np.unique(np.linspace(0, len(states) - 1, SNAPSHOTS).astype(int))
    figure = _figure(12.0, 6.0)
    grid = figure.add_gridspec(len(chosen), 2, width_ratios=(1, 1.4))
    loaded = forces.any(axis=2)
    reach = np.abs(place[loaded]).max() + 1.5 if loaded.any() else 5.0
    top = 1.1 * max(float(forces.max()), 1e-3)
    for row, k in enumerate(chosen):
        ax = figure.add_subplot(grid[row, 0])
        lobe = np.abs(angles[k]) < 0.5 * window
        for side, colour in enumerate(("tab:blue", "tab:red")):
            shift = 0.18 * (1 - 2 * side)
            ax.bar(place[k][lobe] - shift, forces[k][lobe, side], 0.35, color=colour)
        ax.set_xlim(reach, -reach)
        ax.set_ylim(0.0, top)
        ax.grid(alpha=0.3)
        at = states[k].wave_generator_angle / deg
        ax.text(0.02, 0.8, f"{at:.4g} deg", transform=ax.transAxes, fontsize="small")
        ax.set_ylabel("force [N]")
    ax.set_xlabel("position from the first lobe [pitches], counter-clockwise positive")
    whole = figure.add_subplot(grid[:, 1])
    for side, (name, colour) in enumerate(
        (("right (clockwise) flank", "tab:blue"), ("left flank", "tab:red"))
    ):
        touched = forces[..., side] > 0.0
        whole.plot(
            place[touched], forces[..., side][touched], ".", color=colour, label=name
        )
    whole.set_xlim(reach, -reach)
    whole.set_ylim(0.0, top)
    whole.grid(alpha=0.3)
    whole.legend(fontsize="small")
    whole.set_title("all positions, all lobes", fontsize="medium")
    whole.set_xlabel(
        "position from the closest lobe [pitches], counter-clockwise positive"
    )
    whole.set_ylabel("normal force on a flank [N]")
    figure.suptitle(_title(run, None), fontsize="medium")
    return _png(figure)


def root_stress_picture(run: MeshingRun, states: Sequence[State]) -> bytes:
    """Draw the tooth-root stress over the lobe angle as PNG (thesis fig. 4.19, 4.20).

    Args:
        run: The simulation.
        states: Its equilibria.
    """
    root = root_stress(run.model, states, run.design.lobes)
    figure = _figure(9.0, 7.0)
    axes = figure.subplots(2, 1, sharex=True)
    one = np.argsort(root.lobe_position[:, root.tooth])
    every = np.argsort(root.lobe_position.ravel())
    lines = (
        (axes[0], root.tensile, "tensile", "tab:green"),
        (axes[0], root.compressive, "|compressive|", "tab:blue"),
        (axes[1], root.von_mises, "von Mises", "0.2"),
    )
    for ax, values, name, colour in lines:
        ax.plot(
            root.lobe_position.ravel()[every] / deg,
            values.ravel()[every] / MPa,
            ".",
            ms=1.5,
            color=colour,
        )
        ax.plot(
            root.lobe_position[one, root.tooth] / deg,
            values[one, root.tooth] / MPa,
            ".-",
            color=colour,
            label=f"{name}, tooth {root.tooth}",
        )
    for ax in axes:
        ax.grid(alpha=0.3)
        ax.legend(fontsize="small")
        ax.set_ylabel("stress at the tooth root [MPa]")
        ax.set_ylim(bottom=0.0)
    axes[1].set_xlabel(
        "angle from the tooth root to the lobe [deg], negative before the lobe passes"
        " (small dots: all teeth)"
    )
    figure.suptitle(_title(run, None), fontsize="medium")
    return _png(figure)


def contact_arc_picture(run: MeshingRun, states: Sequence[State]) -> bytes:
    """Draw the load of the wave generator on the bore and its contact arcs as PNG.

    The load is drawn along the bore at selected positions. The contact arcs are those
    of the first lobe, at all positions.

    Args:
        run: The simulation.
        states: Its equilibria.
    """
    lobes = run.design.lobes
    contacts = [wave_generator_contact(run.model, state, lobes) for state in states]
    figure = _figure(10.0, 7.0)
    load, arcs = figure.subplots(2, 1)
    chosen = np.unique(np.linspace(0, len(states) - 1, SNAPSHOTS).astype(int))
    for k in chosen:
        at = states[k].wave_generator_angle / deg
        load.plot(
            contacts[k].angle / deg,
            contacts[k].line_load / N_mm,
            lw=1.0,
            label=f"{at:.4g} deg",
        )
    load.set_xlim(-180.0, 180.0)
    load.set_xticks(range(-180, 181, 45))
    load.set_ylim(bottom=0.0)
    load.set_xlabel("angle along the bore from the first lobe [deg]")
    load.set_ylabel("wave-generator load [N/mm],\naveraged over two tooth pitches")
    load.legend(fontsize="small", title="wave generator at", ncols=2)
    for state, contact in zip(states, contacts, strict=True):
        for low, high in contact.arcs[0]:
            arcs.plot(
                [state.wave_generator_angle / deg] * 2,
                [low / deg, high / deg],
                "-",
                color="tab:blue",
                lw=2.0,
                solid_capstyle="butt",
                marker="_",
            )
    arcs.set_ylim(-180.0 / lobes, 180.0 / lobes)
    arcs.set_xlabel("wave-generator angle [deg]")
    arcs.set_ylabel("contact arcs from\nthe first lobe [deg]")
    for ax in (load, arcs):
        ax.grid(alpha=0.3)
    figure.suptitle(_title(run, None), fontsize="medium")
    return _png(figure)


def _figure(width: float, height: float) -> Any:
    from matplotlib.figure import Figure

    return Figure(figsize=(width, height), layout="constrained")


def _title(run: MeshingRun, state: State | None) -> str:
    """Drive, load, direction of the power flow, and position of a single state."""
    turn = run.steps[-1].input_angle - run.steps[0].input_angle
    power = run.torque / run.design.ratio * turn
    flow = ""
    if power:
        flow = ", input drives" if power > 0.0 else ", output back-drives the input"
    at = ""
    if state is not None:
        at = f", wave generator at {state.wave_generator_angle / deg:.4g} deg"
    return f"{run.design.drive.name}: {run.torque:g} N·m at the output{flow}{at}"


def _png(figure: Any) -> bytes:
    return png(figure, dpi=110)
