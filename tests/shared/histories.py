"""Random histories of a joint in the engine: commands, loads, speeds, steps, impacts.

The histories of one drive run in one batch. Each has its own time step, inertias and
commands. The motor follows a speed command and carries the load, both of which are
constant, reverse, jump or are noise; hits turn the link within one step, and a joint
limit stops it.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from mujoco.batch import Batch

from swgjoint.joint.reference import TwinMotion
from swgjoint.maps.hysteresis import vary_with_load

LIMIT = 'limited="true" range="-20 20"'
"""Attributes of the link's joint, whose limit stops the link [deg]."""
STEP = (1e-4, 2e-3)
"""Range of the time steps [s]."""
KINDS = ("constant", "reversing", "jumping", "noisy")
"""Kinds of commands."""
HITS = 0.02
"""Fraction of the steps with a hit, in every other history."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Histories:
    """Recorded histories; the first axis is time, the second one the history."""

    drive: object
    """Map of the drive."""
    damping: float
    """Damping of the torsion [N·m·s/rad]."""
    contact_damping: float
    step: np.ndarray
    """Time steps [s]. Shape (n,)."""
    inertia: np.ndarray
    """Inertias of rotor and link [kg·m²]. Shape (n, 2)."""
    q: np.ndarray
    """Angles of rotor and link [rad]. Shape (steps + 1, n, 2)."""
    v: np.ndarray
    """Speeds of rotor and link [rad/s]. Shape (steps + 1, n, 2)."""
    state: np.ndarray
    """States of the plugin. Shape (steps + 1, n, count)."""
    other: np.ndarray
    """Torques of motor, load and limit [N·m]. Shape (steps, n, 2)."""
    limited: np.ndarray
    """Whether the joint limit acts in a step. Shape (steps, n)."""

    @property
    def x(self) -> np.ndarray:
        """Angles half a step earlier, at which the scheme evaluates forces [rad]."""
        return self.q - 0.5 * self.step[:, None] * self.v

    @property
    def change(self) -> np.ndarray:
        """Changes of these angles in the steps [rad]. Shape (steps, n, 2)."""
        return 0.5 * self.step[:, None] * (self.v[1:] + self.v[:-1])

    @property
    def force(self) -> np.ndarray:
        """Mean torques of the drive in the steps [N·m]. Shape (steps, n, 2)."""
        rate = np.diff(self.v, axis=0) / self.step[:, None]
        return self.inertia * rate - self.other

    def torsion(self) -> np.ndarray:
        """Torsion at x [rad]. Shape (steps + 1, n)."""
        return self.drive.torsion(self.x[..., 0], self.x[..., 1])

    def stretches(self) -> np.ndarray:
        """Stretch of the elements at x [rad]. Shape (steps + 1, n, elements)."""
        elements = self.drive.hysteresis
        count = len(elements)
        reach = np.array([element.yield_torsion for element in elements])
        if vary_with_load(elements):
            last = self.state[..., -count:]
            reach = np.where(last > 0.0, last, np.inf)  # 0: there was no step
        rest = self.state[..., 2 : 2 + count]
        return np.clip(self.torsion()[..., None] - rest, -reach, reach)

    def bristle(self) -> np.ndarray:
        """Stretch of the bristle at x [rad]. Shape (steps + 1, n)."""
        at = 2 + len(self.drive.hysteresis)
        turned = self.x @ np.array(self.drive.friction_direction, float)
        return np.where(
            self.state[..., at + 1] > 0.0, turned - self.state[..., at], 0.0
        )

    def kinetic(self) -> np.ndarray:
        """Kinetic energy [J]. Shape (steps + 1, n)."""
        return 0.5 * np.sum(self.inertia * self.v**2, axis=-1)

    def motion(self, k: int, j: int) -> TwinMotion:
        """State of one history before one step, for the twin in numpy."""
        count = len(self.drive.hysteresis)
        state = self.state[k, j]
        known = self.drive.friction is not None and state[3 + count] > 0.0
        varies = vary_with_load(self.drive.hysteresis)
        limit = state[-count:] if varies and state[-count:].any() else ()
        return TwinMotion(
            theta=float(self.q[k, j, 0]),
            psi=float(self.q[k, j, 1]),
            theta_rate=float(self.v[k, j, 0]),
            psi_rate=float(self.v[k, j, 1]),
            rotor_weight=1.0 / self.inertia[j, 0],
            link_weight=1.0 / self.inertia[j, 1],
            rotor_acceleration=float(state[0]),
            link_acceleration=float(state[1]),
            rest=tuple(state[2 : 2 + count].tolist()),
            limit=tuple(float(x) for x in limit),
            relaxed=float(state[2 + count]) if known else None,
        )


def record(b, *, count: int, steps: int, speed: float, rng) -> Histories:
    """Run random histories of a bench with a joint limit.

    Args:
        b: Bench with friction, whose link has a small inertia.
        count: Number of histories.
        steps: Number of steps.
        speed: Largest commanded rotor speed [rad/s].
        rng: Random numbers.
    """
    drive, model = b.drive.drive, b.model
    batch = Batch(model, count, nthread=1)
    h, armature = batch.expand("opt.timestep"), batch.expand("dof_armature")
    h[:] = np.exp(rng.uniform(*np.log(STEP), h.shape))
    step = np.ravel(h).copy()
    peak, i = drive.ratings.momentary_peak, drive.ratio
    own = np.array([b.drive.rotor_inertia, b.drive.link_inertia])
    # 1 to 4 times the own rotor, and links between 0.03 and 3 of its reflected inertia
    added = own * [1.0, 0.0] * rng.uniform(0.0, 3.0, (count, 1))
    added[:, 1] = own[0] * i**2 * np.exp(rng.uniform(np.log(0.03), np.log(3.0), count))
    armature[:] = 0.0
    armature[:, b.v] = added
    batch.set_const()
    inertia = own + added
    total = inertia[:, 0] + inertia[:, 1] / i**2

    batch.qpos[:, b.q[0]] = rng.uniform(-9.0, 9.0, count)
    torsion = [drive.mean_torsion(t) for t in peak * rng.uniform(-1.0, 1.0, count)]
    batch.qpos[:, b.q[1]] = batch.qpos[:, b.q[0]] / i - torsion
    batch.qvel[:, b.v] = speed * rng.uniform(-1, 1, (count, 1)) * [1.0, 1.0 / i]
    commands = _commands(step, steps, rng)
    # most drives run far below their largest speed and load
    commands *= rng.random((count, 2)) ** 2
    hit = (rng.random((steps, count)) < HITS) & (rng.random(count) < 0.5)
    hits = hit * rng.normal(0.0, 0.1, hit.shape) * speed / abs(i) / step * inertia[:, 1]

    q, v, state = ([] for _ in range(3))
    other, limited = np.empty((steps, count, 2)), np.empty((steps, count), bool)
    for k in range(steps + 1):
        q.append(batch.qpos[:, b.q].copy())
        v.append(batch.qvel[:, b.v].copy())
        state.append(batch.plugin_state.copy())
        if k == steps:
            break
        load = peak * commands[k, :, 1]
        follow = total / 0.01 * (speed * commands[k, :, 0] - v[-1][:, 0])
        most = 2.0 * peak / abs(i)
        motor = np.clip(load / i + follow, -most, most)
        other[k] = np.stack([motor, -load + hits[k]], axis=-1)
        batch.qfrc_applied[:, b.v] = other[k]
        batch.step()
        limited[k] = batch.nefc.ravel() > 0
        other[k] += batch.qfrc_constraint[:, b.v]
    return Histories(
        drive=drive,
        damping=b.drive.damping,
        contact_damping=b.drive.contact_damping,
        step=step,
        inertia=inertia,
        q=np.array(q),
        v=np.array(v),
        state=np.array(state),
        other=other,
        limited=limited,
    )


def _commands(step: np.ndarray, steps: int, rng) -> np.ndarray:
    """Speed and load commands between -1 and 1. Shape (steps, n, 2)."""
    shape = (steps, step.size, 2)
    time = step * np.arange(steps)[:, None]
    kind = rng.integers(0, len(KINDS), (step.size, 2))
    rate = np.exp(rng.uniform(np.log(1.0), np.log(100.0), (step.size, 2)))
    phase = rng.uniform(0.0, 2.0 * np.pi, (step.size, 2))
    wave = np.sin(2.0 * np.pi * rate * time[..., None] + phase)
    level = rng.uniform(-1.0, 1.0, shape)
    # the last step at which a new level begins
    begins = np.where(rng.random(shape) < 0.04, np.arange(steps)[:, None, None], 0)
    since = np.maximum.accumulate(begins, axis=0)
    jumps = np.take_along_axis(level, since, axis=0)
    some = [np.broadcast_to(level[0], shape), wave, jumps, rng.uniform(-1, 1, shape)]
    return np.choose(kind, some)


def drawdown(dissipated: np.ndarray) -> np.ndarray:
    """Largest energy that each history delivers over any interval [J]. Shape (n,).

    Args:
        dissipated: Energy dissipated in each step [J]. Shape (steps, n).
    """
    total = np.concatenate([np.zeros((1, *dissipated.shape[1:])), dissipated])
    total = np.cumsum(total, axis=0)
    return np.max(np.maximum.accumulate(total, axis=0) - total, axis=0)
