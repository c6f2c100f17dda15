"""Drives side by side in one scene: stiffness, ripple, error, stress, run time.

Each argument is a design, a map, a catalogue drive or a level. A drive takes the place
of that of every driven joint; a level keeps the scene's drives. Figures of the scene
are those of its worst joint.
"""

from __future__ import annotations

import io
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from swgjoint.errors import ComputationError, InputError
from swgjoint.faults import read_toml
from swgjoint.gear.design import Design
from swgjoint.maps.drive_map import DriveMap
from swgjoint.progress import Progress, silent
from swgjoint.sim.drives import find_drive, load_drive
from swgjoint.sim.run import Run, run_scene
from swgjoint.sim.scene import Scene
from swgjoint.sim.scene_sections import LEVELS, JointSection

STRESS_POSITIONS = 6
"""Over one pitch of the fixed member, after which the pattern repeats."""
UPPER = (
    "ripple_rms_percent",
    "ripple_pp_percent",
    "transmission_error_arcmin",
    "von_mises_MPa",
    "peak_torque_of_rating",
    "wall_s",
)
"""Figures that a spec limits from above."""
LOWER = ("K1_Nm_rad",)
"""Figures that a spec limits from below."""
SORTABLE = (*UPPER, *LOWER)


@dataclass(frozen=True, kw_only=True)
class Compared:
    """One argument in the scene; None where a figure cannot be told."""

    argument: str
    design: str
    level: str
    ripple_rms_percent: float
    ripple_pp_percent: float
    transmission_error_arcmin: float
    """Peak to peak."""
    K1_Nm_rad: float | None
    von_mises_MPa: float | None
    peak_torque_of_rating: float
    """Over the repeated peak torque."""
    joint: str
    """The one with the most ripple."""
    wall_s: float
    missed: tuple[str, ...] = ()
    """Limits of the spec that it does not keep."""

    def to_json(self) -> dict[str, Any]:
        """All figures."""
        return {key: getattr(self, key) for key in self.__dataclass_fields__}


def read_spec(path: str | Path) -> dict[str, float]:
    """Limits of a ``[spec]`` table.

    Raises:
        InputError: If the file or a key cannot be used.
    """
    table = read_toml(Path(path), what="spec").get("spec")
    if not isinstance(table, Mapping) or not table:
        raise InputError(f"{path}: accepted: a table [spec] with limits")
    faults = [
        f"{path}: spec.{key} = {value!r}; accepted: a positive number under"
        f" {', '.join(SORTABLE)}"
        for key, value in table.items()
        if key not in SORTABLE
        or isinstance(value, bool)
        or not isinstance(value, int | float)
        or not 0.0 < value < np.inf
    ]
    if faults:
        raise InputError("\n".join(faults))
    return {key: float(value) for key, value in table.items()}


def compare(
    arguments: Sequence[str],
    scene: Scene,
    *,
    model: str | None = None,
    spec: Mapping[str, float] | None = None,
    progress: Progress = silent,
) -> list[Compared]:
    """Run the scene once for every argument, in the order given.

    Args:
        arguments: Designs, maps, catalogue drives or levels.
        scene: The scene.
        model: Fidelity of designs; their default if None.
        spec: Limits by figure; see :data:`UPPER` and :data:`LOWER`.
        progress: Called with the stage, what is done and their number.

    Raises:
        InputError: If an argument is none of these.
    """
    sources = {name: None if name in LEVELS else find_drive(name) for name in arguments}
    rows = []
    for number, name in enumerate(arguments):
        begin = time.perf_counter()
        source = sources[name]
        if source is None:
            run = run_scene(_with_level(scene, name))
            drive, stress, level = None, None, name
        else:
            drive = load_drive(name, model=model, progress=progress)
            run = run_scene(_with_drive(scene, name), drives={name: drive})
            stress = _stress(source, drive, model)
            level = ""
        row = _row(name, run, drive, stress, time.perf_counter() - begin)
        row = replace(row, level=level or row.level)
        rows.append(replace(row, missed=missed(row, spec or {})))
        progress("compared", number + 1, len(arguments))
    return rows


def missed(row: Compared, spec: Mapping[str, float]) -> tuple[str, ...]:
    """Limits that a row does not keep, a figure that is not known among them."""
    found = []
    for key, limit in spec.items():
        value = getattr(row, key)
        kept = value is not None and (
            value >= limit if key in LOWER else value <= limit
        )
        if not kept:
            found.append(key)
    return tuple(found)


def _with_drive(scene: Scene, reference: str) -> Scene:
    """The scene with another drive in every driven joint."""

    def changed(section: JointSection) -> JointSection:
        if section.drive is None and section.linear is None:
            return section
        return section.model_copy(update={"drive": reference, "linear": None})

    return _changed(scene, changed)


def _with_level(scene: Scene, level: str) -> Scene:
    """The scene with another level in every driven joint."""
    return _changed(scene, lambda s: s.model_copy(update={"level": level}))


def _changed(scene: Scene, change: Any) -> Scene:
    joints = {name: change(section) for name, section in scene.joints.items()}
    return scene.model_copy(
        update={"defaults": change(scene.defaults), "joints": joints}
    )


def _row(
    name: str, run: Run, drive: DriveMap | None, stress: float | None, wall: float
) -> Compared:
    joints = run.metrics()["joints"]
    if drive is None:  # the softest drive of the scene
        drives = [t.drive for t in run.assembly.transmissions]
        drive = min(drives, key=lambda d: d.mean_stiffness)
    worst = max(joints, key=lambda j: float(joints[j]["ripple_rms_percent"]))

    def largest(*keys: str) -> float:
        values = []
        for joint in joints.values():
            value = joint
            for key in keys:
                value = value[key]
            values.append(float(value))
        return max(values)

    peaks = [
        joint["ratings"]["peak_Nm"] / joint["ratings"]["repeated_peak_Nm"]
        for joint in joints.values()
    ]
    sheet = drive.spec_sheet(("K1_Nm_rad",))
    return Compared(
        argument=name,
        design=drive.name,
        level=joints[worst]["level"],
        ripple_rms_percent=largest("ripple_rms_percent"),
        ripple_pp_percent=largest("ripple_pp_percent"),
        transmission_error_arcmin=largest("transmission_error_arcmin", "pp"),
        K1_Nm_rad=sheet["K1_Nm_rad"],
        von_mises_MPa=stress,
        peak_torque_of_rating=max(peaks),
        joint=worst,
        wall_s=wall,
    )


def _stress(
    source: Design | DriveMap, drive: DriveMap, model: str | None
) -> float | None:
    """Mean over a pitch of the largest von Mises stress at rated torque [MPa]."""
    if isinstance(source, DriveMap):
        return None
    from swgjoint.fe.drive2d import can_halve
    from swgjoint.fe.meshing import simulate_meshing
    from swgjoint.gear.kinematics import periodicity

    gear = source.drive
    pitches = periodicity(
        gear.layout, gear.teeth_flexspline, gear.teeth_circular_spline
    )
    try:
        run = simulate_meshing(
            source,
            model=model or ("3d" if source.cup is not None else "2d"),
            torque=drive.ratings.rated_torque,
            steps=STRESS_POSITIONS,
            turn=1.0 / pitches,
            half=can_halve(source),
        )
    except ComputationError:
        return None
    average = run.to_json()["flexspline"]["average_max_MPa"]
    return float(average["von_mises"])


def comparison_picture(rows: Sequence[Compared], scene: str) -> bytes:
    """PNG: bars of every figure, one panel each."""
    from matplotlib.figure import Figure

    panels = {
        "ripple_rms_percent": "torque ripple rms [% of rated]",
        "transmission_error_arcmin": "transmission error pp [arcmin]",
        "K1_Nm_rad": "K1 [N·m/rad]",
        "von_mises_MPa": "von Mises stress [MPa]",
    }
    figure = Figure(figsize=(3.2 * len(panels), 1.6 + 0.35 * len(rows)))
    figure.set_layout_engine("constrained")
    axes = figure.subplots(1, len(panels), sharey=True)
    names = [row.argument for row in rows]
    for ax, (key, title) in zip(axes, panels.items(), strict=True):
        values = [getattr(row, key) for row in rows]
        ax.barh(names, [value or 0.0 for value in values], color="tab:blue")
        for k, value in enumerate(values):
            text = " not told" if value is None else f" {value:.3g}"
            ax.text(value or 0.0, k, text, va="center", fontsize="small")
        ax.set_title(title, fontsize="small")
        ax.margins(x=0.25)
    axes[0].invert_yaxis()
    figure.suptitle(f"scene {scene}, worst joint", fontsize="medium")
    out = io.BytesIO()
    figure.savefig(out, format="png", dpi=110)
    return out.getvalue()
