r"""Warming of drives by their own losses, with one temperature for each drive.

.. math:: C\,\dot T = P - G\,(T - T_a)

with heat capacity C, conductance G, temperature T_a of the surroundings and the power P
that damping, hysteresis and friction of the drive dissipate, as in the energy balance
of a run. The temperature determines the friction of the drive, see
:mod:`swgjoint.maps.friction_temperature`.

Both are updated at a fixed interval. P is the mean over the interval that ended, for
which the equation is solved exactly, so that any interval is stable. Until the next
update the friction is that of the new temperature. The states of the engine, including
the stretch of friction bristle and hysteresis elements, pass from one model to the next
unchanged. The energy of the bristle is part of P, as in the energy balance.
"""

from __future__ import annotations

import copy
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import mujoco
import numpy as np

from swgjoint.drives.sections import JointSection
from swgjoint.errors import ComputationError, InputError
from swgjoint.joint import plugin
from swgjoint.joint.drive import JointDrive
from swgjoint.joint.region import check_region
from swgjoint.maps.drive_map import DriveMap
from swgjoint.maps.friction import Friction, FrictionCourse
from swgjoint.maps.friction_temperature import at_temperature
from swgjoint.sim.assembly_steps import complete_sections
from swgjoint.sim.figures.energy import drive_loss
from swgjoint.sim.figures.transmission import Rests, Transmission
from swgjoint.typing import Array
from swgjoint.units import ZERO_CELSIUS

if TYPE_CHECKING:
    from swgjoint.sim.assembly import Assembly

_SMALL = 0.01
"""Ratio of interval to time constant below which a series replaces a difference [-].
Its first omitted term is 2e-14."""


@dataclass(frozen=True, kw_only=True)
class ThermalNode:
    """Heat capacity and conductance of one drive."""

    capacity: float
    """Heat capacity C [J/K]."""
    conductance: float
    """Conductance G [W/K]."""
    ambient: float
    """Absolute temperature of the surroundings [K]."""

    def advance(
        self, temperature: float, power: float, duration: float
    ) -> tuple[float, float]:
        r"""Exact solution for a constant power.

        With u = T - T_a, x = G h/C and the functions
        :math:`\varphi = (1 - e^{-x})/x` and :math:`\psi = (1 - \varphi)/x`,

        .. math:: u(h) = u_0 e^{-x} + \frac{P h}{C}\varphi, \quad
            \int_0^h u\,dt = h\,u_0\varphi + \frac{P h^2}{C}\psi

        Args:
            temperature: Absolute temperature at the beginning [K].
            power: Power P [W].
            duration: Duration h [s].

        Returns:
            Absolute temperature at the end [K], and heat that went to the surroundings
            [J].
        """
        x = self.conductance * duration / self.capacity
        start = temperature - self.ambient
        if x < _SMALL:
            rise = power * duration / self.capacity
            psi = 0.5 - x / 6.0 + x**2 / 24.0 - x**3 / 120.0 + x**4 / 720.0
            phi = 1.0 - x * psi
            end = start * np.exp(-x) + rise * phi
            released = self.conductance * duration * (start * phi + rise * psi)
        else:  # in this form a quick node does not overflow
            decay = -np.expm1(-x)
            end = start * np.exp(-x) + power / self.conductance * decay
            released = self.capacity * start * decay
            released += power * duration * (1.0 - decay / x)
        return self.ambient + float(end), float(released)


@dataclass(frozen=True, kw_only=True, eq=False)
class HeatCourse:
    """Temperature and losses of one drive during a run; m counts its updates."""

    node: ThermalNode
    """Heat capacity and conductance."""
    time: Array
    """Start, and times of the updates [s]. Shape (m + 1,)."""
    temperature: Array
    """Absolute temperature at these times [K]. Shape (m + 1,)."""
    loss: Array
    """Energy that the drive dissipated in each interval [J]. Shape (m,)."""
    released: Array
    """Heat that went to the surroundings in each interval [J]. Shape (m,)."""

    @property
    def celsius(self) -> Array:
        """Temperatures [°C]. Shape (m + 1,)."""
        return self.temperature - ZERO_CELSIUS

    @property
    def power(self) -> Array:
        """Mean power of the losses in each interval [W]. Shape (m,)."""
        return self.loss / np.diff(self.time)

    def celsius_at(self, time: Array) -> Array:
        """Temperatures at any times, linear between updates [°C]; same shape.

        Args:
            time: Times [s].
        """
        return np.interp(time, self.time, self.celsius)

    def figures(self) -> dict[str, float | None]:
        """Figures under the keys of ``swgjoint run --json``."""
        node, celsius = self.node, self.celsius
        g = node.conductance
        return {
            "start_C": float(celsius[0]),
            "end_C": float(celsius[-1]),
            "highest_C": float(celsius.max()),
            "ambient_C": node.ambient - ZERO_CELSIUS,
            "loss_J": float(self.loss.sum()),
            "stored_J": node.capacity * float(celsius[-1] - celsius[0]),
            "released_J": float(self.released.sum()),
            "time_constant_s": node.capacity / g if g else None,
            "update_s": float(self.time[1] - self.time[0]),
        }


def warms(section: JointSection, attached: JointDrive) -> bool:
    """Whether the friction of an attached drive follows its temperature.

    Args:
        section: Settings of the joint.
        attached: Its drive.
    """
    return section.thermal is not None and attached.friction is not None


def reserve_friction(
    spec: mujoco.MjSpec,
    sections: Sequence[JointSection],
    attached: Mapping[str, JointDrive],
) -> None:
    """Prepare the drives that warm for friction that changes during a run.

    Args:
        spec: Model before compilation.
        sections: Settings of the joints.
        attached: Drives by joint, in the order of the sections.
    """
    for section, drive in zip(sections, attached.values(), strict=True):
        if warms(section, drive):
            plugin.reserve_friction(spec, drive)


class _WarmDrive:
    """One drive, and its temperature up to now."""

    def __init__(self, j: int, transmission: Transmission, section: JointSection):
        thermal = section.thermal
        assert thermal is not None
        self.j, self.transmission = j, transmission
        self.node = ThermalNode(
            capacity=thermal.heat_capacity_J_K,
            conductance=thermal.conductance_W_K,
            ambient=thermal.ambient_C + ZERO_CELSIUS,
        )
        start = section.temperature_C
        celsius = thermal.ambient_C if start is None else start
        friction = transmission.attached.friction
        assert friction is not None
        self.drive = transmission.attached.drive
        self.temperature = [celsius + ZERO_CELSIUS]
        self.laws: list[Friction] = [friction]
        self.loss: list[float] = []
        self.released: list[float] = []
        self.rests: Rests | None = None


class Warming:
    """Temperatures of the drives of one run, updated while it runs."""

    def __init__(self, assembly: Assembly) -> None:
        """Start at the temperatures of the scene.

        Args:
            assembly: The compiled scene.
        """
        self._assembly = assembly
        joints, transmissions = assembly.joints, assembly.transmissions
        sections = complete_sections(assembly.scene, joints)
        self._drives = [
            _WarmDrive(j, transmission, section)
            for j, (transmission, section) in enumerate(
                zip(transmissions, sections, strict=True)
            )
            if warms(section, transmission.attached)
        ]
        updates = [
            section.thermal.update_s
            for section, transmission in zip(sections, transmissions, strict=True)
            if section.thermal and warms(section, transmission.attached)
        ]
        step = assembly.scene.simulation.step_s
        self.every = max(1, round(min(updates) / step)) if updates else 0
        """Steps of the scene between two updates; 0 without a drive that warms."""
        self.attached = tuple(t.attached for t in transmissions)
        """Drives with their present friction, one per joint."""
        self._time = [0.0]
        self._law: list[int] = [0]  # of every sample

    def advance(
        self, model: mujoco.MjModel, data: mujoco.MjData, states: Array
    ) -> tuple[mujoco.MjModel, mujoco.MjData]:
        """Update temperatures and friction after an interval.

        Args:
            model: Model that was run in the interval.
            data: Its data at the end of the interval.
            states: Full engine states of the interval at the steps of the scene,
                including that at its beginning. Shape (n, n_state).

        Returns:
            Model and data to continue with; those that were passed in if no friction
            changed.

        Raises:
            ComputationError: If a temperature leaves the friction table of its drive,
                or if friction in the cold exceeds the bounds of an explicit integrator.
        """
        count = len(states) - 1
        now = len(self._law) - 1 + count
        self._law += count * [len(self._time) - 1]
        self._time.append(now * self._assembly.scene.simulation.step_s)
        changed = model
        for one in self._drives:
            one.loss.append(self._loss(one, states))
            duration = self._time[-1] - self._time[-2]
            before = one.temperature[-1]
            after, released = one.node.advance(
                before, one.loss[-1] / duration, duration
            )
            one.temperature.append(after)
            one.released.append(released)
            drive = one.drive
            if after != before:
                drive = self._at(one, after)
                if changed is model:
                    changed = copy.copy(model)
                name = one.transmission.attached.plugin
                plugin.replace_friction(changed, str(name), one.drive, drive)
                one.drive = drive
            assert drive.friction is not None
            one.laws.append(drive.friction)
        if changed is model:
            return model, data
        fresh = mujoco.MjData(changed)
        mujoco.mj_copyData(fresh, changed, data)
        warm = {one.j: one.drive for one in self._drives}
        self.attached = tuple(
            replace(drive, drive=warm[j]) if j in warm else drive
            for j, drive in enumerate(self.attached)
        )
        return changed, fresh

    def course(self, j: int) -> FrictionCourse | None:
        """Friction of a joint at all samples of the run; None if it is constant.

        Args:
            j: Index of the joint.
        """
        for one in self._drives:
            if one.j == j:
                return FrictionCourse(one.laws, np.array(self._law))
        return None

    def heat(self) -> dict[str, HeatCourse]:
        """Temperatures and losses by joint, for the joints that warm."""
        return {
            self._assembly.joints[one.j]: HeatCourse(
                node=one.node,
                time=np.array(self._time),
                temperature=np.array(one.temperature),
                loss=np.array(one.loss),
                released=np.array(one.released),
            )
            for one in self._drives
        }

    def _at(self, one: _WarmDrive, temperature: float) -> DriveMap:
        """Map of a drive at an absolute temperature [K]."""
        where = (
            f"scene {self._assembly.scene.name!r}: joint"
            f" {self._assembly.joints[one.j]!r} reaches"
            f" {temperature - ZERO_CELSIUS:.4g} °C at t = {self._time[-1]:.4g} s"
        )
        try:
            drive = at_temperature(one.drive, temperature, where=where)
        except InputError as error:
            raise ComputationError(
                f"{error}; to keep it cooler: a slower or shorter motion, less load, a"
                " larger drive, a lower thermal.ambient_C, or a housing with a larger"
                " thermal.conductance_W_K or thermal.heat_capacity_J_K"
            ) from error
        region = check_region(
            replace(one.transmission.attached, drive=drive),
            timestep=self._assembly.step,
            integrator=self._assembly.scene.simulation.integrator,
        )
        if not region.ok:
            raise ComputationError(f"{where}: {region.message}")
        return drive

    def _loss(self, one: _WarmDrive, states: Array) -> float:
        """Energy that a drive dissipated in an interval [J], see :meth:`advance`."""
        assembly, j = self._assembly, one.j
        nq = assembly.model.nq
        theta = states[:, 1 + assembly.motor_position[j]]
        psi = states[:, 1 + assembly.link_position[j]]
        theta_rate = states[:, 1 + nq + assembly.motor_velocity[j]]
        psi_rate = states[:, 1 + nq + assembly.link_velocity[j]]
        ahead = 0.0
        if assembly.scene.simulation.integrator == "discrete":
            ahead = 0.5 * assembly.step
        # the first sample belongs to the interval before
        laws = one.laws[-2:]
        index = np.full(len(states), len(laws) - 1)
        index[0] = 0
        signals = one.transmission.signals(
            theta - ahead * theta_rate,
            psi - ahead * psi_rate,
            theta_rate,
            psi_rate,
            course=FrictionCourse(laws, index),
            rests=one.rests,
        )
        one.rests = signals.rests
        return drive_loss(
            one.transmission,
            torsion=signals.torsion,
            slipping=signals.slipping,
            friction=signals.friction,
            stored=signals.stored,
            theta=theta,
            psi=psi,
            step=assembly.scene.simulation.step_s,
        )
