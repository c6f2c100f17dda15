"""Pictures of a simulation of meshing in space: contact patterns and sections."""

from __future__ import annotations

import io
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from swgjoint.units import deg, mm, um

if TYPE_CHECKING:
    from swgjoint.fe.solid.meshing import SolidRun
    from swgjoint.fe.solid.ring import SolidRing
    from swgjoint.fe.solid.state import SolidState

Array = NDArray[np.float64]

LARGER = 10.0
"""Factor of the drawn deflection of the cup."""


def solid_pictures(run: SolidRun) -> dict[str, bytes]:
    """PNG by name: contact patterns and deflected sections of the last position."""
    if not run.states:
        return {}
    state = run.states[-1]
    return {
        "contact_pattern": contact_picture(run, state),
        "cup_section": section_picture(run, state),
    }


def contact_picture(run: SolidRun, state: SolidState) -> bytes:
    """Where over the face width teeth and wave generator carry, over the lobe angle."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(11.0, 6.5), layout="constrained")
    above, below = figure.subplots(2, 1)
    z = run.model.strip.mesh.teeth.z / mm
    angle, flanks, bore = contact_forces(run.model, state)
    width = float(np.median(np.diff(np.sort(angle)))) / deg
    for ax, force, title in (
        (above, flanks, "force of the teeth of the circular spline [N per plane]"),
        (below, bore, "force of the wave generator [N per plane and tooth]"),
    ):
        order = np.argsort(angle)
        edges = np.append(angle[order] / deg - 0.5 * width, angle[order[-1]] / deg)
        lines = np.concatenate([[z[0]], 0.5 * (z[1:] + z[:-1]), [z[-1]]])
        shown = np.ma.masked_less_equal(force[order].T, 0.0)
        mesh = ax.pcolormesh(edges, lines, shown, cmap="viridis")
        figure.colorbar(mesh, ax=ax)
        ax.set(title=title, xlabel="tooth from the lobe [deg]")
        ax.set_ylabel("z [mm], open end below")
        ax.set_facecolor("0.95")
    return _png(figure)


def contact_forces(ring: SolidRing, state: SolidState) -> tuple[Array, Array, Array]:
    """Forces over the face width, tooth by tooth.

    Returns:
        Angle of every tooth of the model from the nearer of two lobes [rad] (N,);
        forces of the circular spline and of the wave generator (N, n_planes) [N].
    """
    sectors, planes = ring.sectors, ring.strip.planes
    x = ring.masters(state).mean(axis=1)
    angle = np.arctan2(-x[:, 0], x[:, 1]) - state.wave_generator_angle
    angle = np.remainder(angle + 0.5 * np.pi, np.pi) - 0.5 * np.pi
    flanks = np.zeros((sectors, planes))
    if state.held is not None:
        sector = state.held.contacts.sector
        np.add.at(flanks, (sector, state.held.plane), state.tooth_force)
    bore = state.pressure.reshape(sectors, planes, -1).sum(axis=2)
    return angle, flanks, bore


def section_picture(run: SolidRun, state: SolidState) -> bytes:
    """The cup along its major and its minor axis, deflection enlarged."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(10.0, 4.6), layout="constrained")
    axes = figure.subplots(1, 2, sharey=True)
    angle, _, _ = contact_forces(run.model, state)
    for ax, title, sector in (
        (axes[0], "major axis", int(np.abs(angle).argmin())),
        (axes[1], "minor axis", int(np.abs(angle).argmax())),
    ):
        still, moved = _meridian(run.model, state, sector)
        for side in (0, 1):
            ax.plot(*(still[side].T / mm), "k--", lw=0.8)
            drawn = still[side] + LARGER * (moved[side] - still[side])
            ax.plot(*(drawn.T / mm), "tab:blue", lw=1.2)
        teeth = still[1, :7]
        lift = (moved[1, :7, 1] - teeth[:, 1]) / um
        ax.set_title(
            f"{title}: deflection x {LARGER:g}; bore {lift[0]:.0f} µm at the open end,"
            f" {np.interp(run.model.strip.mesh.teeth.z[-1], teeth[:, 0], lift):.0f}"
            " behind the teeth",
            fontsize="small",
        )
        ax.set_xlabel("z [mm]")
        ax.set_aspect("equal")
        ax.grid(alpha=0.3)
    axes[0].set_ylabel("radius [mm]")
    return _png(figure)


def _meridian(ring: SolidRing, state: SolidState, sector: int) -> tuple[Array, Array]:
    """Outside and bore side of a face, at rest and deflected (2, n, 2): z, r [m]."""
    from swgjoint.fe.solid.masters import face_lines

    found = []
    for x in (ring.reference[sector], ring.masters(state)[sector]):
        lines = face_lines(ring.strip.mesh, ring.strip.masters, x)
        found.append(
            np.stack([lines[..., 2], np.hypot(lines[..., 0], lines[..., 1])], -1)
        )
    return found[0], found[1]


def _png(figure: Any) -> bytes:
    out = io.BytesIO()
    figure.savefig(out, format="png", dpi=110)
    return out.getvalue()
