"""Life of the drives over a duty cycle, with the keys of the JSON output.

A figure that cannot be computed is None; ``missing`` states the reason.
"""

from __future__ import annotations

from math import inf, isfinite
from typing import TYPE_CHECKING, Any

from swgjoint.drives.sections import LifeSection
from swgjoint.errors import MissingExtraError
from swgjoint.gear.bearing_life import (
    EXPONENT,
    L50_OVER_L10,
    RATED_SPEED,
    RatedLife,
    catalogue_life,
)
from swgjoint.gear.fatigue_life import StressLife, goodman_safety, miner_damage
from swgjoint.sim.life.flexspline import count_root_cycles
from swgjoint.sim.life.loads import MeanLoad, cycle_duration, mean_load
from swgjoint.units import MPa, hour, rpm

if TYPE_CHECKING:
    from swgjoint.maps.drive_map import DriveMap
    from swgjoint.sim.run import Run

STILL = "the joint does not turn in the cycle"
NO_CHANGE = "the stress at the tooth root does not change in the cycle"
NO_CURVE = (
    "the scene states no S-N curve of the flexspline; accepted: endurance_limit_MPa,"
    " ultimate_strength_MPa, sn_exponent and sn_knee_cycles in [defaults.life] or"
    " [joints.NAME.life]"
)


def cycle_figures(run: Run) -> dict[str, Any]:
    """The duty cycle of a run: its duration and its tasks."""
    return {
        "duration_s": cycle_duration(run.cycle),
        "tasks": [
            {
                "name": task.name,
                "duration_s": task.duration,
                "times": task.times,
                "rest": task.rest,
            }
            for task in run.cycle
        ],
    }


def life_figures(run: Run, j: int) -> dict[str, Any]:
    """Life of one drive over the duty cycle of the run.

    Args:
        run: A run with a duty cycle.
        j: Index of the joint.
    """
    drive = run.assembly.transmissions[j].drive
    section = run.assembly.scene.joint_settings(run.joints[j]).life or LifeSection()
    rated = rated_life(drive, section)
    exponent = rated.exponent if isinstance(rated, RatedLife) else EXPONENT
    load = mean_load(run.cycle, j, exponent)
    return {
        "cubed_mean_Nm": load.torque,
        "mean_input_speed_rpm": load.input_speed / rpm,
        "input_turns": load.input_turns,
        "peak_Nm": load.peak,
        "bearing": _bearing(drive, rated, load),
        "flexspline": _flexspline(run, j, section),
        "margins": _margins(drive, load.peak),
    }


def rated_life(drive: DriveMap, section: LifeSection) -> RatedLife | str:
    """Rated life of a drive, or the reason why it is not known.

    Args:
        drive: The drive.
        section: Table ``life`` of its joint.
    """
    if section.L50_h is not None:
        speed = section.rated_speed_rpm
        return RatedLife(
            L50=section.L50_h * hour,
            L10=(section.L10_h or section.L50_h / L50_OVER_L10) * hour,
            speed=RATED_SPEED if speed is None else speed * rpm,
        )
    if drive.level != "catalogue":
        return (
            f"the rated life of {drive.name} is not known; accepted: L50_h in"
            " [defaults.life] or [joints.NAME.life]"
        )
    series = drive.name.partition("-")[0]
    return catalogue_life(series) or (
        f"the catalogue tables have neither rated torques nor rated life of {series}"
        " drives; accepted: L50_h in [defaults.life] or [joints.NAME.life]"
    )


def _bearing(drive: DriveMap, rated: RatedLife | str, load: MeanLoad) -> dict[str, Any]:
    """Life of the wave-generator bearing."""
    if isinstance(rated, str) or load.torque is None:
        return {
            "L50_h": None,
            "L10_h": None,
            "unlimited": load.torque is None,
            "missing": STILL if load.torque is None else rated,
        }
    factor = rated.factor(drive.ratings.rated_torque, load.torque, load.input_speed)
    finite = isfinite(factor)
    return {
        "L50_h": factor * rated.L50 / hour if finite else None,
        "L10_h": factor * rated.L10 / hour if finite else None,
        "rated_L50_h": rated.L50 / hour,
        "rated_L10_h": rated.L10 / hour,
        "rated_torque_Nm": drive.ratings.rated_torque,
        "rated_speed_rpm": rated.speed / rpm,
        "torque_exponent": rated.exponent,
        "source": rated.source,
        "unlimited": not finite,
        "missing": None if finite else "the joint turns without torque",
    }


def _flexspline(run: Run, j: int, section: LifeSection) -> dict[str, Any]:
    """Fatigue of the flexspline at its root."""
    drive = run.assembly.transmissions[j].drive
    figures: dict[str, Any] = dict.fromkeys(
        (
            "stress_amplitude_MPa",
            "stress_mean_MPa",
            "goodman_safety",
            "damage_per_cycle",
            "life_h",
            "unlimited",
            "missing",
        )
    )
    steel = stress_life(section)
    try:
        cycles = count_root_cycles(drive, run.cycle, j, steel)
    except MissingExtraError as error:
        cycles = str(error)
    if isinstance(cycles, str):
        return figures | {"missing": cycles}
    if not cycles.amplitude.size:
        return figures | {"unlimited": True, "missing": NO_CHANGE}
    largest = int(cycles.amplitude.argmax())
    figures["stress_amplitude_MPa"] = float(cycles.amplitude[largest]) / MPa
    figures["stress_mean_MPa"] = float(cycles.mean[largest]) / MPa
    if steel is None:
        return figures | {"missing": NO_CURVE}
    damage = miner_damage(cycles, steel)
    life = cycle_duration(run.cycle) / damage if damage else inf
    return figures | {
        "goodman_safety": goodman_safety(cycles, steel),
        "damage_per_cycle": damage if isfinite(damage) else None,
        "life_h": life / hour if isfinite(life) else None,
        "unlimited": damage == 0.0,
    }


def stress_life(section: LifeSection) -> StressLife | None:
    """S-N curve of the table ``life`` of a joint; None if it states none.

    Args:
        section: The table.
    """
    limit, ultimate = section.endurance_limit_MPa, section.ultimate_strength_MPa
    exponent, knee = section.sn_exponent, section.sn_knee_cycles
    if limit is None or ultimate is None or exponent is None or knee is None:
        return None
    return StressLife(
        endurance_limit=limit * MPa,
        ultimate_strength=ultimate * MPa,
        exponent=exponent,
        knee=knee,
    )


def _margins(drive: DriveMap, peak: float) -> dict[str, float | None]:
    """Limit torques divided by the peak torque of the cycle; None if not known."""
    stated = drive.info.get("stated")
    stated = stated if isinstance(stated, dict) else {}
    limits = {
        "momentary_peak": drive.ratings.momentary_peak,
        "ratcheting": drive.ratings.ratcheting_torque,
        "buckling": stated.get("buckling_torque_Nm"),
    }
    return {
        key: None if limit is None or not peak else limit / peak
        for key, limit in limits.items()
    }
