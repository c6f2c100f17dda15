"""One set of drives in a simulation: its scene, its figures and the missed limits."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from swgjoint.drives.sections import JointSection, LifeSection
from swgjoint.errors import ComputationError
from swgjoint.explore.compare.compare import Compared, missed_limits, row_of
from swgjoint.explore.select.loads import LIFE, MEAN, PEAK, LimitCheck
from swgjoint.explore.select.options import DriveOption
from swgjoint.explore.select.prediction import tool_jacobian
from swgjoint.sim.arm.scene import ROTOR_INERTIA
from swgjoint.sim.figures.keys import RIPPLE
from swgjoint.sim.run import Run
from swgjoint.sim.scene.scene import Scene

GOODMAN = "goodman_safety"
RESONANCE = "resonance_Hz"
TOOL = ("tool_path_rms_mm", "tool_ap_mm", "tool_rp_mm")
"""Figures of the tool."""
OF_ARM = (*TOOL, RESONANCE)
"""Figures of the whole arm; all others are figures of single joints."""
_OF_BEARING = {"L50_h", "L10_h", "rated_speed_rpm"}


@dataclass(frozen=True, kw_only=True)
class MissedLimit:
    """A limit that a simulated set misses."""

    joint: str | None
    """Joint; None for a figure of the whole arm."""
    check: LimitCheck
    """Figure and limit."""


@dataclass(frozen=True, kw_only=True, eq=False)
class SimulatedSet:
    """One set of drives in a simulation."""

    drives: dict[str, str]
    """Drive by joint."""
    cost: float
    """Cost of the set."""
    predicted: dict[str, float]
    """Predicted tool errors by key [mm]."""
    figures: dict[str, dict[str, Any]] = field(default_factory=dict)
    """Figures by joint and, under an empty name, of the whole arm; by key."""
    missed: tuple[MissedLimit, ...] = ()
    """Missed limits."""
    reasons: tuple[str, ...] = ()
    """Reasons why the run failed or is not valid, other than faults of joints."""
    faults: dict[str, str] = field(default_factory=dict)
    """Reasons by joint why the run is not valid."""
    run: Run | None = field(default=None, repr=False)
    """The run; None if it failed."""

    @property
    def met(self) -> bool:
        """Whether the run is valid and meets all limits."""
        return not (self.missed or self.reasons or self.faults)

    def to_json(self) -> dict[str, Any]:
        """Result under the keys of the JSON output."""
        return {
            "drives": self.drives,
            "cost": self.cost,
            "predicted": self.predicted,
            "tool": self.figures.get("", {}),
            "joints": {name: own for name, own in self.figures.items() if name},
            "met": self.met,
            "missed": [
                {"joint": miss.joint, **miss.check.to_json()} for miss in self.missed
            ],
            "reasons": [
                *self.reasons,
                *(f"{name}: {fault}" for name, fault in self.faults.items()),
            ],
        }


def scene_of_set(
    scene: Scene, joints: Sequence[str], options: Sequence[DriveOption]
) -> Scene:
    """The scene with a drive in every joint, and with its rotor and rated life.

    Args:
        scene: The scene.
        joints: Names of the joints.
        options: Their drives, in this order.
    """
    sections = dict(scene.joints)
    for name, option in zip(joints, options, strict=True):
        section = sections.get(name, JointSection()).with_drive(option.drive)
        inertia = option.rotor_inertia
        if inertia is None:
            inertia = scene.joint_settings(name).rotor_inertia_kgm2 or ROTOR_INERTIA
        changes: dict[str, Any] = {"rotor_inertia_kgm2": inertia}
        if option.life is not None:
            life = scene.joint_settings(name).life or LifeSection()
            fatigue = life.model_dump(exclude=_OF_BEARING, exclude_none=True)
            rated = option.life.model_dump(exclude_none=True)
            changes["life"] = LifeSection(**fatigue, **rated)
        sections[name] = section.model_copy(update=changes)
    return scene.model_copy(update={"joints": sections})


def evaluate_set(
    one: SimulatedSet, run: Run, spec: Mapping[str, float]
) -> SimulatedSet:
    """A simulated set with its figures and missed limits.

    Peak and mean torque are the larger ones of the motion and of the duty cycle.

    Args:
        one: The set without results.
        run: Its run.
        spec: Limits by figure.

    Raises:
        ComputationError: If bodies collide in the task.
    """
    metrics = run.metrics()
    if metrics["collisions"] and not run.assembly.scene.metrics.contacts_expected:
        raise ComputationError(f"{run.name}: {metrics['reasons'][0]}")
    figures: dict[str, dict[str, Any]] = {}
    missed = []
    at_rest = _without_ripple(metrics["joints"])
    for name in ("", *run.joints):
        keys = [key for key in spec if (key in OF_ARM) == (not name)]
        row = row_of(run.name, run, None, level=None, of=[name] if name else [])
        if name:
            row = _with_cycle(row, metrics["joints"][name])
        figures[name] = {key: row.figure(key) for key in keys}
        unlimited = name and metrics["joints"][name]["life"]["bearing"]["unlimited"]
        for key in missed_limits(row, {key: spec[key] for key in keys}):
            if (key == LIFE and unlimited) or (key in RIPPLE and name in at_rest):
                continue
            value = figures[name][key]
            why = row.ripple_missing if key in RIPPLE else None
            if row.is_lower_bound(key) and not why:
                why = "a lower bound, because the step leaves out orders of the drive"
            if name and key == GOODMAN:
                why = metrics["joints"][name]["life"]["flexspline"]["missing"]
            check = LimitCheck(key=key, value=value, limit=spec[key], reason=why or "")
            missed.append(MissedLimit(joint=name or None, check=check))
    faults: dict[str, str] = {}
    for reason in metrics["reasons"]:
        for name in run.joints:
            if reason.startswith(f"{name}: "):
                faults.setdefault(name, reason.removeprefix(f"{name}: "))
    return replace(
        one,
        figures=figures,
        missed=tuple(missed),
        reasons=() if faults else tuple(metrics["reasons"]),
        faults=faults,
        run=run,
    )


def _without_ripple(joints: Mapping[str, Any]) -> set[str]:
    """Joints without ripple, if others have some, such as joints that rest.

    They meet every limit of the ripple, as in a comparison, which judges the largest
    one. Joints whose orders the step leaves out do not.

    Args:
        joints: Figures of the joints.
    """
    none = {name for name, of in joints.items() if of["ripple_missing"] is not None}
    left_out = {name for name in none if joints[name]["ripple_left_out_percent"] > 0.0}
    return none - left_out if len(none) < len(joints) else set()


def _with_cycle(row: Compared, joint: Mapping[str, Any]) -> Compared:
    """The row of one joint whose torques include all tasks of the duty cycle."""
    ratings, life = joint["ratings"], joint["life"]
    peak = life["peak_Nm"] / ratings["repeated_peak_Nm"]
    mean = (life["cubed_mean_Nm"] or 0.0) / ratings["rated_Nm"]
    return replace(
        row,
        **{
            PEAK: max(row.peak_torque_of_rating, peak),
            MEAN: max(row.cubed_mean_torque_of_rating, mean),
        },
    )


def tool_shares(run: Run) -> dict[str, float]:
    """Share of each joint in the mean square of the tool error; their sum is about 1.

    Args:
        run: A run of an arm with a tool.
    """
    step = max(1, len(run.time) // 400)
    columns = tool_jacobian(run.assembly.arm, run.reference[::step])
    off = (run.position - run.reference)[::step]
    error = (run.tool_position - run.tool_reference)[::step]
    parts = np.einsum("nkj,nj,nk->j", columns, off, error)
    total = float((error**2).sum())
    return dict(zip(run.joints, (parts / total).tolist(), strict=True))
