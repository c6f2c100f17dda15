"""Memory demand of a run, which grows with its steps and joints."""

from __future__ import annotations

from swgjoint.memory import require_memory
from swgjoint.sim.scene.scene import Scene

BYTES = 8
"""Size of a floating-point number [B]."""
STEP, STEP_AND_JOINT = 75, 32
"""Floating-point numbers in memory per recorded step, and per recorded step and joint,
while the signals and figures of a run are computed. Measurements gave 102 per step for
one joint and 250 per step for six joints with 28 harmonics each. A recording is written
in parts and needs no additional memory per step."""
SUB_STEP_AND_JOINT = 12
"""Floating-point numbers per joint and additional engine step: motion, torques, inputs
and speeds."""
VIEWER = 0.15e9
"""Memory that the library for writing recordings uses [B]."""


def required_memory(scene: Scene, joints: int, *, sub_steps: int = 1) -> float:
    """Estimated memory that a run needs in addition to the memory in use before it [B].

    Args:
        scene: The scene, which states duration and step.
        joints: Number of driven joints.
        sub_steps: Engine steps per step of the scene.
    """
    steps = scene.simulation.duration_s / scene.simulation.step_s
    each = STEP + STEP_AND_JOINT * joints
    each += SUB_STEP_AND_JOINT * joints * (sub_steps - 1)
    return VIEWER + BYTES * steps * each


def require_run_memory(scene: Scene, joints: int, *, sub_steps: int = 1) -> None:
    """Reject a run that would not fit in memory, before its computation starts.

    Args:
        scene: The scene, which states duration and step.
        joints: Number of driven joints.
        sub_steps: Engine steps per step of the scene.

    Raises:
        ComputationError: If the memory is not sufficient; the message states required
            and free memory.
    """
    section = scene.simulation
    cut = f" in {sub_steps} sub-steps each" if sub_steps > 1 else ""
    require_memory(
        f"{scene.where}: simulation.duration_s = {section.duration_s:g} s with steps of"
        f" {section.step_s:g} s{cut} and {joints} joints",
        required_memory(scene, joints, sub_steps=sub_steps),
        less="a shorter duration_s or a longer step_s",
    )
