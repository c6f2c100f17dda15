"""Torsion, kinematic error, ripple and stress of a drive from a few 2D equilibria.

A map answers the same questions for all torques and angles, validates its answer and
takes minutes. This look takes seconds: one torsion curve at one input position, and one
tooth pitch at a few positions without load and at rated torque.
"""

from __future__ import annotations

import time
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from swgjoint.errors import ComputationError
from swgjoint.fe.meshing import simulate_meshing
from swgjoint.fe.meshing_run import MeshingRun
from swgjoint.fe.plane.continuation import Continuation
from swgjoint.fe.plane.drive2d import sector_model, unmodelled_parts
from swgjoint.fe.plane.stress import KINDS
from swgjoint.fe.tolerances.lot import perfect_positions, sample_lot
from swgjoint.gear.catalogue import ratings_of
from swgjoint.gear.design.design import Design
from swgjoint.gear.design.tolerances import has_errors, without_errors
from swgjoint.gear.mounting import series_compliance
from swgjoint.maps.sheet.sampled_accuracy import fit_orders
from swgjoint.progress import Progress, silent
from swgjoint.typing import Array
from swgjoint.units import arcmin

POSITIONS = 8
"""Number of input positions over one tooth pitch; half of it is the largest number of
orders."""
PARTS = (0.05, 0.2, 0.35, 0.5, 0.75, 1.0)
"""Torques of the torsion curve, as fractions of the repeated peak torque [-]; T1, T2
and the rated torque are added."""
MOST_ORDERS = 6
"""Largest number of orders that are kept, strongest first."""
COARSE = 0.5
"""Mesh refinement of the look [-]."""


@dataclass(frozen=True, kw_only=True, eq=False)
class QuickLook:
    """Results of a few 2D equilibria of one drive."""

    name: str
    """Name of the drive."""
    rated: float
    """Rated torque [N·m]."""
    torque: Array
    """Output torques of the torsion curve, increasing from zero (n,) [N·m]."""
    torsion: Array
    """Torsion at these torques, input locked (n,) [rad]."""
    angle: Array
    """Input angles of the errors, increasing (m,) [rad]."""
    errors: Mapping[str, Array]
    """Kinematic error ``no_load`` and transmission error ``rated`` (m,) [rad]."""
    orders: Mapping[str, Mapping[float, float]]
    """Amplitude [rad] by order [cycles per input turn], for both errors."""
    stress_angle: Array
    """Input angles of the stresses (k,) [rad]."""
    stress: Mapping[str, Array]
    """Largest stresses in the flexspline at rated torque, by kind (k,) [Pa]."""
    pairs: Array
    """Number of loaded tooth pairs at rated torque, whole drive (k,)."""
    figures: Mapping[str, float]
    """Figures by key, in the unit of the key."""
    left_out: str | None
    """Parts of the design that the look leaves out; None if there are none."""
    superposed: bool
    """Whether the errors are those of a whole output turn, superposed on the linearised
    drive with a rigid wave generator, rather than one tooth pitch."""
    wall_s: float
    """Wall-clock time [s]."""


def take_quick_look(design: Design, *, progress: Progress = silent) -> QuickLook:
    """Solve a few equilibria of a coarse 2D model without tooth friction.

    With manufacturing errors, the errors of a whole output turn are superposed on the
    linearised drive with a rigid wave generator, see
    :func:`swgjoint.fe.tolerances.lot.sample_lot`; torsion and stress are those of the
    drive without errors.

    Args:
        design: The drive; its refinement is replaced by :data:`COARSE`.
        progress: Called with the stage, the number of finished stages and their total.

    Raises:
        DesignError: If the design cannot be built.
        ComputationError: If an equilibrium is not found.
    """
    begin = time.perf_counter()
    coarse = design.with_changes({"mesh.refinement": COARSE})
    perfect = without_errors(coarse).with_changes({"friction.tooth_coefficient": 0.0})
    ratings = ratings_of(design)
    progress("torsion curve", 0, 3)
    torque, torsion = torsion_curve(perfect, _torques(design))
    progress("stress at rated torque", 1, 3)
    loaded = _pitch(perfect, ratings.rated_torque)
    progress("kinematic error", 2, 3)
    if has_errors(coarse):
        rests = perfect_positions(perfect)
        lot = sample_lot([coarse.with_changes({"friction": {}})], rests)
        angle = lot.input_angle
        errors = {"no_load": lot.unloaded[0], "rated": lot.loaded[0]}
        if not all(np.isfinite(error).all() for error in errors.values()):
            raise ComputationError(
                f"{design.drive.name}: no equilibrium with the manufacturing errors"
            )
        orders = {key: fit_orders(angle, e, design) for key, e in errors.items()}
        slope = 1.0 / lot.compliance[0]
    else:
        angle = loaded.series("input_angle")
        free = _pitch(perfect, 0.0)
        errors = {
            key: run.series("output_error")
            for key, run in (("no_load", free), ("rated", loaded))
        }
        orders = {key: _harmonics(e, design) for key, e in errors.items()}
        slope = _slope(torque, torsion, ratings.rated_torque)
    progress("kinematic error", 3, 3)
    kept = {key: _strongest(o) for key, o in orders.items()}
    stress = {
        kind: np.array([getattr(s.stress.flexspline, kind) for s in loaded.steps])  # type: ignore[union-attr]
        for kind in KINDS
    }
    return QuickLook(
        name=design.drive.name,
        rated=ratings.rated_torque,
        torque=torque,
        torsion=torsion,
        angle=angle,
        errors=errors,
        orders=kept,
        stress_angle=loaded.series("input_angle"),
        stress=stress,
        pairs=loaded.series("pairs_in_contact"),
        figures=_figures(design, torque, torsion, errors, slope, stress),
        left_out=unmodelled_parts(design),
        superposed=has_errors(coarse),
        wall_s=time.perf_counter() - begin,
    )


def torsion_curve(design: Design, torques: Array) -> tuple[Array, Array]:
    """Torsion over output torque with the input locked, for increasing torque.

    Args:
        design: The drive; its errors are ignored.
        torques: Positive torques, increasing (n,) [N·m].

    Returns:
        Torques (n + 1,) [N·m] and torsions (n + 1,) [rad], both starting at zero. If
        clearance leaves the unloaded output free, the curve starts in the middle of it.

    Raises:
        ComputationError: If an equilibrium is not found.
    """
    model = sector_model(without_errors(design), half="auto", friction=False)
    follow = Continuation(model=model, ratio=design.ratio, layout=design.drive.layout)
    state = follow.engage(follow.deflect())
    if state.outcome.ok:
        small = 0.01 * ratings_of(design).rated_torque
        state = follow.unload(state, small).state
    angles, series = [], series_compliance(design, cup=True)
    for torque in (0.0, *torques.tolist()):
        state = follow.to_torque(state, torque) if torque else state
        if not state.outcome.ok:
            raise ComputationError(
                f"{design.drive.name}: no equilibrium at {torque:.4g} N·m:"
                f" {state.outcome.value}"
            )
        angles.append(follow.output_angle(state) - series * torque)
    # a positive torque of the drive on the output means that the load turns it back
    return np.array([0.0, *torques]), angles[0] - np.array(angles)


def _torques(design: Design) -> Array:
    """Torques of the torsion curve, increasing [N·m]."""
    r = ratings_of(design)
    at = [part * r.repeated_peak for part in PARTS]
    return np.unique([t for t in (*at, r.T1, r.T2, r.rated_torque) if t > 0.0])


def _pitch(design: Design, torque: float) -> MeshingRun:
    """Meshing over one pitch, without its end."""
    run = simulate_meshing(
        design,
        torque=torque,
        steps=POSITIONS,
        turn=1.0 / design.periodicity,
        half="auto",
    )
    assert isinstance(run, MeshingRun)
    return run


def _harmonics(error: Array, design: Design) -> dict[float, float]:
    """Amplitudes [rad] of the multiples of the tooth passage in one pitch, by order."""
    lines = 2.0 * np.abs(np.fft.rfft(error)) / error.size
    lines[-1] *= 0.5  # the highest one is a cosine without a sine
    return {
        float(k * design.periodicity): float(lines[k]) for k in range(1, lines.size)
    }


def _strongest(orders: Mapping[float, float]) -> dict[float, float]:
    ranked = sorted(orders.items(), key=lambda item: -item[1])
    return dict(ranked[:MOST_ORDERS])


def _slope(torque: Array, torsion: Array, at: float) -> float:
    """Stiffness at a torque of the curve, between its neighbours [N·m/rad]."""
    k = int(np.searchsorted(torque, at))
    low, high = max(k - 1, 0), min(k + 1, torque.size - 1)
    return float((torque[high] - torque[low]) / (torsion[high] - torsion[low]))


def _figures(
    design: Design,
    torque: Array,
    torsion: Array,
    errors: Mapping[str, Array],
    slope: Array | float,
    stress: Mapping[str, Array],
) -> dict[str, float]:
    """Figures of the look under the keys of a spec sheet where it has them."""
    r = ratings_of(design)
    ends = (0.0, r.T1, r.T2, r.repeated_peak)
    at = np.interp(ends, torque, torsion)
    K1, K2, K3 = np.diff(ends) / np.diff(at)
    # torque ripple of an output that is held to its ideal motion
    ripple = 100.0 * slope * (errors["rated"] - errors["rated"].mean()) / r.rated_torque
    return {
        "K1_Nm_rad": float(K1),
        "K2_Nm_rad": float(K2),
        "K3_Nm_rad": float(K3),
        "torsion_arcmin": float(np.interp(r.rated_torque, torque, torsion)) / arcmin,
        "kinematic_error_arcmin": float(np.ptp(errors["no_load"])) / arcmin,
        "transmission_error_arcmin": float(np.ptp(errors["rated"])) / arcmin,
        "ripple_pp_percent": float(np.ptp(ripple)),
        "ripple_rms_percent": float(np.sqrt(np.mean(ripple**2))),
        **{f"{kind}_MPa": float(np.abs(s).max()) / 1e6 for kind, s in stress.items()},
    }
