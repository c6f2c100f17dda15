"""The drive attached to a joint: names in the model, parameters and signals."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from weakref import WeakKeyDictionary

import mujoco
import numpy as np
from numpy.typing import ArrayLike

from swgjoint.errors import InputError
from swgjoint.joint.native import NativeSpring, constant_elements
from swgjoint.joint.prescribed import error_of_motor, motor_of_link
from swgjoint.maps.drive_map import DriveMap
from swgjoint.maps.friction import Friction
from swgjoint.maps.hysteresis import Jenkin, vary_with_load
from swgjoint.maps.potential import Law
from swgjoint.maps.sliders import Sliders
from swgjoint.typing import Array

LEAST_DAMPING_RATIO = 0.001
"""Damping ratio above which a drive needs no additional damping in contact [-]."""
CONTACT_DAMPING_RATIO = 0.05
"""Damping ratio, while a contact or a limit acts, of a drive without friction whose own
damping ratio is below :data:`LEAST_DAMPING_RATIO` [-].

The engine pushes a link out of a contact along a prescribed path, whatever torque this
needs. This feeds energy into the torsion of a bouncing chain, at any step size and also
under RK4. A bouncing chain touches the floor about 5 % of the time, so this value
dissipates about as much as :data:`LEAST_DAMPING_RATIO` applied all the time."""
ACCELERATIONS = 2
"""Number of plugin states that precede the hysteresis states."""
BRISTLE = 2
"""Number of plugin states of the friction, which follow the hysteresis states."""
SLIPPED = 2.0
"""Second state of a friction bristle that slipped in the last step."""


@dataclass(frozen=True, kw_only=True)
class UnresolvedOrder:
    """A harmonic that was omitted because the step cannot resolve it."""

    order: float
    """Cycles per turn of the input, |n_theta + n_psi/i| [-]."""
    error: float
    """Amplitude in the kinematic error [rad]."""
    torque: float
    """Amplitude in the output torque at rated torque and constant torsion [N·m]."""


@dataclass(frozen=True, kw_only=True, eq=False)
class JointSignals:
    """Signals of a drive: arrays of equal shape, one element for each sample."""

    torsion: Array
    """Torsion theta/i + e0 - psi [rad]."""
    transmission_error: Array
    """Output minus ideal output, psi - theta/i [rad]."""
    torque: Array
    """Torque on the link, including damping, hysteresis and friction [N·m]."""


@dataclass(frozen=True, kw_only=True, eq=False)
class JointDrive:
    """One drive on one joint of a model."""

    joint: str
    """Name of the link joint."""
    rotor: str | None
    """Name of the rotor joint at the input; None at ``rigid`` and ``kinematic``."""
    tendon: str | None
    """Name of the tendon of the drive; None without a rotor."""
    plugin: str | None
    """Name of the plugin instance; None at levels other than ``full``."""
    level: str
    """``rigid``, ``kinematic``, ``linear``, ``native`` or ``full``."""
    ratio: float
    """Signed ratio i [-]."""
    rotor_inertia: float
    """Inertia of rotor and wave generator at the input side [kg·m²]."""
    link_inertia: float
    """Link inertia about the joint at qpos0, other joints locked [kg·m²]."""
    stiffness: float
    """Mean stiffness of the map [N·m/rad]."""
    damping: float
    """Damping torque per torsion rate at the output side [N·m·s/rad]; zero without a
    rotor."""
    contact_damping: float = 0.0
    """Smallest damping while a contact or a limit acts anywhere in the model, from
    :data:`CONTACT_DAMPING_RATIO` [N·m·s/rad]; zero for drives with friction or enough
    damping and at levels other than ``full``."""
    drive: DriveMap
    """Map as simulated, without the unresolved harmonics."""
    unresolved: tuple[UnresolvedOrder, ...]
    """Omitted harmonics by increasing order."""
    native: NativeSpring | None = None
    """Native springs that represent the map; None at levels other than ``native``."""
    hysteresis: tuple[str, ...] = ()
    """Tendons of the Jenkin elements at ``native``, in the order of the map."""
    corners: tuple[str, ...] = ()
    """Dead-band tendons at ``native``, in the order of the spring's corners."""
    compensated: float = 0.0
    """Part of the integrator's damping of the native spring that is removed from the
    model [N·m·s/rad]; see :mod:`swgjoint.joint.step_damping`."""
    compensated_at: float | None = None
    """Step for which the compensation is valid [s]; None without compensation."""
    motors: tuple[str, ...] = ()
    """Names of the actuators on the joint; if there is a rotor, they turn the rotor."""
    variable: bool = False
    """Whether the model has user data by which the drive may deviate from its map."""

    def with_prefix(self, prefix: str) -> JointDrive:
        """The same drive after ``MjSpec.attach`` prefixed the names of its model."""

        def renamed(name: str | None) -> str | None:
            return None if name is None else prefix + name

        return replace(
            self,
            joint=prefix + self.joint,
            rotor=renamed(self.rotor),
            tendon=renamed(self.tendon),
            plugin=renamed(self.plugin),
            hysteresis=tuple(prefix + name for name in self.hysteresis),
            corners=tuple(prefix + name for name in self.corners),
            motors=tuple(prefix + name for name in self.motors),
        )

    @property
    def elements(self) -> tuple[Jenkin, ...]:
        """Hysteresis elements in the model; only ``native`` and ``full`` have them."""
        if self.level == "native":
            return constant_elements(self.drive)
        return self.drive.hysteresis if self.level == "full" else ()

    @property
    def friction(self) -> Friction | None:
        """Friction law at ``full``; None at ``native``, which uses rotor friction."""
        return self.drive.friction if self.level == "full" else None

    @cached_property
    def kept_orders(self) -> tuple[float, ...]:
        """Orders per input turn in the map as simulated, increasing [-]."""
        return tuple(np.unique(input_orders(self.drive)[1:]).tolist())

    @property
    def natural_frequency(self) -> float:
        """Torsion frequency of rotor against link [rad/s]; zero without a rotor."""
        if self.rotor is None:
            return 0.0
        return float(np.sqrt(self.stiffness * self.mobility))

    @property
    def mobility(self) -> float:
        """Sum of inverse inertias of rotor and link, at the output [1/(kg·m²)]."""
        rotor = self.ratio**2 * self.rotor_inertia
        return 1.0 / rotor + 1.0 / self.link_inertia

    def signals(
        self,
        theta: ArrayLike,
        psi: ArrayLike,
        theta_rate: ArrayLike = 0.0,
        psi_rate: ArrayLike = 0.0,
        slipping: ArrayLike = 0.0,
        friction: ArrayLike = 0.0,
    ) -> JointSignals:
        """Torsion, transmission error and torque from recorded joint states.

        Pass ``qpos`` and ``qvel`` of the same instant, as they are after a step. The
        discrete scheme evaluates its force half a step earlier; this method evaluates
        the law at the positions that are passed in. Hysteresis and friction depend on
        the history, so their torques are arguments.

        Args:
            theta: Rotor positions [rad].
            psi: Link positions [rad].
            theta_rate: Rotor velocities [rad/s].
            psi_rate: Link velocities [rad/s].
            slipping: Torque of the hysteresis elements along the torsion [N·m].
            friction: Friction torque of the wave generator against the flexspline
                [N·m]; used only at ``full``.

        Returns:
            Signals in the shape to which all arguments broadcast.

        Raises:
            InputError: For ``rigid`` and ``kinematic``, which have no rotor; see
                :meth:`observe`.
        """
        return self.signals_and_law(
            theta, psi, theta_rate, psi_rate, slipping, friction
        )[0]

    def signals_and_law(
        self,
        theta: ArrayLike,
        psi: ArrayLike,
        theta_rate: ArrayLike = 0.0,
        psi_rate: ArrayLike = 0.0,
        slipping: ArrayLike = 0.0,
        friction: ArrayLike = 0.0,
    ) -> tuple[JointSignals, Law | None]:
        """Result of :meth:`signals`, and the law of the map that it used.

        Args:
            theta: Rotor positions [rad].
            psi: Link positions [rad].
            theta_rate: Rotor velocities [rad/s].
            psi_rate: Link velocities [rad/s].
            slipping: Torque of the hysteresis elements along the torsion [N·m].
            friction: Friction torque of the wave generator [N·m].

        Returns:
            The signals and the law, which is None at ``linear`` and ``native``.
        """
        if self.rotor is None:
            raise InputError(
                f"joint {self.joint!r}: level {self.level} has no rotor, so it has no"
                " rotor signals; use observe(model, data)"
            )
        theta, psi, theta_rate, psi_rate, slipping, friction = np.broadcast_arrays(
            *(
                np.asarray(x, float)
                for x in (theta, psi, theta_rate, psi_rate, slipping, friction)
            )
        )
        error = psi - theta / self.ratio
        if self.level in ("linear", "native"):
            rate = theta_rate / self.ratio - psi_rate
            spring = self.native
            elastic = spring.torque(-error) if spring else -self.stiffness * error
            signals = JointSignals(
                torsion=-error,
                transmission_error=error,
                torque=elastic + self.damping * rate + slipping,
            )
            return signals, None
        law = self.drive.law(theta, psi)
        rate = law.by_theta * theta_rate + law.by_psi * psi_rate
        signals = JointSignals(
            torsion=law.torsion,
            transmission_error=error,
            torque=law.output_force
            - (self.damping * rate + slipping) * law.by_psi
            - self.drive.friction_direction[1] * friction,
        )
        return signals, law

    def motor_angle(self, psi: ArrayLike) -> Array:
        """Motor angle at zero torsion for link angles [rad], same shape.

        At ``kinematic`` this solves theta/i + e0 = psi; other levels return i psi.
        """
        if self.level == "kinematic":
            return motor_of_link(self.drive, psi)
        return self.ratio * np.asarray(psi, float)

    def prescribed_error(self, theta: ArrayLike) -> Array:
        """Error e0 that ``kinematic`` prescribes at motor angles, otherwise zero [rad].

        Args:
            theta: Commanded motor angles [rad].
        """
        if self.level == "kinematic":
            return error_of_motor(self.drive, theta)
        return np.zeros_like(np.asarray(theta, float))

    def observe(self, model: mujoco.MjModel, data: mujoco.MjData) -> JointSignals:
        """Signals from an ``MjData`` after a step; arrays of shape ().

        Under ``discrete`` the signals are evaluated at the positions half a step back,
        because the engine's positions are half a step ahead of its velocities.

        A drive without a rotor has zero torsion. Its transmission error is that of the
        map at the motor angle that corresponds to the link angle (``rigid``: zero). Its
        torque on the link is the actuator and applied torque at the joint minus the
        inertia torque of the reflected rotor.

        Args:
            model: The compiled model.
            data: State after a step.
        """
        joint = model.joint(self.joint)
        q, v = int(joint.qposadr[0]), int(joint.dofadr[0])
        if self.rotor is None:
            torque = data.qfrc_actuator[v] + data.qfrc_applied[v]
            torque = torque - self.ratio**2 * self.rotor_inertia * data.qacc[v]
            psi = np.asarray(data.qpos[q])
            return JointSignals(
                torsion=np.zeros(()),
                transmission_error=psi - self.motor_angle(psi) / self.ratio,
                torque=np.asarray(torque),
            )
        rotor = model.joint(self.rotor)
        speeds = data.qvel[int(rotor.dofadr[0])], data.qvel[v]
        ahead = 0.0
        if model.opt.integrator == mujoco.mjtIntegrator.mjINT_DISCRETE:
            ahead = 0.5 * float(model.opt.timestep)
        state = (
            data.qpos[int(rotor.qposadr[0])] - ahead * speeds[0],
            data.qpos[q] - ahead * speeds[1],
            *speeds,
        )
        got, friction = self.signals(*state), 0.0
        torsion = float(got.torsion)
        if self.plugin is None:
            slipping = sum(
                _slipping(model, data, name, torsion) for name in self.hysteresis
            )
        else:
            instance = mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_PLUGIN, self.plugin)
            first = int(model.plugin_stateadr[instance]) + ACCELERATIONS
            count = len(self.elements)
            rest = data.plugin_state[first : first + count]
            elastic, varies = 0.0, vary_with_load(self.elements)
            if varies or self.friction is not None:
                # both losses depend on the torque along the torsion, without damping
                elastic = float(self.drive.torque(torsion, *state[:2]))
            if varies:
                # the slip of the last step, with its yield torsions
                after = first + count + (0 if self.friction is None else BRISTLE)
                limit = data.plugin_state[after : after + count]
                limit = np.where(limit > 0.0, limit, np.inf)
                rest = np.clip(rest, torsion - limit, torsion + limit)
            sliders = replace(Sliders.relax(self.elements), rest=rest.copy())
            slipping = float(sliders.torque(torsion, elastic))
            if self.friction is not None:
                relaxed, known = data.plugin_state[first + count :][:BRISTLE]
                b = self.drive.friction_direction
                beta = float(np.dot(b, state[:2]))
                friction = self.friction.torque(
                    beta - float(relaxed) if known else 0.0,
                    float(np.dot(b, state[2:])),
                    (elastic + slipping) / self.ratio,
                    slipped=known == SLIPPED,
                )
        return self.signals(*state, slipping=slipping, friction=friction)


def _slipping(
    model: mujoco.MjModel, data: mujoco.MjData, tendon: str, torsion: float
) -> float:
    """Torque of one Jenkin element, from the slip that the engine stores [N·m]."""
    t = int(model.tendon(tendon).id)
    limit = float(model.tendon_springyield[t])
    rest = float(data.plastic[model.tendon_plasticadr[t]])
    return float(model.tendon_stiffness[t]) * min(max(torsion - rest, -limit), limit)


def input_orders(drive: DriveMap) -> Array:
    """Order of every harmonic per input turn [-]. Shape (n_harmonics,)."""
    n_theta, n_psi = drive.angle_orders.T
    return np.asarray(np.abs(n_theta + n_psi / drive.ratio))


Pruned = tuple[DriveMap, tuple[UnresolvedOrder, ...]]
# the joints of an arm, and runs of them, share their maps
_known: WeakKeyDictionary[DriveMap, dict[bytes, Pruned]] = WeakKeyDictionary()


def prune(
    drive: DriveMap, *, timestep: float, max_input_speed: float, max_phase_step: float
) -> Pruned:
    """Remove the harmonics whose phase advances too far in one step.

    Joints at which the same harmonics remain get the same object, so that bounds and
    sums are computed once.

    Args:
        drive: Map with all its harmonics.
        timestep: Step h [s].
        max_input_speed: Largest speed of the input [rad/s].
        max_phase_step: Largest phase step h n |theta rate| of a harmonic that is kept
            [rad].

    Returns:
        The map without these harmonics, and the removed harmonics by increasing order.
    """
    orders = input_orders(drive)
    keep = timestep * orders * abs(max_input_speed) <= max_phase_step
    if keep.all():
        return drive, ()
    known = _known.setdefault(drive, {})
    if (found := known.get(keep.tobytes())) is not None:
        return found
    torsion = drive.mean_torsion(drive.ratings.rated_torque)
    torque = np.hypot(*drive.coefficients(torsion, 1).T)
    error = np.hypot(*drive.kinematic_error.T)
    left = [
        UnresolvedOrder(
            order=float(orders[k]), error=float(error[k]), torque=float(torque[k])
        )
        for k in np.flatnonzero(~keep)
    ]
    found = drive.with_harmonics(keep), tuple(sorted(left, key=lambda u: u.order))
    known[keep.tobytes()] = found
    return found
