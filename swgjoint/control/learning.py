r"""Learning compensation of periodic errors in harmonics of the wave-generator angles.

At constant speed the errors of a drive deflect its link periodically by
:math:`\text{Re} \sum_k d_k e^{j\varphi_k}` with :math:`\varphi_k = p_k \alpha + q_k
\beta`. The compensation adds a link motion :math:`q = \text{Re} \sum_k c_k
e^{j\varphi_k}` to the command. The nominal two-mass model converts it to a motor angle
and a motor torque,

.. math:: \theta/i = \left(1 - \frac{\omega^2 J_l}{K + j\omega C}\right) q, \quad
    \tau = J_m \ddot\theta + J_l \ddot q / i,

with rotor and link inertias :math:`J_m` and :math:`J_l`, stiffness K, damping C and
:math:`\omega = \dot\varphi_k`. The coefficients :math:`c_k` are learned in blocks of
several turns. At the end of a block, a least-squares fit determines the harmonics
:math:`s_k` of the remaining link error (or of the output torque, divided by
:math:`-\omega^2 J_l`). The update is

.. math:: c_k \leftarrow (1 - \rho)\,c_k - \mu s_k

with the learning rate :math:`\mu` and the forgetting :math:`\rho`.

*Convergence.* The link responds to c with :math:`s = (1 + \epsilon) c + d`, where
:math:`\epsilon(\omega)` is the relative error of the nominal model. A block multiplies
the distance from the fixed point by :math:`1 - \rho - \mu(1 + \epsilon)`. The iteration
converges for :math:`|\epsilon| < 1` if :math:`\mu (1 + |\epsilon|) + \rho < 1`, and for
any model whose phase error is below 90 degrees if the rates are small enough. The
fraction :math:`\rho/(\rho + \mu(1+\epsilon))` of d remains.

A block cannot separate harmonics of alpha and beta whose phases differ only slightly:
2 alpha and 2 beta differ by two periods per output turn. A ridge term distributes their
sum among them. Later blocks at other phases separate them, as in the Kaczmarz method,
and do so faster if the phases differ more between blocks. The default block is
therefore a quarter turn of the output.

The short list of orders acts as a *robustness filter*: no other harmonics are fed back,
in particular none near the resonance unless the list contains them. Blocks in which the
commanded speed changes are ignored.

Source:
    Bodson, Sacks, Khosla (1994), "Harmonic generation in adaptive feedforward
    cancellation schemes", IEEE Trans. Autom. Control 39, 1939-1944, for the harmonic
    form; Bristow, Tharayil, Alleyne (2006), "A survey of iterative learning control",
    IEEE Control Systems 26(3), 96-114, for forgetting and the Q-filter.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Literal

import numpy as np

from swgjoint.errors import InputError
from swgjoint.gear.kinematics import angle_coefficients
from swgjoint.sim.controller import Controller, Measured, Task
from swgjoint.typing import Array, Complex

LEARNED: tuple[tuple[int, int], ...] = ((2, 0), (0, 2), (1, 1), (4, 0), (0, 4))
"""Default orders (p, q): 2 and 4 cycles per turn of the wave generator relative to
either member, excited by pitch and roundness errors, and alpha + beta, excited by an
eccentric wave generator with about 2 cycles per turn."""
RIDGE = 1e-2
"""Ridge term that is added to the mean square of each unit harmonic (0.5) in the normal
equations [-]."""


class LearningCompensation:
    """Controller that adds a learned link motion to the command of an inner one."""

    def __init__(
        self,
        inner: Controller,
        *,
        orders: Sequence[tuple[int, int]] = LEARNED,
        signal: Literal["link_angle", "output_torque"] = "link_angle",
        rate: float = 0.5,
        forgetting: float = 0.0,
        turns: float | None = None,
        delay: float | None = None,
        limit: float = 3e-3,
    ) -> None:
        """Extend a controller, which receives readings without the learned motion.

        Args:
            inner: Controller that computes the torques without the compensation.
            orders: Orders (p, q) of the learned harmonics; they act as robustness
                filter.
            signal: Sensor signal from which the harmonics are learned.
            rate: Learning rate mu, the fraction of the remaining error that a block
                removes [-], in (0, 1].
            forgetting: Fraction rho of the learned coefficients that a block forgets
                [-], in [0, 1).
            turns: Number of wave-generator turns in a block, at least 1; None: a
                quarter turn of the output.
            delay: Age of the readings of the signal [s]; None: the age stated by the
                task.
            limit: Largest amplitude of a learned harmonic [rad].

        Raises:
            InputError: If the signal, a rate or ``turns`` is not accepted.
        """
        if signal not in ("link_angle", "output_torque"):
            raise InputError(f"signal {signal!r}; accepted: link_angle, output_torque")
        few = turns is not None and not turns >= 1.0
        if few or not (0.0 < rate <= 1.0 and 0.0 <= forgetting < 1.0):
            raise InputError(
                f"learning rate {rate:g}, forgetting {forgetting:g}, {turns} turns;"
                " accepted: 0 < rate <= 1, 0 <= forgetting < 1, turns >= 1 or None"
            )
        self.inner, self.orders = inner, np.array(orders, dtype=np.int64)
        self.signal, self.rate, self.forgetting = signal, rate, forgetting
        self.turns, self.delay, self.limit = turns, delay, limit

    def start(self, task: Task, learned: Complex | None = None) -> None:
        """Prepare for a motion, optionally with coefficients learned in another one.

        Args:
            task: The commanded motion.
            learned: Coefficients c from another motion at the same speed [rad]; None
                starts at zero. Complex, shape (..., n_joints, n_orders).
        """
        joints, i = task.joints, task.joints.ratio
        self._task = task
        # cycles of each harmonic per link turn (n_joints, n_orders); the arrays below
        # have shape (n, ..., n_joints, n_orders)
        layouts = [np.array(angle_coefficients(d.layout)) for d in joints.drives]
        by = np.array([self.orders @ layout for layout in layouts])
        per_link = by[:, :, 0] * i[:, None] + by[:, :, 1]
        self._phase = task.position[..., None] * per_link
        self._omega = task.velocity[..., None] * per_link
        stiffness = _stiffness(task)
        inertia, omega = joints.link_inertia[..., None], self._omega
        spring = stiffness[:, None] + 1j * omega * joints.damping[..., None]
        # unit harmonics of the link angle, of the motor angle referred to the output
        # side, and of the motor speed, which encoders measure half a period late
        self._link = np.exp(1j * self._phase)
        self._motor = (1.0 - omega**2 * inertia / spring) * self._link
        late = np.exp(-0.5j * omega * task.period)
        self._speed = 1j * omega * late * self._motor
        rotor = i[:, None] * joints.rotor_inertia[..., None]
        on_motor = rotor * self._motor + inertia / i[:, None] * self._link
        self._torque = -(omega**2) * on_motor
        # delay them by the age of the readings
        self._link = task.as_read(self._link, "link")
        self._motor = task.as_read(self._motor, "motor")
        self._speed = task.as_read(self._speed, "motor")
        if self.signal == "link_angle":
            self._known = task.as_read(task.position, "link")
            age = task.reading_age.link
        else:
            self._known = task.as_read(task.link_torque, "torque")
            age = task.reading_age.torque
        self._age = age if self.delay is None else self.delay
        shape = (*task.position.shape[1:], len(self.orders))
        self.learned: Complex = np.zeros(shape, complex)
        """Coefficients c [rad]. Complex, shape (..., n_joints, n_orders)."""
        if learned is not None:
            self.learned = np.broadcast_to(learned, shape).astype(complex)
        self.blocks = 0
        """Number of blocks that were used for learning."""
        self._signal = np.zeros_like(task.position)
        self._ends = self._blocks(task)
        self._begin = 0
        self.inner.start(task)

    def torque(self, k: int, measured: Measured) -> Array:
        """Torque of the inner controller plus the torque of the learned motion [N·m].

        Args:
            k: Index of the control instant.
            measured: Sensor readings at this instant.

        Raises:
            InputError: If the sensor of the signal is missing.
        """
        self._read(k, measured)
        if k in self._ends:
            self._learn(slice(self._begin, k))
            self._begin = k
        c, i = self.learned, self._task.joints.ratio
        seen = replace(
            measured,
            motor_angle=measured.motor_angle - i * _sum(c, self._motor[k]),
            motor_speed=measured.motor_speed - i * _sum(c, self._speed[k]),
            link_angle=None
            if measured.link_angle is None
            else measured.link_angle - _sum(c, self._link[k]),
        )
        return np.asarray(self.inner.torque(k, seen) + _sum(c, self._torque[k]))

    def _read(self, k: int, measured: Measured) -> None:
        reading = getattr(measured, self.signal)
        if reading is None:
            raise InputError(
                f"learning from {self.signal} needs its sensor; accepted: a scene with"
                " controller.feedback = 'link' or sensors.torque"
            )
        self._signal[k] = reading - self._known[k]

    def _blocks(self, task: Task) -> frozenset[int]:
        """Instants at which blocks end; the slowest moving joint sets their length."""
        ratio = np.abs(task.joints.ratio)
        each = 0.25 * ratio if self.turns is None else np.full(ratio.size, self.turns)
        way = np.abs(task.velocity) * task.period * ratio / (2.0 * np.pi * each)
        blocks = np.cumsum(way.reshape(len(way), -1), axis=0)
        moves = blocks[-1] >= 1.0
        if not moves.any():
            return frozenset()
        slowest = blocks[:, moves].min(axis=1)
        ends = np.arange(1.0, slowest[-1] + 1e-9)
        return frozenset(np.searchsorted(slowest, ends - 1e-9).tolist())

    def _learn(self, block: slice) -> None:
        """Update the coefficients from the readings of one block."""
        velocity = self._task.velocity[block]
        steady = np.ptp(velocity, axis=0) <= 1e-9 * np.abs(velocity).max(axis=0)
        moving = steady & (velocity[0] != 0.0)
        if not moving.any():
            return
        omega = self._omega[block]
        turned = self._phase[block] - omega * self._age
        count, orders = len(turned), len(self.orders)
        line = np.linspace(-1.0, 1.0, count).reshape(-1, *(1,) * (turned.ndim - 1))
        basis = np.concatenate(
            [
                np.ones_like(turned[..., :1]),
                np.broadcast_to(line, turned[..., :1].shape),
                np.cos(turned),
                np.sin(turned),
            ],
            axis=-1,
        )
        square = np.einsum("n...a,n...b->...ab", basis, basis) / count
        right = np.einsum("n...a,n...->...a", basis, self._signal[block]) / count
        square += RIDGE * np.diag([0.0, 0.0, *np.ones(2 * orders)])
        pairs = np.linalg.solve(square, right[..., None])[..., 0][..., 2:]
        residual = pairs[..., :orders] - 1j * pairs[..., orders:]
        if self.signal == "output_torque":
            inertia = self._task.joints.link_inertia[..., None]
            with np.errstate(divide="ignore", invalid="ignore"):
                residual = residual / (-(omega[0] ** 2) * inertia)
        new = (1.0 - self.forgetting) * self.learned - self.rate * residual
        new = new * np.minimum(1.0, self.limit / np.maximum(np.abs(new), 1e-300))
        self.learned = np.where(moving[..., None], new, self.learned)
        self.blocks += 1


def _stiffness(task: Task) -> Array:
    """Tangent stiffness of the known drives at the mean torque [N·m/rad]."""
    stiffness = []
    for j, drive in enumerate(task.joints.drives):
        torsion = drive.mean_torsion(float(task.link_torque[..., j].mean()))
        stiffness.append(float(drive.coefficients(torsion, 2)[0, 0]))
    return np.array(stiffness)


def _sum(amplitudes: Complex, waves: Complex) -> Array:
    """Real part of the sum of amplitudes times unit harmonics over the orders."""
    # for these few numbers einsum takes a third of the time of a product and a sum
    return np.asarray(np.einsum("...k,...k->...", amplitudes, waves).real)
