"""Lists of bundled items: catalogue drives, designs, arms, scenes, study files."""

from __future__ import annotations

import warnings
from typing import Any

from swgjoint.models_path import KINDS, bundled_names, models_path
from swgjoint.toml_file import read_toml

NOTES = {
    "drives": "Any command that takes a drive takes these names, designs (swgjoint list"
    " designs), design files and .swg maps.",
    "designs": "Any size-NN-RRR with size 8 to 100 and ratio 30 to 200 is a design by"
    " rule; swgjoint design new scales one; swgjoint schema design lists the keys.",
    "arms": "Any MJCF or URDF file can be used as an arm: swgjoint run FILE.",
    "scenes": "swgjoint run NAME; swgjoint schema scene lists the keys.",
    "sweeps": "swgjoint sweep NAME; swgjoint schema sweep lists the keys.",
    "optimisations": "swgjoint optimise NAME; swgjoint schema optimise lists the keys.",
}
"""Hints per kind: which commands take such a name, and what else they accept."""


def bundled_rows(kind: str) -> list[dict[str, Any]]:
    """One row per bundled item of a kind, in the order of their names.

    Args:
        kind: A key of :data:`NOTES`.

    Returns:
        Rows with the keys of ``swgjoint list --json``.
    """
    if kind == "drives":
        return _drives()
    folder = "drives" if kind == "designs" else kind
    make = {"designs": _design, "arms": _arm, "scenes": _scene}.get(kind, _described)
    return [make(name, folder) for name in bundled_names(folder, KINDS[folder][0])]


def _drives() -> list[dict[str, Any]]:
    from swgjoint.gear.catalogue import named_rows
    from swgjoint.gear.catalogue_stated import stated_figures, stiffness_of

    return [
        {
            "name": row.name,
            "series": row.series,
            "size": row.size,
            "ratio": row.ratio,
            "rated_torque_Nm": row.rated_torque,
            "repeated_peak_Nm": row.repeated_peak,
            "momentary_peak_Nm": row.momentary_peak,
            "K1_Nm_rad": stiffness_of(row.size, row.ratio)["K1"],
            "transmission_accuracy_arcmin": stated_figures(row)[
                "transmission_accuracy_arcmin"
            ],
        }
        for row in named_rows()
    ]


def _design(name: str, _: str) -> dict[str, Any]:
    from swgjoint.gear.catalogue import ratings_of
    from swgjoint.gear.design.design import Design
    from swgjoint.units import mm

    design = Design.preset(name)
    drive, members = design.drive, (design.flexspline, design.circular_spline)
    profiles = [member.profile.kind for member in members]
    return {
        "name": name,
        "teeth": f"{drive.teeth_flexspline}/{drive.teeth_circular_spline}",
        "ratio": design.ratio,
        "module_mm": drive.module_mm,
        "pitch_diameter_mm": design.pitch_diameter / mm,
        "rated_torque_Nm": ratings_of(design).rated_torque,
        "profile": "/".join(dict.fromkeys(profiles)),
        "wave_generator": design.wave_generator.kind,
        "cup": None if design.cup is None else design.cup.kind,
        "source": drive.source,
    }


def _arm(name: str, _: str) -> dict[str, Any]:
    import numpy as np

    from swgjoint.sim.arm.rigid_arm import RigidArm

    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # a run repeats these warnings
        arm = RigidArm(name)
    tool = arm.tool_positions(np.zeros((1, len(arm.joints))))
    return {
        "name": name,
        "joints": list(arm.joints),
        "mass_kg": float(arm.model.body_mass.sum()),
        "tool_at_zero_m": tool[0].tolist() if tool.size else None,
        "effort_Nm": arm.effort,
    }


def _scene(name: str, _: str) -> dict[str, Any]:
    from swgjoint.sim.scene.scene import Scene

    scene = Scene.load_file(models_path() / "scenes" / f"{name}.toml")
    sections = (scene.defaults, *scene.joints.values())
    drives = [s.drive or ("linear" if s.linear else None) for s in sections]
    return {
        "name": name,
        "arm": scene.arm,
        "drives": sorted({drive for drive in drives if drive is not None}),
        "motion": scene.trajectory.kind,
        "duration_s": scene.simulation.duration_s,
        "description": scene.description,
    }


def _described(name: str, folder: str) -> dict[str, Any]:
    data = read_toml(models_path() / folder / f"{name}.toml", what=folder)
    return {"name": name, "description": data.get("description", "")}
