"""Chains of two links that fall onto a floor or against joint limits and rest there.

Gravity lets a chain with catalogue drives fall onto a floor or against the limits of
its joints, where it comes to rest. The sum of kinetic, torsion and gravity energy may
only decrease, except for energy that a compressed contact returns. The energy is
therefore averaged over parts of the run, and a gain is the rise of a mean above the
lowest earlier mean. Lossless chains have a damping of
:data:`~swgjoint.joint.drive.CONTACT_DAMPING_RATIO` while a contact or limit acts.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import product

import mujoco
import numpy as np

from swgjoint.bench.stability.catalogue import CatalogueDrive, catalogue_drives
from swgjoint.bench.stability.joint import (
    GAIN,
    torsion_energy,
    with_kinematic_error,
)
from swgjoint.bench.stability.rows import DEFAULT, StabilityRow
from swgjoint.joint.attach import attach
from swgjoint.joint.drive import JointDrive
from swgjoint.joint.region import MAX_SUB_STEPS, check_region
from swgjoint.maps.drive_map import DriveMap
from swgjoint.typing import Array

KINDS = ("floor", "limit")
"""Kinds of contact: a floor, or limits of the joints."""
MASSES = (0.3, 3.0)
"""Mass of each link [kg]."""
DAMPING_RATIOS = (0.0, 0.001, 0.02)
"""Damping ratios of the drives [-]."""
STEPS = (5e-4, 1e-3, 2e-3)
"""Time steps [s]."""
DURATION = 4.0
"""Duration of a run [s]; a chain reaches the floor after 0.2 s."""
SPEED = 100.0
"""Rotor speed for which the stability region is checked [rad/s]; during the fall the
rotors reach ten times this speed."""
PARTS = 10
"""Number of parts of a run over which the energy is averaged, because a bounce returns
the energy that it has stored."""
SAMPLES = 2000
"""Number of energy samples along a run."""
FINE = 4
"""Factor by which the step is divided in the runs that show the energy gain of the
contacts alone."""
LIFTS = (-0.02, -0.01, 0.01, 0.02)
"""Initial angles of the upper link in those runs [rad]; they vary because bounces
amplify small differences."""

_XML = """
<mujoco>
  <option timestep="{step!r}" integrator="discrete" gravity="0 0 -9.81"/>
  <worldbody>
    {floor}
    <body name="upper" pos="0 0 1">
      <joint name="shoulder" axis="0 1 0" {limit}/>
      <geom type="capsule" size=".03" fromto="0 0 0 .4 0 0" mass="{mass!r}"/>
      <body name="fore" pos=".4 0 0">
        <joint name="elbow" axis="0 1 0" {limit}/>
        <geom type="capsule" size=".03" fromto="0 0 0 .3 0 0" mass="{mass!r}"/>
      </body>
    </body>
  </worldbody>
</mujoco>
"""
_FLOOR = '<geom type="plane" size="5 5 .1" pos="0 0 .9"/>'
_LIMIT = 'limited="true" range="-10 10"'


@dataclass(frozen=True, kw_only=True)
class ContactTask:
    """One chain, with the same drive in both joints."""

    drive: CatalogueDrive
    kind: str
    """One of :data:`KINDS`."""
    mass: float
    """Mass of each link [kg]."""
    steps: tuple[float, ...] = STEPS
    """Time steps [s]."""
    damping_ratios: tuple[float, ...] = DAMPING_RATIOS
    """Damping ratios of the drives [-]."""

    @property
    def name(self) -> str:
        """Drive, mass of a link and kind of contact."""
        return f"{self.drive.name} {self.mass:g} kg, {self.kind}"


def contact_tasks(*, full: bool) -> list[ContactTask]:
    """Tasks for all catalogue drives, kinds of contact and masses, or for a subset."""
    drives, masses = catalogue_drives(), list(MASSES)
    if not full:
        drives, masses = drives[3::8], masses[:1]
    return [
        ContactTask(drive=drive, kind=kind, mass=mass)
        for drive, kind, mass in product(drives, KINDS, masses)
    ]


def run_contact(task: ContactTask) -> list[StabilityRow]:
    """Rows of one chain, at all time steps and damping ratios."""
    return [
        _row(task, step, damping)
        for step, damping in product(task.steps, task.damping_ratios)
    ]


def _row(task: ContactTask, step: float, damping: float) -> StabilityRow:
    spec, drives = chain(task, step, damping)
    regions = [
        check_region(drive, timestep=step, max_input_speed=SPEED, contacts=True)
        for drive in drives
    ]
    parts = [region.sub_steps for region in regions]
    base = StabilityRow(
        case=f"{task.name}, damping ratio {damping:g}",
        group="contact",
        scheme=DEFAULT,
        step_s=step,
        outcome="refused",
        phase_step=step * max(drive.natural_frequency for drive in drives),
        reason="; ".join(dict.fromkeys(r.exceeded for r in regions if not r.ok))
        or None,
    )
    count = max((n or MAX_SUB_STEPS + 1) for n in parts)
    if count > MAX_SUB_STEPS:
        return base
    energy = lie_down(spec, drives, step / count)
    rise, own = gain(energy), 0.0
    outcome = "sub_stepped" if count > 1 else "ok"
    if not np.isfinite(rise):
        outcome = "diverged"
    elif rise > GAIN:
        own = max(
            gain(lie_down(spec, drives, step / count / FINE, lift)) for lift in LIFTS
        )
        outcome = "energy_gain" if rise > GAIN + own else outcome
    return replace(
        base,
        outcome=outcome,
        sub_steps=count,
        largest_gain=rise,
        own_gain=own or None,
        energy_balance=float(energy[-1]),
    )


def chain(
    task: ContactTask, step: float, damping: float
) -> tuple[mujoco.MjSpec, list[JointDrive]]:
    """Chain of a task, without losses apart from the damping ratio.

    Args:
        task: Drive, kind of contact and mass.
        step: Time step [s].
        damping: Damping ratio of the drives [-].

    Returns:
        Specification and the drives of shoulder and elbow.
    """
    drive = with_kinematic_error(
        DriveMap.from_catalogue(task.drive.name, kinematic_error_arcmin=0.0)
    )
    text = _XML.format(
        step=step,
        mass=task.mass,
        floor=_FLOOR if task.kind == "floor" else "",
        limit=_LIMIT if task.kind == "limit" else "",
    )
    spec = mujoco.MjSpec.from_string(text)
    return spec, [
        attach(
            spec,
            joint=joint,
            drive=drive,
            rotor_inertia=task.drive.rotor,
            damping_ratio=damping,
        )
        for joint in ("shoulder", "elbow")
    ]


def lie_down(
    spec: mujoco.MjSpec, drives: list[JointDrive], step: float, lift: float = 0.0
) -> Array:
    """Run a chain and average its energy over the parts of the run.

    Args:
        spec: Specification of the chain.
        drives: Drives of its joints.
        step: Time step [s].
        lift: Initial angle of the upper link [rad].

    Returns:
        Mean change of the total energy in each part, divided by the largest kinetic and
        torsion energy in the first part, shape (PARTS,) [-]; infinite if the run
        diverged.
    """
    spec.option.timestep = step
    model = spec.compile()
    data, weighed = mujoco.MjData(model), mujoco.MjData(model)
    rotor = [int(model.joint(d.rotor).qposadr[0]) for d in drives]
    link = [int(model.joint(d.joint).qposadr[0]) for d in drives]
    for d, r, j, angle in zip(drives, rotor, link, (lift, 0.0), strict=True):
        theta = d.ratio * angle
        error = float(d.drive.error_at(d.drive.phases(theta, angle))[0])
        data.qpos[r], data.qpos[j] = theta, angle + error
    every = max(1, round(DURATION / step / SAMPLES))
    momentum = np.zeros(model.nv)
    count = round(DURATION / step / every)
    position, kinetic, height = np.empty((count, model.nq)), *np.empty((2, count))
    for k in range(count):
        mujoco.mj_step(model, data, every)
        # the midpoint rule refers to positions half a step earlier
        weighed.qpos[:] = position[k] = data.qpos - 0.5 * step * data.qvel
        weighed.qvel[:] = data.qvel
        mujoco.mj_fwdPosition(model, weighed)
        mujoco.mj_mulM(model, weighed, momentum, weighed.qvel)
        kinetic[k] = 0.5 * float(weighed.qvel @ momentum)
        height[k] = float(model.body_mass @ weighed.xipos[:, 2])
    if any(warning.number for warning in data.warning):
        return np.full(PARTS, np.inf)
    stored = kinetic + torsion_energy(drives, position[:, rotor], position[:, link])
    total = stored - float(model.opt.gravity[2]) * height
    fallen = float(stored[: count // PARTS].max())
    means = [float(part.mean()) for part in np.array_split(total - total[0], PARTS)]
    return np.array(means) / fallen


def gain(energy: Array) -> float:
    """Largest rise of a mean above the lowest earlier mean [-].

    The rise is infinite if the energy is not finite.
    """
    if not np.isfinite(energy).all():
        return float("inf")
    return float((energy - np.minimum.accumulate(energy)).max())
