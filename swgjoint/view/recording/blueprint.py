"""Default layout of a recording: a view of the arm and one tab of plots per joint."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from swgjoint.sim.figures.metrics import strongest_left_out, torque_deviation
from swgjoint.view.recording.drive_view import drives_shown, eye, fields_of
from swgjoint.view.recording.joint_pictures import WIDTH
from swgjoint.view.recording.paths import drive_path, joint_path, phase_plot, prefix_of

if TYPE_CHECKING:
    from swgjoint.sim.assembly import Assembly
    from swgjoint.sim.figures.transmission import Transmission
    from swgjoint.sim.run import Run

BACKGROUND = (30, 33, 38)
"""RGB colour behind the arm."""
TITLES = {
    "torsion_arcmin": "torsion [arcmin]",
    "transmission_error_arcmin": "transmission error [arcmin]",
    "output_torque_Nm": "output torque [N·m]",
    "torque_deviation_Nm": "output torque minus rigid-arm torque [N·m]",
    "motor_torque_Nm": "motor torque [N·m]",
    "position_deg": "link angle [deg]",
    "reference_deg": "commanded angle [deg]",
}
"""Titles of the plots by signal."""
ZERO = ("torsion_arcmin", "transmission_error_arcmin", "torque_deviation_Nm")
"""Signals that are zero for a rigid arm; their plots therefore omit rigid runs."""
SPACING = 0.75
"""Distance between the arms of neighbouring runs [m]."""


def blueprint_of(scenes: Mapping[str, Assembly], joints: list[str]) -> Any:
    """Layout for runs of one motion.

    The entity paths are those of :mod:`swgjoint.view.recording.entities`.

    Args:
        scenes: Scenes by name of the run.
        joints: Names of the joints in the order of their tabs.

    Returns:
        A rerun blueprint.
    """
    import rerun.blueprint as rrb

    first = next(iter(scenes.values()))
    prefixes = {label: f"/{prefix_of(label)}" for label in scenes}
    flexible = [k for k, scene in scenes.items() if not all_rigid(scene)]
    flexible = flexible or list(scenes)

    def plot(joint: str, title: str, signal: str, labels: Iterable[str]) -> Any:
        paths = [f"/{joint_path(joint, label)}" for label in labels]
        return _plot(title, paths, signal)

    bounds = rrb.VisualBounds2D(
        x_range=[-1.2 * WIDTH, 1.35 * WIDTH], y_range=[-1.2, 1.2]
    )
    tabs = []
    for joint in joints:
        j = first.joints.index(joint)
        pictures = []
        if any(scene.trajectory.steady_velocity[j] for scene in scenes.values()):
            bars = [f"/{joint_path(joint, label)}/ripple_orders" for label in flexible]
            title = "torque ripple over order per input turn [% of rated torque]"
            pictures.append(
                rrb.BarChartView(
                    name=title,
                    contents=[f"+ {path}" for path in bars],
                    plot_legend=rrb.PlotLegend(corner=rrb.Corner2D.LeftTop),
                )
            )
        if any(has_torsion(scene.transmissions[j]) for scene in scenes.values()):
            pictures.append(
                rrb.Spatial2DView(
                    name="torque against torsion",
                    origin=f"/{phase_plot(joint)}",
                    contents="$origin/**",
                    visual_bounds=bounds,
                )
            )
        views = [
            plot(joint, TITLES[signal], signal, flexible if signal in ZERO else scenes)
            for signal in first.scene.recording.plots
        ]
        name = joint.removesuffix("_joint")
        tabs.append(rrb.Grid(*views, *pictures, grid_columns=2, name=name))
    right: list[Any] = [rrb.Tabs(*tabs, active_tab=0)]
    if first.arm.tool >= 0:
        paths = [f"{prefixes[label]}tool/error_mm" for label in flexible]
        right.append(_plot("tool error [mm]", paths))
    left: list[Any] = [
        rrb.Spatial3DView(
            name=first.scene.name,
            contents=[
                *(f"+ {p}**" for p in prefixes.values()),
                "- /drive/**",
                "- /phase/**",
            ],
            eye_controls=_eye(scenes),
            line_grid=True,
            background=BACKGROUND,
        )
    ]
    drives = [
        _drive(scenes[label], joint, label)
        for label, joint in drives_shown(scenes, joints).items()
    ]
    if drives:
        left.append(rrb.Tabs(*drives, active_tab=0))
    return rrb.Blueprint(
        rrb.Horizontal(
            rrb.Vertical(*left),
            rrb.Vertical(*right, row_shares=[4.0, 1.0][: len(right)]),
            column_shares=[1.0, 1.6],
        ),
        rrb.TimePanel(state="collapsed", timeline="time"),
        rrb.SelectionPanel(state="hidden"),
        rrb.BlueprintPanel(state="hidden"),
        auto_views=False,
        auto_layout=False,
    )


def is_rigid(run: Run) -> bool:
    """Whether every joint of a run is rigid."""
    return all_rigid(run.assembly)


def all_rigid(assembly: Assembly) -> bool:
    """Whether every joint of a scene is rigid."""
    return all(t.level == "rigid" for t in assembly.transmissions)


def has_torsion(transmission: Transmission) -> bool:
    """Whether a joint has compliance between motor and link."""
    return transmission.law is not None


def joints_shown(scenes: Mapping[str, Assembly]) -> list[str]:
    """Joints named in the scene's recording layout, or else all, most loaded first.

    The load is the largest torque of the rigid arm on the commanded motion, relative to
    the rated torque. Joints whose strongest order is not resolved come last. The
    sequence does not depend on simulated results, so it is known before a run.
    """
    first = next(iter(scenes.values()))
    if first.scene.recording.joints:
        return list(first.scene.recording.joints)

    def key(j: int) -> tuple[bool, float]:
        drives = [scene.transmissions[j] for scene in scenes.values()]
        load = max(
            float(np.abs(scene.link_torque[:, j]).max())
            / scene.transmissions[j].drive.ratings.rated_torque
            for scene in scenes.values()
        )
        return any(strongest_left_out(drive) for drive in drives), -load

    return [first.joints[j] for j in sorted(range(len(first.joints)), key=key)]


def joints_by_interest(runs: Mapping[str, Run]) -> list[str]:
    """All joints, sorted by the peak to peak of their torque deviation, largest first.

    The deviation [N·m] is that of :func:`swgjoint.sim.figures.metrics.torque_deviation`
    in the part of the motion that the figures use. Joints whose strongest order is not
    resolved come last.
    """
    first = next(iter(runs.values()))
    window = first.steady

    def key(j: int) -> tuple[bool, float]:
        left_out = any(
            strongest_left_out(run.assembly.transmissions[j]) for run in runs.values()
        )
        swing = max(
            float(np.ptp(torque_deviation(run, j)[window])) for run in runs.values()
        )
        return left_out, -swing

    return [first.joints[j] for j in sorted(range(len(first.joints)), key=key)]


def _plot(title: str, paths: list[str], signal: str | None = None) -> Any:
    """View of lines over time.

    Args:
        title: Title of the view.
        paths: Entity paths, one per line.
        signal: Component to draw; None for the component of the archetype ``Scalars``.
    """
    import rerun as rr
    import rerun.blueprint as rrb
    from rerun.blueprint.encodings import (
        ComponentSourceKind,
        VisualizerComponentMapping,
    )

    drawn = {}
    if signal is not None:
        source = VisualizerComponentMapping(
            "Scalars:scalars",
            ComponentSourceKind.SourceComponent,
            source_component=signal,
        )
        drawn = {p: rr.SeriesLines().visualizer(mappings=[source]) for p in paths}
    # a single line needs no particular legend, because the title describes it
    legend = rrb.PlotLegend(corner=rrb.Corner2D.RightTop) if len(paths) > 1 else None
    return rrb.TimeSeriesView(
        name=title,
        contents=[f"+ {path}" for path in paths],
        overrides=drawn,
        plot_legend=legend,
        axis_x=rrb.TimeAxis(link=rrb.components.LinkAxis.LinkToGlobal),
    )


def _drive(assembly: Assembly, joint: str, label: str) -> Any:
    """View of the drive of a joint; the camera of :func:`eye` looks at it."""
    import rerun.blueprint as rrb

    fields = fields_of(assembly, joint)
    assert fields is not None
    name = f"drive of {joint.removesuffix('_joint')}"
    return rrb.Spatial3DView(
        name=f"{name}, {label}" if label else name,
        origin=f"/{drive_path(joint, label)}",
        contents="$origin/**",
        eye_controls=eye(fields),
        line_grid=False,
        background=BACKGROUND,
    )


def _eye(scenes: Mapping[str, Assembly]) -> Any:
    """Camera in front of all arms, slightly to one side of them and above."""
    import rerun.blueprint as rrb

    model = next(iter(scenes.values())).arm.model
    reach = max(0.4, float(model.stat.extent))
    distance = 1.1 * reach + 0.42 * SPACING * (len(scenes) - 1)
    target = [0.25 * reach, 0.0, 0.28 * reach]
    return rrb.EyeControls3D(
        position=[
            target[0] + 1.25 * distance,
            -0.45 * distance,
            target[2] + 0.55 * distance,
        ],
        look_target=target,
        eye_up=[0.0, 0.0, 1.0],
    )
