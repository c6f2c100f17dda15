"""A compiled scene at another time step, without compiling it again."""

from __future__ import annotations

from copy import copy
from dataclasses import replace

from swgjoint.joint.step_damping import compensation
from swgjoint.sim.assembly import Assembly
from swgjoint.sim.assembly_steps import plan_torques, prescribed_errors
from swgjoint.sim.motion.commanded import trajectory_of
from swgjoint.sim.run_memory import require_run_memory
from swgjoint.sim.stepping import skip_idle_stages


def at_step(assembly: Assembly, step: float) -> Assembly:
    """The same drives and the same motion at a shorter step, without its duty cycle.

    The drives keep their orders, although a shorter step would resolve more of them.
    The stability region is not checked: it contains all steps below one that it
    contains.

    Args:
        assembly: The compiled scene; its arrays are shared, its model is copied.
        step: Step of the scene and of the engine [s], at most that of the engine in
            ``assembly``.

    Raises:
        InputError: If another time of the scene is not a multiple of the step.
        ComputationError: If the run would not fit in memory.
    """
    assert step <= assembly.step
    scene = assembly.scene.with_changes({"simulation.step_s": step, "cycle": []})
    arm, known_arm = assembly.arm, assembly.known_arm
    require_run_memory(scene, len(arm.joints))
    trajectory = trajectory_of(scene, arm)
    model = skip_idle_stages(assembly.model)
    if model is assembly.model:
        model = copy(model)
    model.opt.timestep = step
    transmissions = []
    for transmission in assembly.transmissions:
        drive = transmission.attached
        if drive.compensated:
            taken = compensation(drive, step)
            model.tendon_damping[model.tendon(drive.tendon).id] = drive.damping - taken
            drive = replace(drive, compensated=taken, compensated_at=step)
        transmissions.append(replace(transmission, attached=drive))
    link_torque, feedforward = plan_torques(
        scene, arm, known_arm, trajectory, transmissions, assembly.load, 1
    )
    prescribed, prescribed_rate = prescribed_errors(
        trajectory.position,
        transmissions,
        step=step,
        discrete=scene.simulation.integrator == "discrete",
    )
    return replace(
        assembly,
        scene=scene,
        sub_steps=1,
        outside={},
        model=model,
        transmissions=tuple(transmissions),
        trajectory=trajectory,
        link_torque=link_torque,
        feedforward=feedforward,
        prescribed=prescribed,
        prescribed_rate=prescribed_rate,
    )
