"""Computations that the page starts; each runs in a process of its own.

Every function takes plain data, reports its progress and returns picklable data. Files
are written to a folder of the page.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from swgjoint.drives.build_map import build_map
from swgjoint.errors import DesignError
from swgjoint.fe.meshing import simulate_meshing
from swgjoint.fe.meshing_run import MeshingRun
from swgjoint.fe.quick_look import QuickLook, take_quick_look
from swgjoint.files import file_name, write_whole
from swgjoint.gear.catalogue import ratings_of
from swgjoint.gear.design.design import Design
from swgjoint.gear.design.feasibility import design_checks, engagement_checks
from swgjoint.gear.teeth.tooth_path import tooth_path
from swgjoint.json_text import json_text, plain
from swgjoint.maps.sheet.spec_sheet import measure_spec
from swgjoint.progress import Progress, silent
from swgjoint.sim.arm.rigid_arm import RigidArm
from swgjoint.sim.arm.scene import arm_scene, is_arm
from swgjoint.sim.scene.scene import Scene
from swgjoint.sim.scene.text import scene_toml
from swgjoint.studio.draft import Draft, Verdict, judge
from swgjoint.view.plots.design import teeth_picture
from swgjoint.view.plots.fields import field_pictures
from swgjoint.view.plots.meshing import meshing_picture, quick_look_picture
from swgjoint.view.plots.solid import solid_pictures
from swgjoint.view.plots.spec import spec_picture
from swgjoint.view.report.report import write_report, write_tables
from swgjoint.view.report.tables import Cell, Table, sheet_table
from swgjoint.view.run import run_scene
from swgjoint.view.words import format_figure


@dataclass(frozen=True, kw_only=True)
class Shown:
    """What a draft shows before any finite elements."""

    verdict: Verdict
    """The design, or the faults of the draft."""
    teeth: bytes | None
    """Picture of the teeth at the lobe; None without a design."""
    checks: tuple[tuple[str, str], ...]
    """Names and values of the checks of the engagement, as text."""


def show_design(draft: Draft, *, progress: Progress = silent) -> Shown:
    """Check a draft, draw its teeth and follow a rigid tooth through its space.

    Args:
        draft: The draft.
        progress: Not called.
    """
    verdict = judge(draft)
    design = verdict.design
    if design is None:
        return Shown(verdict=verdict, teeth=None, checks=())
    checks, faults = design_checks(design), []
    try:
        engaged = engagement_checks(design, tooth_path(design))
        faults = [line for c in engaged if not c.ok for line in c.fault.splitlines()]
        checks += engaged
    except DesignError:  # a rim on rollers has no outline for the tooth to follow
        pass
    where = f"{design.drive.name}: "
    verdict = Verdict(
        design=design, faults=tuple(line.removeprefix(where) for line in faults)
    )
    rows = [
        (check.name, f"{check.value:.4g} {check.unit}".strip())
        for check in checks
        if check.value is not None and not check.numerical
    ]
    return Shown(verdict=verdict, teeth=teeth_picture(design), checks=tuple(rows))


def look_at_design(design: Design, *, progress: Progress = silent) -> QuickLook:
    """Solve a few coarse equilibria of a design.

    Args:
        design: The drive.
        progress: Called with the stage, the number of finished stages and their total.
    """
    return take_quick_look(design, progress=progress)


def draw_looks(looks: Mapping[str, QuickLook], *, progress: Progress = silent) -> bytes:
    """Draw quick looks over each other as PNG.

    Args:
        looks: Quick looks by label.
        progress: Not called.
    """
    return quick_look_picture(looks)


def make_sheet(
    design: Design, model: str, folder: Path, *, progress: Progress = silent
) -> list[str]:
    """Build the map of a design, and write it with its data sheet.

    Args:
        design: The drive.
        model: Fidelity, ``ring``, ``2d`` or ``3d``.
        folder: Folder for the files.
        progress: Called with the stage, the number of finished solves and their total.

    Returns:
        Names of the files in the folder, the page first.
    """
    drive = build_map(design, model=model, progress=progress)
    name = f"{file_name(design.drive.name)}.swg"
    drive.save(folder / name)
    section = sheet_table(drive)
    write_tables(
        folder / "sheet.html",
        title=f"Data sheet of {design.drive.name}",
        description=section["source"],
        tables=[section["table"]],
        pictures={
            "curves": spec_picture(drive.name, measure_spec(drive)),
            "teeth": teeth_picture(design),
        },
        settings={"Design": design.to_toml()},
    )
    return ["sheet.html", name]


def make_meshing(
    design: Design, model: str, folder: Path, *, progress: Progress = silent
) -> list[str]:
    """Simulate meshing at rated torque with the mesh of the design.

    Args:
        design: The drive.
        model: Fidelity, ``2d`` or ``3d``.
        folder: Folder for the page.
        progress: Called with the stage, the number of finished steps and their total.

    Returns:
        Names of the files in the folder, the page first.
    """
    run = simulate_meshing(
        design,
        model=model,
        torque=ratings_of(design).rated_torque,
        half="auto",
        throw=False,
        progress=progress,
    )
    result = plain(run.to_json())
    fields = field_pictures(run) if isinstance(run, MeshingRun) else solid_pictures(run)
    rows = [
        [Cell(member.replace("_", " "), "text"), *(_cells(mean[k] for k in _KINDS))]
        for member in ("flexspline", "circular_spline")
        if (mean := (result.get(member) or {}).get("average_max_MPa"))
    ]
    header = [
        ("mean of the largest stresses", ""),
        *((k.replace("_", " "), "MPa") for k in _KINDS),
    ]
    write_tables(
        folder / "meshing.html",
        title=f"Meshing of {design.drive.name}",
        description=f"{model}, {result['nodes']} nodes, {result['steps']} positions at"
        f" {run.torque:.4g} N·m: {result['outcome']}.",
        tables=[Table(header=header, rows=rows, notes=result.get("warnings") or [])],
        pictures={
            "over the input angle": meshing_picture(result),
            **{k.replace("-", " "): v for k, v in fields.items()},
        },
        settings={"Design": design.to_toml()},
    )
    return ["meshing.html"]


def list_joints(source: str, *, progress: Progress = silent) -> dict[str, str]:
    """Driven joints of a scene or an arm, each with its drive, a name or ``linear``.

    Args:
        source: Scene or arm, a bundled name or a path.
        progress: Not called.
    """
    scene = _scene(source, {})
    arm = RigidArm(scene.arm, reading=scene.reading)
    return {name: scene.joint_settings(name).drive or "linear" for name in arm.joints}


def run_arm(
    source: str,
    changes: Mapping[str, Any],
    own: Sequence[str],
    design: Design | None,
    folder: Path,
    *,
    progress: Progress = silent,
) -> tuple[dict[str, Any], list[str]]:
    """Run a scene, or an arm with a slow sweep, and write its report and recording.

    Args:
        source: Scene or arm, a bundled name or a path.
        changes: New values for dotted keys of the scene.
        own: Joints with a drive of the design, with its 2D map.
        design: The design; None if there are no such joints.
        folder: Folder for the files.
        progress: Called with the stage, the number of finished steps and their total.

    Returns:
        Verdict, reasons, joints and tool of :meth:`swgjoint.sim.run.Run.metrics`, and
        the names of the files in the folder, the report first.
    """
    names = ["report.html", "run.rrd", "scene.toml"]
    path = folder / "drive.toml"
    if own and design is not None:
        write_whole(path, design.to_toml())
        names.append(path.name)
    given = {"drive": str(path), "model": "2d"}
    scene = _scene(
        source,
        {**changes, **{f"joints.{j}.{key}": given[key] for j in own for key in given}},
    )
    run = run_scene(scene, recording=folder / "run.rrd", progress=progress)
    write_report({"": run}, folder / "report.html", progress=progress)
    # the saved files belong together, in any folder
    text = scene_toml(scene)
    text = text.replace(json_text(str(path.resolve())), json_text(path.name))
    write_whole(folder / "scene.toml", text)
    return {k: v for k, v in run.metrics().items() if k in _METRICS}, names


def figure_rows(looks: Mapping[str, QuickLook]) -> list[dict[str, str]]:
    """Rows of figures of quick looks: ``figure`` with its unit, and one per label."""
    rows = []
    for key, (name, unit) in FIGURES.items():
        values = {
            f"v{k}": format_figure(look.figures[key])
            for k, look in enumerate(looks.values())
        }
        rows.append({"figure": f"{name} [{unit}]", **values})
    return rows


FIGURES = {
    "K1_Nm_rad": ("K1", "N·m/rad"),
    "K2_Nm_rad": ("K2", "N·m/rad"),
    "K3_Nm_rad": ("K3", "N·m/rad"),
    "torsion_arcmin": ("torsion at rated torque", "arcmin"),
    "kinematic_error_arcmin": ("kinematic error pp", "arcmin"),
    "transmission_error_arcmin": ("transmission error pp", "arcmin"),
    "ripple_pp_percent": ("torque ripple pp", "% of rated"),
    "ripple_rms_percent": ("torque ripple rms", "% of rated"),
    "von_mises_MPa": ("largest von Mises stress", "MPa"),
    "tensile_MPa": ("largest tensile stress", "MPa"),
    "compressive_MPa": ("largest compressive stress", "MPa"),
}
"""Name and unit of the figures of a quick look."""
_KINDS = ("tensile", "compressive", "von_mises")
_METRICS = ("verdict", "reasons", "joints", "tool", "steps_per_s")


def _scene(source: str, changes: Mapping[str, Any]) -> Scene:
    if is_arm(source):
        return arm_scene(source, overrides=changes).scene
    return Scene.load_file(source, changes)


def _cells(values: Any) -> list[Cell]:
    return [Cell(format_figure(value)) for value in values]
