"""Compare drives in one scene: stiffness, ripple, error, stress, run time.

Each argument is a design, a map, a catalogue drive or a level. A drive replaces the
drive of every driven joint, or of selected joints; a level changes only the level of
these joints. The figures of a run are those of the worst of these joints.
"""

from __future__ import annotations

import time
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

from swgjoint.drives.fidelity import default_model
from swgjoint.drives.references import find_drive, given_drives, load_drive
from swgjoint.errors import ComputationError
from swgjoint.explore.compare.limits import require_cycle
from swgjoint.explore.compare.scene import drives_of, source_of, with_drive, with_level
from swgjoint.gear.design.design import Design
from swgjoint.joint import plugin
from swgjoint.maps.drive_map import DriveMap
from swgjoint.maps.sheet.validity_marks import joints_judged
from swgjoint.progress import Progress, silent
from swgjoint.sim.arm.scene import rigid_arm_of
from swgjoint.sim.figures.keys import LOWER, RIPPLE, is_lower_bound
from swgjoint.sim.figures.line_source import error_may_exceed, error_ripple
from swgjoint.sim.figures.metrics import strongest_left_out
from swgjoint.sim.figures.resonance import lowest_resonance
from swgjoint.sim.figures.ripple_validity import may_exceed
from swgjoint.sim.run import Run
from swgjoint.sim.scene.scene import Scene
from swgjoint.view.run import run_scene

STRESS_POSITIONS = 6
"""Positions over one pitch of the fixed member, after which the mesh cycle repeats."""
SLOW = "fatigue_safety_factor"
"""Figure that is computed only if a spec or the sorting needs it, because its 3D model
takes minutes."""
STIFFNESS = "K1_Nm_rad"
OF_SPRINGS = (STIFFNESS, "resonance_Hz")
"""Figures that a level without compliance does not have and whose limits it meets."""
UNYIELDING = ("rigid", "kinematic")
"""Levels without compliance, which have no stiffness to compare."""


@dataclass(frozen=True, kw_only=True)
class Compared:
    """Results of one argument in the scene; an unknown figure is None."""

    argument: str
    design: str
    """Name of the drive; for a level, that of the softest drive of the scene."""
    level: str
    """Level of the joint with the largest ripple."""
    verdict: str
    """Whether the run is valid, see :mod:`swgjoint.sim.figures.verdict`."""
    reasons: tuple[str, ...]
    """Reasons why the run is not valid."""
    ripple_rms_percent: float
    """Rms torque ripple of the worst joint [% of rated torque]."""
    ripple_pp_percent: float
    """Peak-to-peak torque ripple of the worst joint [% of rated torque]."""
    ripple_missing: str | None
    """Reason why no ripple is reported, such as a ripple below the integration noise;
    None if it is reported."""
    ripple_is_lower_bound: bool
    """Whether orders that the step leaves out may raise the largest ripple, in its
    joint or in another one. Such a ripple meets no limit."""
    ripple_valid: bool | None
    """Whether the maps of all joints meet the limit of their validation at the torques
    of the run; None if no map has a validation."""
    map_difference: dict[str, Any] | None
    """Largest differences of these maps from their validation solves, by quantity, in
    the form of the figures of a joint."""
    transmission_error_arcmin: float
    """Peak-to-peak transmission error [arcmin]."""
    transmission_error_is_lower_bound: bool
    """Whether orders that the step leaves out may raise this error, in its joint or in
    another one. Such an error meets no limit."""
    transmission_error_ripple_arcmin: float | None
    """Peak-to-peak amplitude of the strongest spectral line at an order of the drive
    [arcmin]; None if the inputs turn too little for the strongest orders."""
    torsion_arcmin: float
    """Largest absolute mean torsion of a joint [arcmin]."""
    tool_path_rms_mm: float | None
    """Rms deviation of the tool from the commanded path [mm]."""
    tool_ap_mm: float | None
    """Largest pose accuracy AP after ISO 9283 [mm], or the error at the last pose."""
    tool_rp_mm: float | None
    """Largest pose repeatability RP after ISO 9283 [mm]."""
    K1_Nm_rad: float | None
    """Torsional stiffness K1 of the drive, at low torque [N·m/rad]."""
    resonance_Hz: float | None
    """Lowest natural frequency of the arm on its drives over the motion, with held
    motors [Hz]; None without compliance."""
    von_mises_MPa: float | None
    """Largest von Mises stress of the flexspline at rated torque, averaged over one
    pitch [MPa]; None without a design."""
    fatigue_safety_factor: float | None
    """Smallest fatigue safety factor at rated torque [-]; None if it was not requested
    or the argument is no design with a cup."""
    peak_torque_of_rating: float
    """Peak torque divided by the repeated peak torque [-]."""
    cubed_mean_torque_of_rating: float
    """Cubic mean torque divided by the rated torque [-]."""
    L10_h: float | None
    """Smallest life over the duty cycle that nine out of ten wave-generator bearings
    exceed [h]; None without a duty cycle or without the rated life of a joint."""
    goodman_safety: float | None
    """Smallest Goodman safety factor of the flexspline over the duty cycle [-]; None
    without a duty cycle, or if it is not known for a joint."""
    real_time_factor: float
    """Simulated time divided by the wall time of the steps [-]."""
    joint: str
    """Joint with the largest ripple."""
    strongest_order_left_out: tuple[str, ...]
    """Joints that turn too fast for the step to resolve the strongest order of their
    drive."""
    wall_s: float
    """Wall time of the comparison, including maps and stresses [s]."""
    run: Run = field(repr=False, compare=False)
    missed: tuple[str, ...] = ()
    """Limits of the spec that are not met."""

    def figure(self, key: str) -> Any:
        """Value of a figure; None if the run does not provide it."""
        return None if self.ripple_missing and key in RIPPLE else getattr(self, key)

    def is_lower_bound(self, key: str) -> bool:
        """Whether orders that the step leaves out may raise a figure."""
        return is_lower_bound(vars(self), key)

    def to_json(self) -> dict[str, Any]:
        """All figures as JSON."""
        return {
            key: getattr(self, key) for key in self.__dataclass_fields__ if key != "run"
        }


def compare(
    arguments: Sequence[str],
    scene: Scene,
    *,
    model: str | None = None,
    spec: Mapping[str, float] | None = None,
    fatigue: bool = False,
    joints: Sequence[str] = (),
    assumed_rotors: Sequence[str] = (),
    progress: Progress = silent,
) -> list[Compared]:
    """Run the scene once for every argument, in the given order.

    Args:
        arguments: Designs, maps, catalogue drives or levels.
        scene: The scene.
        model: Fidelity of all designs, including those of the scene; None for the
            default of each design. It does not apply to maps and catalogue drives.
        spec: Limits by figure; see :mod:`swgjoint.sim.figures.keys`.
        fatigue: Whether to assess the fatigue of designs with a cup.
        joints: Joints that get the drive or the level, and whose figures count; every
            driven joint if empty.
        assumed_rotors: Joints in which the rotor inertia assumed for a drive comes with
            it; the other joints keep the rotor inertia of the scene.
        progress: Called with the stage, the number of finished runs and their total.

    Returns:
        One entry per argument.

    Raises:
        InputError: If an argument is neither a drive nor a level, or if the spec limits
            a life but the scene has no duty cycle.
    """
    require_cycle(scene, spec or ())
    sources = {name: source_of(name) for name in arguments}
    scenes = [
        with_level(scene, name, joints)
        if sources[name] is None
        else with_drive(scene, name, joints, assumed_rotors)
        for name in arguments
    ]
    driven = rigid_arm_of(scene).joints
    if any(s.joint_settings(j).level == "full" for s in scenes for j in driven):
        plugin.load()  # reports another MuJoCo before maps are built
    kept: dict[str, DriveMap] = {}  # drives that the scene keeps

    def known(changed: Scene, own: Mapping[str, DriveMap]) -> dict[str, DriveMap]:
        if model is not None:
            for reference in drives_of(changed, driven):
                if reference not in {*kept, *own} and _is_design(reference):
                    kept[reference] = load_drive(
                        reference, model=model, progress=progress
                    )
        return {**kept, **own}

    rows = []
    for number, (name, changed) in enumerate(zip(arguments, scenes, strict=True)):
        begin = time.perf_counter()
        source = sources[name]
        if source is None:
            run = run_scene(changed, drives=known(changed, {}), name=name)
            drive, stress, safety = None, None, None
        else:
            fidelity = model if isinstance(source, Design) else None
            drive = load_drive(name, model=fidelity, progress=progress)
            own = given_drives({name: drive})
            run = run_scene(changed, drives=known(changed, own), name=name)
            stress = _stress(source, drive, model)
            safety = _safety(source, drive, progress) if fatigue else None
        level = name if source is None else None
        row = row_of(name, run, drive, level=level, of=joints)
        row = replace(row, von_mises_MPa=stress, fatigue_safety_factor=safety)
        row = replace(row, wall_s=time.perf_counter() - begin)
        rows.append(replace(row, missed=missed_limits(row, spec or {})))
        progress("compared", number + 1, len(arguments))
    return rows


def _is_design(reference: str) -> bool:
    return isinstance(find_drive(reference), Design)


def missed_limits(row: Compared, spec: Mapping[str, float]) -> tuple[str, ...]:
    """Limits that a row does not meet; a figure without a valid value meets none.

    Neither does a lower bound meet an upper limit. A level without compliance meets
    every lower limit of stiffness and resonance.

    Args:
        row: Results of one argument.
        spec: Limits by figure.
    """
    found = []
    for key, limit in spec.items():
        value = row.figure(key)
        if key in OF_SPRINGS and value is None and row.level in UNYIELDING:
            continue
        valid = key not in RIPPLE or row.ripple_valid is not False
        kept = (
            valid
            and not row.is_lower_bound(key)
            and value is not None
            and (value >= limit if key in LOWER else value <= limit)
        )
        if not kept:
            found.append(key)
    return tuple(found)


def row_of(
    name: str,
    run: Run,
    drive: DriveMap | None,
    *,
    level: str | None,
    of: Sequence[str] = (),
) -> Compared:
    """Figures of one run, still without stress, fatigue and wall time.

    Args:
        name: The argument.
        run: Its run.
        drive: Drive that the argument names; None for a level, which uses the drives of
            the scene.
        level: Level that the argument names; None for a drive.
        of: Joints whose figures count; all if empty.
    """
    metrics = run.metrics()
    joints, tool = metrics["joints"], metrics["tool"]
    if of:
        joints = {name: figures for name, figures in joints.items() if name in of}
    if drive is None:  # report the softest drive of the scene
        drives = [t.drive for t in run.assembly.transmissions if t.joint in joints]
        drive = min(drives, key=lambda d: d.mean_stiffness)
    worst = max(joints, key=lambda j: float(joints[j]["ripple_rms_percent"]))
    ripple = float(joints[worst]["ripple_rms_percent"])
    ratings = [joint["ratings"] for joint in joints.values()]
    resonance = lowest_resonance(run)
    errors = [joint["transmission_error_arcmin"] for joint in joints.values()]

    def largest(key: str) -> float:
        return max(float(joint[key]) for joint in joints.values())

    return Compared(
        argument=name,
        design=drive.name,
        level=level or joints[worst]["level"],
        verdict=metrics["verdict"],
        reasons=tuple(metrics["reasons"]),
        ripple_rms_percent=largest("ripple_rms_percent"),
        ripple_pp_percent=largest("ripple_pp_percent"),
        ripple_missing=joints[worst]["ripple_missing"],
        ripple_is_lower_bound=any(may_exceed(of, ripple) for of in joints.values()),
        **joints_judged(joints.values()),
        transmission_error_arcmin=max(float(error["pp"]) for error in errors),
        transmission_error_is_lower_bound=error_may_exceed(run, joints),
        transmission_error_ripple_arcmin=error_ripple(run, joints),
        torsion_arcmin=max(
            abs(float(joint["torsion_arcmin"]["mean"])) for joint in joints.values()
        ),
        tool_path_rms_mm=tool["path_rms_mm"],
        tool_ap_mm=tool["ap_mm"],
        tool_rp_mm=tool["rp_mm"],
        K1_Nm_rad=None
        if level in UNYIELDING
        else drive.spec_sheet((STIFFNESS,))[STIFFNESS],
        resonance_Hz=None if resonance is None else resonance[0],
        von_mises_MPa=None,
        fatigue_safety_factor=None,
        peak_torque_of_rating=max(
            float(of["peak_Nm"] / of["repeated_peak_Nm"]) for of in ratings
        ),
        cubed_mean_torque_of_rating=max(
            float(of["cubed_mean_Nm"] / of["rated_Nm"]) for of in ratings
        ),
        L10_h=smallest_of_cycle(joints.values(), "bearing", "L10_h"),
        goodman_safety=smallest_of_cycle(
            joints.values(), "flexspline", "goodman_safety"
        ),
        real_time_factor=float(run.time[-1] / run.wall),
        joint=worst,
        strongest_order_left_out=tuple(
            t.joint
            for t in run.assembly.transmissions
            if t.joint in joints and strongest_left_out(t)
        ),
        wall_s=0.0,
        run=run,
    )


def smallest_of_cycle(
    joints: Iterable[Mapping[str, Any]], part: str, key: str
) -> float | None:
    """Smallest figure of several joints over the duty cycle; None if one is unknown.

    Joints whose life is unlimited do not count.

    Args:
        joints: Figures of the joints.
        part: Part of the life, ``bearing`` or ``flexspline``.
        key: Key of the figure.
    """
    lives = [joint["life"][part] for joint in joints if "life" in joint]
    values = [life[key] for life in lives if life.get(key) is not None]
    unknown = any(life["missing"] and not life["unlimited"] for life in lives)
    return None if unknown else min(values, default=None)


def _safety(
    source: Design | DriveMap, drive: DriveMap, progress: Progress
) -> float | None:
    """Smallest fatigue safety factor of a design with a cup at rated torque [-]."""
    if isinstance(source, DriveMap) or source.cup is None:
        return None
    from swgjoint.fe.solid.figures.spec_figures import solid_figures

    found = solid_figures(source, [SLOW], drive.ratings.rated_torque, progress=progress)
    return found.values.get(SLOW)


def _stress(
    source: Design | DriveMap, drive: DriveMap, model: str | None
) -> float | None:
    """Largest von Mises stress at rated torque, averaged over one pitch [MPa]."""
    if isinstance(source, DriveMap):
        return None
    from swgjoint.fe.meshing import simulate_meshing

    if model == "ring":  # a thin ring has no notches, so it gives no stress
        model = "2d"
    model = model or default_model(source)
    try:
        run = simulate_meshing(
            source,
            model=model,
            torque=drive.ratings.rated_torque,
            steps=STRESS_POSITIONS,
            turn=1.0 / source.periodicity,
            half="auto",
        )
    except ComputationError:
        return None
    average = run.to_json()["flexspline"]["average_max_MPa"]
    return float(average["von_mises"])
