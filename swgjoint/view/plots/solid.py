"""Pictures of a 3D simulation of meshing: contact patterns and sections."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from swgjoint.pictures import png
from swgjoint.typing import Array
from swgjoint.units import deg, mm

if TYPE_CHECKING:
    from swgjoint.fe.solid.meshing import SolidRun
    from swgjoint.fe.solid.sector_model import SolidSectorModel
    from swgjoint.fe.solid.state import SolidState


SHOWN = 0.2
"""Largest drawn deflection, relative to the size of the section [-]."""
STATES = {
    "wave_generator": "wave generator alone",
    "meshed": "meshed",
    "torque": "torque",
}
"""Labels of the set-up states in the legend."""


def solid_pictures(run: SolidRun) -> dict[str, bytes]:
    """PNG files by name: sections of the loaded cup, its coning, and contact forces.

    The contact forces are those of the last solved position; without one they are
    missing.
    """
    pictures = {
        "cup_section": section_picture(run, run.setup[-1].state),
        "coning": coning_picture(run),
    }
    if run.states:
        pictures["contact_pattern"] = contact_picture(run, run.states[-1])
    return pictures


def contact_picture(run: SolidRun, state: SolidState) -> bytes:
    """Draw the contact forces over the face width and the angle from the lobe as PNG.

    Args:
        run: The simulation.
        state: Equilibrium to draw.
    """
    from matplotlib.figure import Figure

    figure = Figure(figsize=(11.0, 6.5), layout="constrained")
    above, below = figure.subplots(2, 1)
    z = run.model.strip.mesh.teeth.z / mm
    angle, flanks, bore = contact_forces(run.model, state)
    width = float(np.median(np.diff(np.sort(angle)))) / deg
    for ax, force, title in (
        (above, flanks, "force of the circular spline [N per axial plane and tooth]"),
        (below, bore, "force of the wave generator [N per axial plane and tooth]"),
    ):
        order = np.argsort(angle)
        edges = np.append(angle[order] / deg - 0.5 * width, angle[order[-1]] / deg)
        lines = np.concatenate([[z[0]], 0.5 * (z[1:] + z[:-1]), [z[-1]]])
        shown = np.ma.masked_less_equal(force[order].T, 0.0)
        mesh = ax.pcolormesh(edges, lines, shown, cmap="viridis")
        figure.colorbar(mesh, ax=ax)
        ax.set(title=title, xlabel="angle of the tooth from the lobe [deg]")
        ax.set_ylabel("z [mm], open end below")
        ax.set_facecolor("0.95")
    return _png(figure)


def contact_forces(
    model: SolidSectorModel, state: SolidState
) -> tuple[Array, Array, Array]:
    """Contact forces over the face width, tooth by tooth.

    Args:
        model: The 3D model.
        state: The equilibrium.

    Returns:
        Angles of the teeth from the closer of two lobes (N,) [rad]; forces of the
        circular spline, with the magnitudes of both flanks added, and forces of the
        wave generator, both (N, n_planes) [N].
    """
    sectors, planes = model.sectors, model.strip.planes
    x = model.masters(state).mean(axis=1)
    angle = np.arctan2(-x[:, 0], x[:, 1]) - state.wave_generator_angle
    angle = np.remainder(angle + 0.5 * np.pi, np.pi) - 0.5 * np.pi
    teeth, first = model.strip.teeth, model.strip.flank_dofs
    nodal = teeth.nodal_force(model.loads(state))
    by_side = nodal[:, :first].reshape(sectors, planes, 2, -1, 3).sum(axis=3)
    flanks = np.linalg.norm(by_side, axis=3).sum(axis=2)
    bore = np.linalg.norm(nodal[:, first:].reshape(sectors, planes, -1, 3), axis=3)
    return angle, flanks, bore.sum(axis=2)


def section_picture(run: SolidRun, state: SolidState) -> bytes:
    """Draw axial sections of the cup at the major and minor axis as PNG.

    Each section is shown at rest and with a magnified deflection.

    Args:
        run: The simulation.
        state: Equilibrium to draw.
    """
    from matplotlib.collections import LineCollection, PolyCollection
    from matplotlib.figure import Figure

    from swgjoint.fe.solid.figures.axial_section import axial_sections, axis_sectors

    figure = Figure(figsize=(11.0, 6.0), layout="constrained")
    axes = figure.subplots(1, 2, sharex=True, sharey=True)
    both = [axial_sections(run.model, state, k) for k in axis_sectors(run.model, state)]
    rest, moved = (
        np.concatenate([getattr(part, name) for parts in both for part in parts])
        for name in ("rest", "moved")
    )
    most, size = float(np.abs(moved - rest).max()), float(np.ptp(rest, axis=0).max())
    larger = magnification(most, size)
    for ax, title, parts in zip(axes, ("major", "minor"), both, strict=True):
        for part in parts:
            drawn = part.rest + larger * (part.moved - part.rest)
            mesh = PolyCollection(
                list(drawn[part.cells] / mm),
                facecolor="lightsteelblue",
                edgecolor="tab:blue",
                linewidth=0.3,
            )
            ax.add_collection(mesh)
            still = part.rest[outline(part.cells)] / mm
            ax.add_collection(LineCollection(list(still), colors="k", linewidths=0.6))
        ax.autoscale()
        ax.set_title(f"{title} axis: deflection × {larger:g} (black: at rest)")
        ax.set_xlabel("z [mm], open end on the left")
        ax.set_aspect("equal")
        ax.grid(alpha=0.3)
    axes[0].set_ylabel("radius [mm]")
    return _png(figure)


def magnification(most: float, size: float) -> float:
    """Magnification of a deflection in a picture: 1, 2 or 5 times a power of ten.

    Args:
        most: Largest deflection [m].
        size: Size of the drawn object [m].

    Returns:
        Largest such factor for which the drawn deflection is at most :data:`SHOWN`
        times the size [-].
    """
    wanted = SHOWN * size / max(most, 1e-12)
    power = 10.0 ** np.floor(np.log10(wanted))
    return float(power * max(k for k in (1.0, 2.0, 5.0) if k * power <= wanted))


def outline(cells: NDArray[np.int64]) -> NDArray[np.int64]:
    """Edges that belong to a single quadrilateral, as pairs of point numbers (n, 2)."""
    edges = np.stack([cells, np.roll(cells, -1, axis=1)], axis=-1).reshape(-1, 2)
    unique, count = np.unique(np.sort(edges, axis=1), axis=0, return_counts=True)
    return np.asarray(unique[count == 1])


def coning_picture(run: SolidRun) -> bytes:
    """Draw the radial displacement of the bore over the face width as PNG.

    Each line is a state of the set-up: wave generator inserted, meshed, loaded.
    """
    from matplotlib.figure import Figure

    from swgjoint.fe.solid.figures.axial_section import coning

    figure = Figure(figsize=(10.0, 4.2), layout="constrained")
    axes = figure.subplots(1, 2)
    lines = dict(zip(STATES, ("--", ":", "-"), strict=True))
    for state in run.setup:
        displacement = coning(run.model, state.state)
        label = STATES[state.name]
        if state.name == "torque":
            label = f"{run.torque:g} N·m"
        z, radials = displacement.z, (displacement.major, displacement.minor)
        for ax, radial in zip(axes, radials, strict=True):
            ax.plot(z / mm, radial / mm, lines[state.name], lw=1.5, label=label)
    for ax, title in zip(axes, ("major", "minor"), strict=True):
        ax.set_title(f"{title} axis: radial displacement of the bore")
        ax.set_xlabel("z [mm], open end on the left")
        ax.grid(alpha=0.3)
    axes[0].set_ylabel("outward displacement [mm]")
    axes[0].legend()
    return _png(figure)


def _png(figure: Any) -> bytes:
    return png(figure, dpi=110)
