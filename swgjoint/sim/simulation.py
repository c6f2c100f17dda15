"""Simulation of a scene: the controlled arm, recorded at every step."""

from __future__ import annotations

import time
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
from mujoco.rollout import Rollout

from swgjoint.errors import ComputationError, InputError
from swgjoint.maps.drive_map import DriveMap
from swgjoint.progress import Progress, silent
from swgjoint.sim.actuators import control_inputs, limit_torque, wanted_torque
from swgjoint.sim.assembly import Assembly, assemble
from swgjoint.sim.controller import Controller, KnownArm
from swgjoint.sim.equilibrium import set_start
from swgjoint.sim.run import Run
from swgjoint.sim.sampled_loop import GivenLoop, Loop, SampledLoop, run_sampled
from swgjoint.sim.scene.scene import Scene
from swgjoint.sim.scene.task import task_of
from swgjoint.sim.stepping import skip_idle_stages
from swgjoint.sim.thermal import Warming
from swgjoint.typing import Array

_CHUNK = 1000  # approximate number of engine steps between two progress reports
_STATE = mujoco.mjtState.mjSTATE_FULLPHYSICS


def prepare_scene(
    scene: Scene | str | Path,
    *,
    overrides: Mapping[str, Any] | Iterable[str] | None = None,
    drives: Mapping[str, DriveMap] | None = None,
    controller: Controller | None = None,
    known_drives: Mapping[str, DriveMap] | None = None,
    known_arm: KnownArm | None = None,
    progress: Progress = silent,
) -> tuple[Assembly, Loop | None]:
    """Compile a scene and prepare its external controller, if there is one.

    Args:
        scene: The scene, or the path or bundled name of a scene file.
        overrides: Changes of the scene, see :meth:`Scene.load_file`.
        drives: Maps by drive reference, used instead of loading or building them.
        controller: External controller; None runs the scene's own controller.
        known_drives: Drive maps in the controller's model, by joint.
        known_arm: Arm in the controller's model; None uses the arm of the scene.
        progress: Called while maps are built.

    Returns:
        The compiled scene, and the loop of the external controller, or None without
        one.

    Raises:
        InputError: If the scene is not valid, or if ``known_drives`` or ``known_arm``
            is given without a controller.
        ComputationError: If a joint needs more sub-steps than the scene accepts.
    """
    if not isinstance(scene, Scene):
        scene = Scene.load_file(scene, overrides)
    elif overrides:
        scene = scene.with_changes(overrides)
    assembly = assemble(
        scene,
        drives=drives,
        controlled_by=None if controller is None else type(controller).__name__,
        progress=progress,
    )
    loop: Loop | None = None
    if controller is not None:
        loop = GivenLoop(
            assembly, controller, task_of(assembly, known_drives, known_arm)
        )
    elif known_drives or known_arm is not None:
        argument = "known_drives" if known_drives else "known_arm"
        raise InputError(
            f"{argument} is used by an external controller only; accepted:"
            " together with controller"
        )
    return assembly, loop


@contextmanager
def _without_log_file() -> Iterator[None]:
    """Prevent the engine from writing warnings to ``MUJOCO_LOG.TXT``.

    The file would remain in the working folder, although the run reports the causes of
    these warnings itself. They still appear on the console.
    """
    config = mujoco.MjLogConfig.get()
    before, config.logto_file = config.logto_file, False
    config.set()
    try:
        yield
    finally:
        config.logto_file = before
        config.set()


@_without_log_file()
def simulate(
    assembly: Assembly,
    *,
    name: str,
    loop: Loop | None = None,
    progress: Progress = silent,
) -> Run:
    """Run an assembled scene and record it; see :func:`swgjoint.run_scene`.

    Args:
        assembly: The compiled scene.
        name: Name of the run.
        loop: Loop of an external controller; None runs the scene's own controller.
        progress: Called with the number of completed steps.

    Returns:
        The recorded run.

    Raises:
        InputError: If bodies are in contact at the start, so that no drive can hold
            them.
        ComputationError: If the motion diverges or the start has no equilibrium.
    """
    model, path = skip_idle_stages(assembly.model), assembly.trajectory
    inputs = control_inputs(assembly)
    data = mujoco.MjData(model)
    set_start(assembly, data)
    state = np.empty(mujoco.mj_stateSize(model, _STATE))
    mujoco.mj_getState(model, data, state, _STATE)
    warming = Warming(assembly)

    if assembly.loops.sampled:
        begin = time.perf_counter()
        states, rates, wanted = run_sampled(
            assembly,
            loop or SampledLoop(assembly),
            model,
            data,
            inputs,
            warming=warming,
            check=lambda data, new: _check_finite(assembly, data, new),
            progress=lambda done: progress(f"run {name}", done, len(inputs)),
        )
        wall = time.perf_counter() - begin
        return _recorded(assembly, name, states, rates, wall, warming, wanted=wanted)

    # the engine's rollout runs without Python between steps and records every state
    steps, parts = len(inputs), assembly.sub_steps
    states = np.empty((steps // parts + 1, state.size))
    states[0] = state
    speeds = 1 + model.nq + assembly.link_velocity
    rates = np.empty((path.time.size, speeds.size))
    rates[0] = state[speeds]
    chunk = parts * (warming.every or max(1, _CHUNK // parts))
    begin = time.perf_counter()
    with Rollout(nthread=0) as rollout:
        for first in range(0, steps, chunk):
            last = min(first + chunk, steps)
            rolled, _ = rollout.rollout(
                model,
                data,
                states[first // parts][None],
                inputs[None, first:last],
                initial_warmstart=data.qacc_warmstart[None],
            )
            kept = slice(first // parts + 1, last // parts + 1)
            states[kept] = rolled[0, parts - 1 :: parts]
            rates[first + 1 : last + 1] = rolled[0][:, speeds]
            _check_finite(assembly, data, rolled[0])
            if warming.every:
                interval = states[first // parts : last // parts + 1]
                model, data = warming.advance(model, data, interval)
            progress(f"run {name}", last, steps)
    wall = time.perf_counter() - begin
    return _recorded(assembly, name, states, rates, wall, warming)


def _check_finite(assembly: Assembly, data: mujoco.MjData, states: Array) -> None:
    """Raise an error if a run diverged, because the engine would reset and continue."""
    from swgjoint.sim.loop_stability import explain_divergence

    nq, nv = assembly.model.nq, assembly.model.nv
    if data.warning[mujoco.mjtWarning.mjWARN_BADCTRL].number:
        cause = explain_divergence(assembly)
        raise ComputationError(
            f"scene {assembly.scene.name!r}: {f'{cause}; ' if cause else ''}before"
            f" t = {states[-1, 0]:.3f} s the command of a motor or a disturbance"
            " exceeded 1e10, which the engine does not apply; use lower controller"
            " gains"
        )
    if data.warning[mujoco.mjtWarning.mjWARN_INERTIA].number:
        raise ComputationError(
            f"scene {assembly.scene.name!r}: before t = {states[-1, 0]:.3f} s the"
            " engine could not solve for the accelerations: the masses of the arm"
            " differ too much, or its inertia matrix is close to singular; see"
            " mjWARN_INERTIA in the MuJoCo documentation"
        )
    bad = any(
        data.warning[kind].number
        for kind in (
            mujoco.mjtWarning.mjWARN_BADQPOS,
            mujoco.mjtWarning.mjWARN_BADQVEL,
            mujoco.mjtWarning.mjWARN_BADQACC,
        )
    )
    speed = np.abs(states[:, 1 + nq : 1 + nq + nv])
    if bad or not np.isfinite(states).all() or speed.max() > 1e6:
        if (cause := explain_divergence(assembly)) is not None:
            raise ComputationError(f"scene {assembly.scene.name!r}: {cause}")
        step, integrator = assembly.step, assembly.scene.simulation.integrator
        other = "lower gains" if integrator == "discrete" else "integrator discrete"
        # the engine restarts at t = 0 after it has diverged
        raise ComputationError(
            f"scene {assembly.scene.name!r}: the motion diverged before"
            f" t = {states[:, 0].max() + step:.3f} s with a step of {step:g} s and"
            f" integrator {integrator}; use a smaller simulation.step_s or {other}"
        )


def _recorded(
    whole: Assembly,
    name: str,
    states: Array,
    rates: Array,
    wall: float,
    warming: Warming,
    *,
    wanted: Array | None = None,
) -> Run:
    """Signals of all joints from the recorded states.

    Args:
        whole: The scene as it was run.
        name: Name of the run.
        states: Full engine states, one per step of the scene. Shape (n, n_state).
        rates: Link speeds at every engine step [rad/s]. Shape (n_steps + 1, n_joints).
        wall: Wall time of all steps [s].
        warming: Temperatures of the drives during the run.
        wanted: Motor torque that a sampled loop requested at every engine step [N·m],
            shape (n_steps + 1, n_joints); None for the engine's own loops.
    """
    assembly, ratio = whole.without_sub_steps(), whole.ratio
    model, path = assembly.model, assembly.trajectory
    q = states[:, 1 : 1 + model.nq]
    v = states[:, 1 + model.nq : 1 + model.nq + model.nv]
    position, velocity = q[:, assembly.link_position], v[:, assembly.link_velocity]
    flexible = assembly.motor_position >= 0
    theta = ratio * (position - assembly.prescribed)
    theta_rate = ratio * (velocity - assembly.prescribed_rate)
    theta[:, flexible] = q[:, assembly.motor_position[flexible]]
    theta_rate[:, flexible] = v[:, assembly.motor_velocity[flexible]]

    if wanted is None:
        integral = _integrals(assembly, states)
        commanded = wanted_torque(whole, theta, theta_rate, integral)
    else:
        commanded = np.stack(2 * [wanted[:: whole.sub_steps]])
    speed = theta_rate
    if assembly.scene.simulation.integrator != "discrete":
        speed = np.diff(theta, axis=0) / np.diff(path.time)[:, None]
        speed = np.vstack([speed[:1], speed])
    motor = np.stack(
        [
            limit_torque(commanded[:, :, j], speed[:, j], limits)
            for j, limits in enumerate(assembly.loops.limits)
        ],
        axis=-1,
    ).mean(axis=0)
    wanted = commanded.mean(axis=0)
    # without a rotor the output torque is the motor torque, minus the torque that
    # accelerates the rotor inertia, times the ratio; the acceleration consistent with
    # the integrator is the velocity difference of the step that led to the state
    ideal = ratio * (rates - whole.prescribed_rate)
    slowing = np.diff(ideal, axis=0, prepend=ideal[:1])[:: whole.sub_steps] / whole.step
    output = ratio * (motor - assembly.rotor_inertia * slowing)
    torsion, slipping, friction = np.zeros((3, *position.shape))
    error, stored = assembly.prescribed.copy(), np.zeros(len(assembly.joints))
    # the discrete integrator's positions are half a step ahead of its velocities
    ahead = 0.0
    if assembly.scene.simulation.integrator == "discrete":
        ahead = 0.5 * whole.step
    for j in np.flatnonzero(flexible):
        signals = assembly.transmissions[j].signals(
            theta[:, j] - ahead * theta_rate[:, j],
            position[:, j] - ahead * velocity[:, j],
            theta_rate[:, j],
            velocity[:, j],
            course=warming.course(int(j)),
        )
        torsion[:, j], error[:, j] = signals.torsion, signals.transmission_error
        output[:, j], stored[j] = signals.torque, signals.stored
        slipping[:, j], friction[:, j] = signals.slipping, signals.friction
    return Run(
        name=name,
        assembly=assembly,
        joints=assembly.joints,
        time=path.time,
        position=position,
        velocity=velocity,
        motor_position=theta,
        motor_velocity=theta_rate,
        reference=path.position,
        torsion=torsion,
        transmission_error=error,
        output_torque=output,
        motor_torque=motor,
        wanted_torque=wanted,
        slipping_torque=slipping,
        hysteresis_energy=stored,
        friction_torque=friction,
        tool_position=_tool_positions(assembly, q),
        tool_reference=assembly.arm.tool_positions(path.position),
        wall=wall,
        tilt=q[:, assembly.tilt_position],
        tilt_velocity=v[:, assembly.tilt_velocity],
        heat=warming.heat(),
    )


def _tool_positions(assembly: Assembly, q: Array) -> Array:
    """Tool positions of a run, with the tilts of the output bearings [m].

    Args:
        assembly: The scene as it was run.
        q: Positions of its model. Shape (n, nq).

    Returns:
        Positions in the world. Shape (n, 3), or (n, 0) without a tool.
    """
    arm, model = assembly.arm, assembly.model
    if not assembly.bearings or arm.tool < 0:
        return arm.tool_positions(q[:, assembly.link_position])
    data, out = mujoco.MjData(model), np.empty((len(q), 3))
    place = data.site(assembly.scene.tool_site).xpos
    for k, positions in enumerate(q):
        data.qpos[:] = positions
        mujoco.mj_kinematics(model, data)
        out[k] = place
    return out


def _integrals(assembly: Assembly, states: Array) -> Array:
    """Integral of the angle error in the engine's loops [rad·s]. Shape (n, n_joints).

    With the integrator ``discrete`` it is the integral that acted in the step to the
    state, because the engine updates the integral after it has computed the forces.
    """
    model = assembly.model
    integral = np.zeros((len(states), len(assembly.joints)))
    first = 1 + model.nq + model.nv
    for j in np.flatnonzero(assembly.loops.integral):
        address = model.actuator_actadr[j]
        if address >= 0:
            integral[:, j] = states[:, first + address]
    if assembly.scene.simulation.integrator == "discrete":
        integral[1:] = integral[:-1].copy()
    return integral
