# mypy: ignore-errors
"""Kernels of :mod:`swgjoint.envs.warp`, written in Warp with its types.

They compute readings, observations, rewards and limits as :mod:`swgjoint.envs.core` and
:mod:`swgjoint.envs.joint_tracking`, with one thread per world.
"""

import warp as wp

from swgjoint.joint.warp.law import WarpStep, taken_torques
from swgjoint.joint.warp.potential import ZERO, WarpDrive, real, vec5


@wp.struct
class TrackingNumbers:
    """Numbers of the environment; angles in rad, torques in N·m, times in s."""

    ratio: real
    """Signed ratio of the drive."""
    actuator: int
    body: int
    """Index of the load body."""
    motor_limit: real
    """Torque limit of the motor."""
    period: real
    steps: int
    """Number of control periods of an episode."""
    angle_limit: real
    speed_limit: real
    peak_limit: real
    ratcheting_limit: real
    """Limits of link angle, motor speed and output torque."""
    error_scale: real
    effort_weight: real
    link_channel: int
    """Channel of the link encoder, -1 without."""
    torque_channel: int
    """Channel of the torque sensor, -1 without."""
    varied_load: int
    """Whether every world has its own load inertia."""


@wp.struct
class Episodes:
    """Drawn episodes, which worlds play in turn."""

    plan: wp.array3d(dtype=real)
    """Angle, speed and acceleration of the link, and load. Shape (e, instants, 4)."""
    noise: wp.array3d(dtype=real)
    """Standard normal numbers. Shape (e, instants, channels)."""
    start: wp.array(dtype=vec5)
    """Link angle, torsion, accelerations of rotor and link by the forces other than
    that of the drive, and load inertia at the start. Shape (e,)."""
    specimen: wp.array(dtype=vec5)
    """Deviations of the drive from its map. Shape (e,)."""


@wp.struct
class Channels:
    """Errors of the sensors and bounds of the observation."""

    deviation: wp.array(dtype=real)
    """Standard deviation of the noise of each channel."""
    count: wp.array(dtype=real)
    """Angle of one count, 0 without rounding."""
    low: wp.array(dtype=real)
    high: wp.array(dtype=real)
    unit: wp.array(dtype=real)
    """Bounds and units of the values of the observation."""


@wp.struct
class Engine:
    """Arrays of the engine and of the drive's law that an episode changes."""

    qpos: wp.array2d(dtype=float)
    qvel: wp.array2d(dtype=float)
    time: wp.array(dtype=float)
    ctrl: wp.array2d(dtype=float)
    applied: wp.array2d(dtype=float)
    warmstart: wp.array2d(dtype=float)
    inertia: wp.array2d(dtype=wp.vec3)
    timestep: wp.array(dtype=float)
    drives: wp.array(dtype=WarpDrive)
    specimens: wp.array2d(dtype=vec5)
    steps: wp.array2d(dtype=WarpStep)
    rest: wp.array2d(dtype=real)


@wp.struct
class Worlds:
    """State of the episode of every world."""

    episode: wp.array(dtype=int)
    instant: wp.array(dtype=int)
    past: wp.array3d(dtype=real)
    """Ring of the last readings. Shape (ages, worlds, channels)."""
    last: wp.array(dtype=real)
    """Motor reading at the previous instant [rad]."""
    action: wp.array(dtype=real)


@wp.struct
class Results:
    """What a step returns. Shapes (worlds, ...)."""

    observation: wp.array2d(dtype=float)
    final_observation: wp.array2d(dtype=float)
    reward: wp.array(dtype=float)
    terminated: wp.array(dtype=wp.bool)
    truncated: wp.array(dtype=wp.bool)
    broken_limit: wp.array(dtype=int)
    link_error: wp.array(dtype=float)
    output_torque: wp.array(dtype=float)


@wp.func
def exceeds(value: real, limit: real):
    """Whether a size exceeds a limit; a value that is not a number exceeds all.

    Args:
        value: The value, of either sign.
        limit: Largest size.
    """
    return wp.isnan(value) or wp.abs(value) > limit


@wp.func
def sense(
    bench: TrackingNumbers,
    channels: Channels,
    episodes: Episodes,
    engine: Engine,
    worlds: Worlds,
    world: int,
    channel: int,
    torque: real,
):
    """Reading of a channel at the current instant, without delay.

    Args:
        bench: Numbers of the environment.
        channels: Errors of the sensors.
        episodes: Drawn episodes.
        engine: Arrays of the engine.
        worlds: State of the episodes.
        world: Index of the world.
        channel: Index of the channel.
        torque: Output torque of the drive [N·m].
    """
    true = real(engine.qpos[world, engine.drives[0].q_rotor])
    if channel == bench.link_channel:
        true = real(engine.qpos[world, engine.drives[0].q_link])
    if channel == bench.torque_channel:
        true = torque
    normal = episodes.noise[worlds.episode[world], worlds.instant[world], channel]
    reading = true + channels.deviation[channel] * normal
    if channels.count[channel] > ZERO and wp.isfinite(reading):
        reading = wp.floor(reading / channels.count[channel]) * channels.count[channel]
    return reading


@wp.func
def observe(
    bench: TrackingNumbers,
    channels: Channels,
    episodes: Episodes,
    worlds: Worlds,
    world: int,
    speed: real,
    out: wp.array2d(dtype=float),
):
    """Write the observation of a world: readings, reference, load and action.

    Args:
        bench: Numbers of the environment.
        channels: Bounds and units of the observation.
        episodes: Drawn episodes.
        worlds: State of the episodes.
        world: Index of the world.
        speed: Measured motor speed [rad/s].
        out: Gets the observation. Shape (worlds, n_values).
    """
    ages = worlds.past.shape[0]
    oldest = (worlds.instant[world] + 1) % ages
    episode, instant = worlds.episode[world], worlds.instant[world]
    angle = worlds.past[oldest, world, 0]
    for k in range(out.shape[1]):
        value = worlds.action[world]
        if k == 0:
            value = angle
        if k == 1:
            value = speed
        if k == 2:
            value = bench.ratio * episodes.plan[episode, instant, 0] - angle
        if k == 3:
            value = bench.ratio * episodes.plan[episode, instant, 1] - speed
        if k >= 4 and k < 8:
            value = episodes.plan[episode, instant, k - 4]
        if k > 8:
            value = worlds.past[oldest, world, k - 8]
        value = wp.min(wp.max(value, channels.low[k]), channels.high[k])
        out[world, k] = float(value / channels.unit[k])


@wp.func
def begin(
    bench: TrackingNumbers,
    channels: Channels,
    episodes: Episodes,
    engine: Engine,
    worlds: Worlds,
    results: Results,
    world: int,
    episode: int,
):
    """Place a world at the start of an episode, at rest and without load.

    Args:
        bench: Numbers of the environment.
        channels: Sensors and observation.
        episodes: Drawn episodes.
        engine: Gets the state of the start.
        worlds: Gets the episode.
        results: Gets the observation.
        world: Index of the world.
        episode: Number of the episode.
    """
    drive = engine.drives[0]
    start, specimen = episodes.start[episode], episodes.specimen[episode]
    worlds.episode[world] = episode
    worlds.instant[world] = 0
    worlds.action[world] = ZERO
    engine.time[world] = 0.0
    for dof in range(engine.qvel.shape[1]):
        engine.qvel[world, dof] = 0.0
        engine.warmstart[world, dof] = 0.0
    engine.qpos[world, drive.q_rotor] = 0.0
    engine.qpos[world, drive.q_link] = float(start[0])
    engine.specimens[world, 0] = specimen
    if bench.varied_load == 1:
        inertia = engine.inertia[world, bench.body]
        inertia[2] = float(start[4])
        engine.inertia[world, bench.body] = inertia
    # the law sees the time of its last evaluation, hence neither a step nor a reset
    state = WarpStep()
    state.a_rotor = start[2]
    state.a_link = start[3]
    engine.steps[world, 0] = state
    for j in range(drive.element, drive.element + drive.elements):
        engine.rest[world, j] = start[1]
        engine.rest[world, engine.rest.shape[1] / 2 + j] = ZERO
    for channel in range(channels.count.shape[0]):
        reading = sense(bench, channels, episodes, engine, worlds, world, channel, ZERO)
        for age in range(worlds.past.shape[0]):
            worlds.past[age, world, channel] = reading
    worlds.last[world] = worlds.past[0, world, 0]
    observe(bench, channels, episodes, worlds, world, ZERO, results.observation)


@wp.kernel
def begin_chosen(
    bench: TrackingNumbers,
    channels: Channels,
    episodes: Episodes,
    engine: Engine,
    worlds: Worlds,
    results: Results,
    chosen: wp.array(dtype=wp.bool),
    first: int,
):
    """Begin an episode in chosen worlds: their own first one, or the next one.

    Args:
        bench: Numbers of the environment.
        channels: Sensors and observation.
        episodes: Drawn episodes.
        engine: Arrays of the engine.
        worlds: State of the episodes.
        results: Gets the observation.
        chosen: Which worlds begin. Shape (worlds,).
        first: 1 for the first episode of each world, otherwise 0.
    """
    world = wp.tid()
    if chosen[world]:
        episode = worlds.episode[world] + 1
        if first == 1:
            episode = world
        episode = episode % episodes.start.shape[0]
        begin(bench, channels, episodes, engine, worlds, results, world, episode)


@wp.kernel
def command(
    bench: TrackingNumbers,
    episodes: Episodes,
    engine: Engine,
    worlds: Worlds,
    action: wp.array2d(dtype=float),
):
    """Apply motor torque and load of one control period.

    Args:
        bench: Numbers of the environment.
        episodes: Drawn episodes.
        engine: Gets the torques.
        worlds: Gets the clipped action.
        action: Actions [-]. Shape (worlds, 1).
    """
    world = wp.tid()
    value = real(action[world, 0])
    share = wp.clamp(value, real(-1.0), real(1.0))
    worlds.action[world] = share
    if not wp.isfinite(value):
        share = ZERO
        worlds.action[world] = value
    engine.ctrl[world, bench.actuator] = float(share * bench.motor_limit)
    load = episodes.plan[worlds.episode[world], worlds.instant[world], 3]
    engine.applied[world, engine.drives[0].v_link] = -float(load)


@wp.kernel
def judge(
    bench: TrackingNumbers,
    channels: Channels,
    episodes: Episodes,
    engine: Engine,
    worlds: Worlds,
    results: Results,
):
    """Readings, reward and limits after a control period; begins the next episodes.

    Args:
        bench: Numbers of the environment.
        channels: Sensors and observation.
        episodes: Drawn episodes.
        engine: Arrays of the engine after its steps.
        worlds: State of the episodes.
        results: Gets all values.
    """
    world = wp.tid()
    drive, episode = engine.drives[0], worlds.episode[world]
    instant = worlds.instant[world] + 1
    worlds.instant[world] = instant

    # torque over the last step of the engine, which the law computes one step later
    state = engine.steps[world, 0]
    speed = real(engine.qvel[world, drive.v_rotor])
    rm = speed - state.v_rotor
    rl = real(engine.qvel[world, drive.v_link]) - state.v_link
    taken = taken_torques(drive, state, real(engine.timestep[0]), rm, rl)
    torque = -taken[1]

    for channel in range(channels.count.shape[0]):
        worlds.past[instant % worlds.past.shape[0], world, channel] = sense(
            bench, channels, episodes, engine, worlds, world, channel, torque
        )
    reading = worlds.past[(instant + 1) % worlds.past.shape[0], world, 0]
    rate = (reading - worlds.last[world]) / bench.period
    worlds.last[world] = reading

    angle = real(engine.qpos[world, drive.q_link])
    error = angle - episodes.plan[episode, instant, 0]
    share = error / bench.error_scale
    effort = worlds.action[world]
    reward = real(1.0) / (real(1.0) + share * share)
    results.reward[world] = float(reward - bench.effort_weight * effort * effort)
    results.link_error[world] = float(error)
    results.output_torque[world] = float(torque)

    # the last exceeded limit is reported
    broken = int(0)  # noqa: RUF046, UP018  (a variable, not a constant of the kernel)
    if exceeds(angle, bench.angle_limit):
        broken = 1
    if exceeds(speed, bench.speed_limit):
        broken = 2
    if exceeds(torque, bench.peak_limit):
        broken = 3
    if exceeds(torque, bench.ratcheting_limit):
        broken = 4
    results.broken_limit[world] = broken
    results.terminated[world] = broken > 0
    results.truncated[world] = instant >= bench.steps

    observe(bench, channels, episodes, worlds, world, rate, results.final_observation)
    if broken > 0 or instant >= bench.steps:
        following = (episode + 1) % episodes.start.shape[0]
        begin(bench, channels, episodes, engine, worlds, results, world, following)
    else:
        observe(bench, channels, episodes, worlds, world, rate, results.observation)
