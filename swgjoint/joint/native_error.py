"""Difference between level ``native`` and level ``full`` of one drive.

Both levels are compared at the same motor angle and the same output torque, in slow
motion and within the torque range of the fit. The torsion loops of the mean curves
differ by the fit and by yield torques that depend on the load. The rest of the law of
level ``full`` has no native equivalent: the kinematic error and the ripple of the
torsion, and the reaction of the friction of the wave generator on the flexspline.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from swgjoint.joint.drive import JointDrive
from swgjoint.joint.native import native_map
from swgjoint.joint.step_damping import StepMode, step_mode
from swgjoint.maps.drive_map import DriveMap
from swgjoint.maps.sheet.loop import torque_loop
from swgjoint.maps.sheet.turn import measure_turns
from swgjoint.units import arcmin


@dataclass(frozen=True, kw_only=True)
class NativeError:
    """Difference of one drive at ``native`` from the same drive at ``full``."""

    torque: float
    """Torque up to which the levels are compared, of either sign [N·m]."""
    torsion: float
    """Largest difference of the torsion loops of the mean curves [rad]."""
    ripple: float
    """Peak to peak over one output turn of the transmission error that is left out: the
    kinematic error and the ripple of the torsion, at the worst of the compared torques
    [rad]."""
    link: float
    """Bound of the difference of the link angle at equal motor angle and output torque,
    in slow motion [rad]: torsion, ripple about its mean, and friction reaction."""
    torque_ripple: float
    """Peak to peak of the output torque that is left out, with motor and link moving at
    constant ratio under rated torque [N·m]."""
    native: StepMode | None
    """Torsional vibration at ``native`` without load, at the time step; None if there
    is no vibration."""
    full: StepMode | None
    """The same at ``full``."""

    def as_json(self, drive: JointDrive) -> dict[str, Any]:
        """Values under the keys of ``swgjoint export mjcf --json``.

        Args:
            drive: The drive that was compared.
        """
        return {
            "drive": drive.drive.name,
            "ratio": drive.ratio,
            "rotor_inertia_kgm2": drive.rotor_inertia,
            "up_to_Nm": self.torque,
            "torsion_arcmin": self.torsion / arcmin,
            "left_out_error_pp_arcmin": self.ripple / arcmin,
            "left_out_ripple_pp_Nm": self.torque_ripple,
            "link_angle_arcmin": self.link / arcmin,
            "resonance": {
                "native": _mode_json(self.native),
                "full": _mode_json(self.full),
            },
            "notes": list(notes_of(drive)),
        }


def _mode_json(mode: StepMode | None) -> dict[str, float] | None:
    if mode is None:
        return None
    return {
        "frequency_Hz": mode.frequency / (2.0 * np.pi),
        "damping_ratio": mode.damping_ratio,
    }


def notes_of(drive: JointDrive) -> tuple[str, ...]:
    """Parts of a drive that its native springs do not represent.

    Args:
        drive: A drive at ``native``.
    """
    spring = drive.native
    assert spring is not None
    friction = spring.friction_note
    notes = (spring.note, f"friction: {friction} is left out" if friction else "")
    return tuple(note for note in notes if note)


def native_error(drive: JointDrive, *, timestep: float) -> NativeError:
    """Compare a drive at level ``native`` with the same drive at level ``full``.

    Args:
        drive: A drive at ``native``, as :func:`swgjoint.joint.attach.attach` returned
            it.
        timestep: Step of the model, with the integrator ``discrete`` [s].

    Raises:
        ComputationError: If the period of the ripple needs too many samples.
    """
    spring = drive.native
    assert spring is not None
    law, top = drive.drive, spring.fitted_to
    rated = min(law.ratings.rated_torque, top)
    loads = {f"{load:.17g}": load for load in (-top, -rated, 0.0, rated, top)}
    turns = measure_turns(law, error=loads, ripple={"ripple": rated})
    torsion = _loop_difference(law, native_map(law, spring), top)
    # the transmission error of the mean curve alone is minus its torsion
    off = [turns[key].signal + law.mean_torsion(load) for key, load in loads.items()]
    return NativeError(
        torque=top,
        torsion=torsion,
        ripple=max(turns[key].peak_to_peak() for key in loads),
        link=torsion
        + max(float(np.abs(values).max()) for values in off)
        + _friction_torsion(law, tuple(loads.values())),
        torque_ripple=turns["ripple"].peak_to_peak(),
        native=step_mode(drive, timestep=timestep),
        full=step_mode(replace(drive, level="full", native=None), timestep=timestep),
    )


def _loop_difference(law: DriveMap, native: DriveMap, top: float) -> float:
    """Largest difference of the torsion loops of two mean curves [rad].

    Args:
        law: Map of the drive.
        native: Its native springs as a map, without harmonics.
        top: Torque up to which the loops are compared [N·m].
    """
    mean = law.with_harmonics(np.arange(len(law.orders)) == 0)
    one, other = torque_loop(mean), torque_loop(native)
    within = np.abs(one.torque) <= top
    return float(np.abs(one.torsion - other.torsion)[within].max())


def _friction_torsion(law: DriveMap, loads: tuple[float, ...]) -> float:
    """Largest torsion due to the friction torque on a slowly moving flexspline [rad].

    Args:
        law: Map of the drive.
        loads: Output torques [N·m].
    """
    if law.friction is None:
        return 0.0
    largest = 0.0
    for load in loads:
        slip = float(law.friction.yield_torque(0.0, load / law.ratio))
        slip *= abs(law.friction_direction[1])
        ends = [law.mean_torsion(load + part) for part in (-slip, 0.0, slip)]
        largest = max(largest, *np.diff(ends).tolist())
    return largest
