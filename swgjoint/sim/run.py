"""Run a scene: the arm under its controller, recorded at every step."""

from __future__ import annotations

import time
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager
from copy import deepcopy
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
from mujoco.rollout import Rollout
from numpy.typing import NDArray

from swgjoint.errors import ComputationError, InputError
from swgjoint.files import attempting
from swgjoint.maps.drive_map import DriveMap
from swgjoint.progress import Progress, silent
from swgjoint.sim.actuators import control_inputs, limited, wanted_torque
from swgjoint.sim.assembly import Assembly, assemble
from swgjoint.sim.controller import Controller, KnownArm
from swgjoint.sim.equilibrium import set_start
from swgjoint.sim.figures.contains import contents
from swgjoint.sim.figures.metrics import run_metrics
from swgjoint.sim.sampled_loop import GivenLoop, Loop, SampledLoop, run_sampled
from swgjoint.sim.scene.scene import Scene
from swgjoint.sim.scene.task import task_of

Array = NDArray[np.float64]

_CHUNK = 1000  # steps of the engine between two signs of life
_STATE = mujoco.mjtState.mjSTATE_FULLPHYSICS


@dataclass(frozen=True, kw_only=True, eq=False)
class Run:
    """A recorded run; arrays hold every state, the first included.

    Angles and torques at the output side unless named motor; n states, joints in the
    order of ``joints``. Torques and torsions are the drive's law at the recorded state;
    the motor's torque is the mean over the step that led to it.
    """

    name: str
    assembly: Assembly
    joints: tuple[str, ...]
    time: Array
    """[s]. Shape (n,)."""
    position: Array
    """Link angles [rad]. Shape (n, n_joints)."""
    velocity: Array
    """Link speeds [rad/s]. Shape (n, n_joints)."""
    motor_position: Array
    """Input angles [rad]; without a rotor those that the gear, ideal or with its
    prescribed error, gives the link angles. Shape (n, n_joints)."""
    motor_velocity: Array
    """[rad/s]. Shape (n, n_joints)."""
    reference: Array
    """Commanded link angles [rad]. Shape (n, n_joints)."""
    torsion: Array
    """[rad]. Shape (n, n_joints)."""
    transmission_error: Array
    """Output minus ideal output [rad]. Shape (n, n_joints)."""
    output_torque: Array
    """That the drive exerts on the link [N·m]. Shape (n, n_joints)."""
    motor_torque: Array
    """[N·m]. Shape (n, n_joints)."""
    wanted_torque: Array
    """What the controller asked the motors for, without limits [N·m]. Same shape."""
    slipping_torque: Array
    """Of the hysteresis, along the torsion [N·m]; 0 where there is none. Same shape."""
    friction_torque: Array
    """Of the wave generator against the flexspline [N·m]. Same shape."""
    tool_position: Array
    """Tool in the world [m]. Shape (n, 3), or (n, 0) where the arm has no tool."""
    tool_reference: Array
    """Tool on the commanded motion without any error [m]. Same shape."""
    wall: float
    """Time that the steps took [s]."""
    recording: Path | None = None
    """The recording for the viewer that was written with the run."""

    @property
    def steps_per_second(self) -> float:
        """Recorded steps, each with its sub-steps, per second of wall time."""
        return (self.time.size - 1) / self.wall

    @property
    def steady(self) -> slice:
        """Samples of the constant-speed part."""
        return self.assembly.trajectory.steady

    @property
    def contains(self) -> dict[str, Any]:
        """What the compiled model contains, and what was left out and why."""
        return contents(self.assembly)

    def tool_error(self, other: Run | None = None) -> Array:
        """Distance of the tool from that of another run [m]. Shape (n,).

        Args:
            other: A run of the same motion, usually the rigid arm; None compares with
                the commanded path.
        """
        reference = self.tool_reference if other is None else other.tool_position
        return np.asarray(np.linalg.norm(self.tool_position - reference, axis=1))

    def metrics(self) -> dict[str, Any]:
        """Figures of the run under the keys of ``swgjoint run --json``."""
        return deepcopy(self._figures)

    @cached_property
    def _figures(self) -> dict[str, Any]:
        return run_metrics(self)

    def to_rerun(self, path: str | Path) -> Path:
        """Write the recording for the rerun viewer; see :mod:`swgjoint.view`."""
        from swgjoint.view.recording.recording import write_recording

        return write_recording({"": self}, path)


def run_scene(
    scene: Scene | str | Path,
    *,
    overrides: Mapping[str, Any] | Iterable[str] | None = None,
    drives: Mapping[str, DriveMap] | None = None,
    controller: Controller | None = None,
    known_drives: Mapping[str, DriveMap] | None = None,
    known_arm: KnownArm | None = None,
    name: str | None = None,
    recording: str | Path | None = None,
    progress: Progress = silent,
) -> Run:
    """Simulate a scene from an equilibrium to its end.

    A step that lies outside the region in which a joint's integration holds is cut into
    ``run.assembly.sub_steps`` equal parts; the run records the scene's steps.

    Args:
        scene: A scene, the path of a scene file, or the name of a bundled one.
        overrides: Dotted keys of the scene with other values, as a mapping or as
            ``key=value`` texts.
        drives: Maps that stand for the scene's drive references of these names.
        controller: Drives the motors in place of the scene's own law, once a control
            period on what the sensors of the scene read; limits of the motors,
            payload, disturbances and start stay the scene's. It reads the link angle
            where ``controller.feedback`` is ``link``, the output torque where
            ``sensors.torque`` is there.
        known_drives: What that controller takes the drives of some joints for; others
            are told as they are simulated.
        known_arm: What it takes the arm for, for instance
            :class:`swgjoint.control.pinocchio_arm.PinocchioArm`, whose torques its
            feed-forward then has; None: the scene's arm, with its payload if known.
        name: What recordings and progress call the run; default: the scene's name.
        recording: File that receives the recording for the viewer, like
            :meth:`Run.to_rerun` but begun while the steps are taken; a recording that
            cannot be written is an ``OutputWarning``, the run stands.
        progress: Called with the steps done.

    Raises:
        InputError: If the scene, a drive or a joint cannot be used.
        ComputationError: If the start is out of balance or the motion diverges.
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
    loop = None
    if controller is not None:
        loop = GivenLoop(
            assembly, controller, task_of(assembly, known_drives, known_arm)
        )
    elif known_drives or known_arm is not None:
        what = "known_drives" if known_drives else "known_arm"
        raise InputError(f"{what} without controller; accepted: both or none")
    name = name or scene.name
    if recording is None:
        return simulate(assembly, name=name, loop=loop, progress=progress)
    from swgjoint.view.recording.recording import Recorder

    run = None
    with attempting(recording, unless=lambda: run is None):
        with Recorder(assembly, recording) as recorder:

            def going(label: str, done: int, total: int) -> None:
                recorder.begin()
                progress(label, done, total)

            run = simulate(assembly, name=name, loop=loop, progress=going)
            recorder.finish(run)
        run = replace(run, recording=Path(recording))
    assert run is not None
    return run


@contextmanager
def _without_log_file() -> Iterator[None]:
    """Let the engine put its warnings on the console alone, not in the working folder.

    A run tells what they mean; the engine's ``MUJOCO_LOG.TXT`` would stay for ever.
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
    """Run an assembled scene; see :func:`run_scene`.

    Args:
        assembly: The scene.
        name: Of the run.
        loop: Law of a controller from outside.
        progress: Called with the steps done.
    """
    model, path = assembly.model, assembly.trajectory
    inputs = control_inputs(assembly)
    data = mujoco.MjData(model)
    set_start(assembly, data)
    state = np.empty(mujoco.mj_stateSize(model, _STATE))
    mujoco.mj_getState(model, data, state, _STATE)

    if assembly.loops.sampled:
        begin = time.perf_counter()
        states, rates, wanted = run_sampled(
            assembly,
            loop or SampledLoop(assembly),
            data,
            inputs,
            check=lambda new: _check_finite(assembly, data, new),
            progress=lambda done: progress(f"run {name}", done, len(inputs)),
        )
        wall = time.perf_counter() - begin
        return _recorded(assembly, name, states, rates, wall, wanted=wanted)

    # the engine's own rollout: no Python between two steps, every state recorded
    steps, parts = len(inputs), assembly.sub_steps
    states = np.empty((steps // parts + 1, state.size))
    states[0] = state
    speeds = 1 + model.nq + assembly.link_velocity
    rates = np.empty((path.time.size, speeds.size))
    rates[0] = state[speeds]
    chunk = parts * max(1, _CHUNK // parts)
    begin = time.perf_counter()
    with Rollout(nthread=0) as rollout:
        for first in range(0, steps, chunk):
            last = min(first + chunk, steps)
            got, _ = rollout.rollout(
                model,
                data,
                states[first // parts][None],
                inputs[None, first:last],
                initial_warmstart=data.qacc_warmstart[None],
            )
            states[first // parts + 1 : last // parts + 1] = got[0, parts - 1 :: parts]
            rates[first + 1 : last + 1] = got[0][:, speeds]
            _check_finite(assembly, data, got[0])
            progress(f"run {name}", last, steps)
    return _recorded(assembly, name, states, rates, time.perf_counter() - begin)


def _check_finite(assembly: Assembly, data: mujoco.MjData, states: Array) -> None:
    """Stop a run that diverged; the engine would go on with a reset state."""
    nq, nv = assembly.model.nq, assembly.model.nv
    if data.warning[mujoco.mjtWarning.mjWARN_BADCTRL].number:
        raise ComputationError(
            f"scene {assembly.scene.name!r}: before t = {states[-1, 0]:.3f} s a motor"
            " or a disturbance was asked for more than 1e10, which the engine does not"
            " apply; use lower gains of the controller"
        )
    if data.warning[mujoco.mjtWarning.mjWARN_INERTIA].number:
        raise ComputationError(
            f"scene {assembly.scene.name!r}: before t = {states[-1, 0]:.3f} s the"
            " engine could not solve for the accelerations: the masses of the arm are"
            " too far apart, or its inertia is close to singular; see mjWARN_INERTIA"
            " in MuJoCo's manual"
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
        step = assembly.step
        raise ComputationError(
            f"scene {assembly.scene.name!r}: the motion diverged before"
            f" t = {states[-1, 0]:.3f} s with a step of {step:g} s and integrator"
            f" {assembly.scene.simulation.integrator}; use a smaller simulation.step_s"
            " or integrator discrete"
        )


def _recorded(
    whole: Assembly,
    name: str,
    states: Array,
    rates: Array,
    wall: float,
    *,
    wanted: Array | None = None,
) -> Run:
    """Signals of all joints from the recorded states.

    Args:
        whole: The scene as it was run.
        name: Of the run.
        states: One per step of the scene. Shape (n, n_state).
        rates: Link speeds at every step of the engine [rad/s].
        wall: Time that the steps took [s].
        wanted: Motor torque that a sampled loop asked for at every step of the engine
            [N·m]; None for the engine's own loops.
    """
    assembly, ratio = whole.recorded(), whole.ratio
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
        asked = wanted_torque(whole, theta, theta_rate, integral)
    else:
        asked = np.stack(2 * [wanted[:: whole.sub_steps]])
    speed = theta_rate
    if assembly.scene.simulation.integrator != "discrete":
        speed = np.diff(theta, axis=0) / np.diff(path.time)[:, None]
        speed = np.vstack([speed[:1], speed])
    motor = np.stack(
        [
            limited(asked[:, :, j], speed[:, j], limits)
            for j, limits in enumerate(assembly.loops.limits)
        ],
        axis=-1,
    ).mean(axis=0)
    wanted = asked.mean(axis=0)
    # no rotor: what the motor gives less what its rotor takes; the integrator's own
    # acceleration is the velocity difference of the step that led to the state
    ideal = ratio * (rates - whole.prescribed_rate)
    slowing = np.diff(ideal, axis=0, prepend=ideal[:1])[:: whole.sub_steps] / whole.step
    output = ratio * (motor - assembly.rotor_inertia * slowing)
    torsion, slipping, friction = np.zeros((3, *position.shape))
    error = assembly.prescribed.copy()
    # the discrete integrator's positions are half a step ahead of its velocities
    ahead = 0.0
    if assembly.scene.simulation.integrator == "discrete":
        ahead = 0.5 * whole.step
    for j in np.flatnonzero(flexible):
        got = assembly.transmissions[j].signals(
            theta[:, j] - ahead * theta_rate[:, j],
            position[:, j] - ahead * velocity[:, j],
            theta_rate[:, j],
            velocity[:, j],
        )
        torsion[:, j], error[:, j] = got.torsion, got.transmission_error
        output[:, j] = got.torque
        slipping[:, j], friction[:, j] = got.slipping, got.friction
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
        friction_torque=friction,
        tool_position=assembly.arm.tool_positions(position),
        tool_reference=assembly.arm.tool_positions(path.position),
        wall=wall,
    )


def _integrals(assembly: Assembly, states: Array) -> Array:
    """Integral of the error in the engine's loops [rad·s]. Shape (n, n_joints).

    Under ``discrete`` as it acted on the way to the state: the engine integrates after
    the forces.
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
