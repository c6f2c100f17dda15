"""Memory that a run takes: it grows with its steps and with the joints of the arm."""

from __future__ import annotations

from swgjoint.memory import require_memory
from swgjoint.sim.scene.scene import Scene

BYTES = 8
STEP, STEP_AND_JOINT = 75, 32
"""Numbers that live at once for every recorded step, and for every joint at it, while
the signals and figures of a run are computed. Measured: 102 for one joint, 250 for
six with 28 harmonics each; a recording is written in parts and adds none."""
SUB_STEP_AND_JOINT = 12
"""The same for every further step of the engine: motion, torques, inputs, speeds."""
VIEWER = 0.15e9
"""The library that writes recordings [B]."""


def required_memory(scene: Scene, joints: int, *, sub_steps: int = 1) -> float:
    """Estimate of what a run takes beyond a process that has read its scene [B].

    Args:
        scene: The scene, for its duration and step.
        joints: Driven joints of the arm.
        sub_steps: Steps of the engine per step of the scene.
    """
    steps = scene.simulation.duration_s / scene.simulation.step_s
    each = STEP + STEP_AND_JOINT * joints
    each += SUB_STEP_AND_JOINT * joints * (sub_steps - 1)
    return VIEWER + BYTES * steps * each


def require_run_memory(scene: Scene, joints: int, *, sub_steps: int = 1) -> None:
    """Refuse a run that would not fit, before anything is computed for it.

    Args:
        scene: The scene.
        joints: Driven joints of the arm.
        sub_steps: Steps of the engine per step of the scene.

    Raises:
        ComputationError: With the memory that it needs and that which is free.
    """
    section = scene.simulation
    cut = f" in {sub_steps} sub-steps each" if sub_steps > 1 else ""
    require_memory(
        f"{scene.where}: simulation.duration_s = {section.duration_s:g} s with steps of"
        f" {section.step_s:g} s{cut} and {joints} joints",
        required_memory(scene, joints, sub_steps=sub_steps),
        less="a shorter duration_s or a longer step_s",
    )
