# mypy: ignore-errors
"""Arrays on the device for :mod:`swgjoint.envs.warp`, of the current device of Warp."""

from __future__ import annotations

import mujoco
import numpy as np
import warp as wp

from swgjoint.envs.bench import BODY
from swgjoint.envs.entries import bounds
from swgjoint.envs.joint_tracking import TrackingCore
from swgjoint.envs.rest import balance_specimens
from swgjoint.envs.warp import kernels
from swgjoint.joint.variation import SIZE
from swgjoint.joint.warp.potential import real, vec5
from swgjoint.units import arcmin


def bench(core: TrackingCore, model: mujoco.MjModel) -> kernels.TrackingNumbers:
    """Numbers of the environment.

    Args:
        core: Episodes of the environment.
        model: Model without the plugin.
    """
    one, limits, settings = kernels.TrackingNumbers(), core.limits, core.settings
    one.ratio = core.joint.ratio
    one.actuator = int(model.actuator("motor").id)
    one.body = int(model.body(BODY).id)
    one.motor_limit = float(limits.motor_torque[0])
    one.period, one.steps = core.period, core.steps
    one.angle_limit = float(limits.angle[0])
    one.speed_limit = float(limits.motor_speed[0])
    one.peak_limit = float(limits.momentary_peak[0])
    one.ratcheting_limit = float(limits.ratcheting[0])
    one.error_scale = settings.error_scale_arcmin * arcmin
    one.effort_weight = settings.effort_weight
    one.link_channel = 1 if core.sensors.link_encoder else -1
    one.torque_channel = core.readout.channels - 1 if core.sensors.torque_sensor else -1
    one.varied_load = int(core.varies_load)
    return one


def channels(core: TrackingCore) -> kernels.Channels:
    """Errors of the sensors and bounds of the observation."""
    one = kernels.Channels()
    deviation, count = zip(*core.readout.channel_errors(), strict=True)
    low, high = bounds(core.observation_entries)
    one.deviation, one.count = wp.array(deviation, dtype=real), wp.array(count, real)
    one.low, one.high = wp.array(low, dtype=real), wp.array(high, dtype=real)
    one.unit = wp.array(core.units, dtype=real)
    return one


def episodes(core: TrackingCore) -> kernels.Episodes:
    """Plans, noise, specimens and equilibria at the start of the core's episodes."""
    one, joint = kernels.Episodes(), core.joint
    drawn = np.array([variations[0].numbers for variations in core.variations])
    rest = balance_specimens(joint.drive, drawn, 0.0, 0.0)
    inertia, rotor = core.load_inertia, core.settings.rotor_inertia_kgm2
    start = [
        rest.link_angle,
        rest.torsion,
        -rest.input_torque / rotor,
        -rest.output_torque / inertia,
        inertia,
    ]
    one.plan = wp.array(core.plans.whole_plans()[:, :, :4, 0], dtype=real)
    one.noise = wp.array(core.plans.whole_noise(), dtype=real)
    one.start = wp.array(np.stack(start, axis=1), dtype=vec5)
    one.specimen = wp.array(drawn.reshape(-1, SIZE), dtype=vec5)
    return one


def engine(m, d, call) -> kernels.Engine:
    """Arrays of the engine and of the law that an episode reads or changes.

    Args:
        m: Model of MuJoCo Warp.
        d: Data of MuJoCo Warp.
        call: Result of :func:`swgjoint.joint.warp.install`.
    """
    one = kernels.Engine()
    one.qpos, one.qvel, one.time = d.qpos, d.qvel, d.time
    one.ctrl, one.applied, one.warmstart = d.ctrl, d.qfrc_applied, d.qacc_warmstart
    one.inertia, one.timestep = m.body_inertia, m.opt.timestep
    one.drives, one.specimens = call.drives, call.specimens
    one.steps, one.rest = call.steps, call.rest
    return one


def worlds(core: TrackingCore, count: int) -> kernels.Worlds:
    """State of the episodes of a number of worlds.

    Args:
        core: Episodes of the environment.
        count: Number of worlds.
    """
    one, ages = kernels.Worlds(), core.sensors.delay_periods + 1
    one.episode = wp.zeros(count, dtype=int)
    one.instant = wp.zeros(count, dtype=int)
    one.past = wp.zeros((ages, count, core.readout.channels), dtype=real)
    one.last = wp.zeros(count, dtype=real)
    one.action = wp.zeros(count, dtype=real)
    return one


def results(core: TrackingCore, count: int) -> kernels.Results:
    """What a step returns for a number of worlds.

    Args:
        core: Episodes of the environment.
        count: Number of worlds.
    """
    one, shape = kernels.Results(), (count, len(core.units))
    one.observation = wp.zeros(shape, dtype=float)
    one.final_observation = wp.zeros(shape, dtype=float)
    one.reward = wp.zeros(count, dtype=float)
    one.terminated = wp.zeros(count, dtype=wp.bool)
    one.truncated = wp.zeros(count, dtype=wp.bool)
    one.broken_limit = wp.zeros(count, dtype=int)
    one.link_error = wp.zeros(count, dtype=float)
    one.output_torque = wp.zeros(count, dtype=float)
    return one
