r"""Two-mass frequency response of one joint, from a periodic chirp of motor torque.

A rotor with inertia :math:`J_m` at the input and a link with inertia :math:`J_l` at the
output, coupled by a torsional stiffness K at the output, resonate at the angular
frequency :math:`\sqrt{K (1/J_l + 1/(i^2 J_m))}`. At :math:`\sqrt{K/J_l}`, the
anti-resonance, the rotor does not move. The chirp is repeated. Once the initial
transient has decayed, the ratio of two Fourier transforms over a whole period has no
leakage.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import pi, sqrt

import mujoco
import mujoco.rollout
import numpy as np

from swgjoint.errors import ComputationError, InputError
from swgjoint.joint.attach import attach
from swgjoint.maps.drive_map import DriveMap
from swgjoint.typing import Array, Complex

JOINT = "joint"
"""Name of the link joint in the model."""


@dataclass(frozen=True, kw_only=True)
class TwoMass:
    """Inertias on both sides of a drive."""

    rotor_inertia: float
    """Inertia of rotor and wave generator about the input axis [kg·m²]."""
    link_inertia: float
    """Inertia of the load about the output axis [kg·m²]."""

    def resonance(self, stiffness: float, ratio: float) -> float:
        """Undamped resonance frequency in closed form [Hz].

        Args:
            stiffness: Torsional stiffness [N·m/rad].
            ratio: Signed ratio i, output = input / i.
        """
        reflected = ratio**2 * self.rotor_inertia
        compliance = 1.0 / self.link_inertia + 1.0 / reflected
        return sqrt(stiffness * compliance) / (2.0 * pi)

    def antiresonance(self, stiffness: float) -> float:
        """Undamped anti-resonance frequency of the rotor in closed form [Hz].

        Args:
            stiffness: Torsional stiffness [N·m/rad].
        """
        return sqrt(stiffness / self.link_inertia) / (2.0 * pi)


@dataclass(frozen=True, kw_only=True)
class Chirp:
    """A periodic sine sweep whose frequency grows exponentially from low to high."""

    low: float
    """Lowest frequency [Hz]."""
    high: float
    """Highest frequency [Hz]."""
    period: float = 16.0
    """Duration of one sweep [s]; the spectral lines are 1/period apart."""

    def __post_init__(self) -> None:
        if not 0.0 < self.low < self.high or self.period * self.low < 1.0:
            raise InputError(
                f"chirp from {self.low:g} to {self.high:g} Hz in {self.period:g} s;"
                " accepted: 0 < low < high, with low * period >= 1"
            )

    def samples(self, step: float) -> Array:
        """One period with unit amplitude and its mean removed. Shape (n,).

        Args:
            step: Time between two samples [s].
        """
        n = round(self.period / step)
        rate = np.log(self.high / self.low) / n
        phase = 2.0 * pi * self.low * step * np.expm1(rate * np.arange(n)) / rate
        wave = np.sin(phase)
        return np.asarray(wave - wave.mean())


@dataclass(frozen=True, kw_only=True, eq=False)
class FrequencyResponse:
    """Complex ratios of speeds to motor torque over the frequency band of the chirp."""

    frequency: Array
    """Frequencies of the spectral lines [Hz]. Shape (n,)."""
    rotor: Complex
    """Rotor speed per motor torque [rad/s per N·m]. Shape (n,)."""
    link: Complex
    """Link speed per motor torque [rad/s per N·m]. Shape (n,)."""
    largest_torque: float
    """Largest torque of the drive's mean torsion curve in the evaluated period [N·m].
    """

    @property
    def resonance(self) -> float:
        """Frequency at which the link speed, times frequency, is largest [Hz].

        The factor compensates for the 1/f response of a free body.
        """
        return self._extreme(np.abs(self.link) * self.frequency)

    @property
    def antiresonance(self) -> float:
        """Frequency at which the rotor speed, times frequency, is smallest [Hz]."""
        return self._extreme(1.0 / (np.abs(self.rotor) * self.frequency))

    @property
    def peak(self) -> float:
        """Largest link speed per motor torque [rad/s per N·m]."""
        return float(np.abs(self.link).max())

    def _extreme(self, height: Array) -> float:
        """Frequency of the maximum [Hz], by a parabola through the logarithms."""
        k = int(height.argmax())
        if not 0 < k < len(height) - 1:
            raise ComputationError(
                "no extreme of the frequency response between"
                f" {self.frequency[0]:.3g} and {self.frequency[-1]:.3g} Hz; try a"
                " wider chirp"
            )
        a, b, c = np.log(height[k - 1 : k + 2])
        offset = 0.5 * (a - c) / (a - 2.0 * b + c)
        line = self.frequency[1] - self.frequency[0]
        return float(self.frequency[k] + offset * line)


def frequency_response(
    drive: DriveMap,
    masses: TwoMass,
    chirp: Chirp,
    *,
    level: str = "full",
    amplitude: float,
    bias: float = 0.0,
    step: float = 1e-4,
) -> FrequencyResponse:
    """Excite the rotor of a joint that is free at both ends and record both speeds.

    The model has no gravity, and the friction of the drive is left out. The integrator
    is RK4, which has almost no numerical damping at such steps.

    Args:
        drive: Map of the drive.
        masses: Inertias of rotor and link.
        chirp: Excitation.
        level: Level of the joint: ``linear``, ``native`` or ``full``.
        amplitude: Amplitude of the motor torque, reduced to the output [N·m].
        bias: Constant torque on the drive in addition, reduced to the output [N·m]. The
            motor exerts it, and a load on the link balances it.
        step: Time step of the simulation [s].

    Returns:
        Response over the band of the chirp, from its last period.

    Raises:
        InputError: If the level has no rotor or the step cannot resolve the chirp.
        ComputationError: If the simulation diverges.
    """
    if level not in ("linear", "native", "full"):
        raise InputError(f"level {level!r}; accepted: linear, native, full")
    if chirp.high * step > 0.1:
        raise InputError(
            f"chirp up to {chirp.high:g} Hz at a step of {1e3 * step:g} ms; accepted:"
            f" up to {0.1 / step:g} Hz"
        )
    spec = _bench(masses, step)
    attached = attach(
        spec,
        joint=JOINT,
        drive=drive,
        level=level,
        rotor_inertia=masses.rotor_inertia,
        friction=False,
    )
    assert attached.rotor is not None
    for name in (attached.rotor, JOINT):
        motor = spec.add_actuator(name=name, target=name)
        motor.trntype = mujoco.mjtTrn.mjTRN_JOINT
        motor.gear[0] = 1.0
    model = spec.compile()
    wave = chirp.samples(step)
    torque = (amplitude * wave + bias) / attached.ratio
    # the load balances the bias, so that only the chirp accelerates the joint
    control = np.stack([torque, np.full_like(torque, -bias)], axis=-1)
    x, speed = _second_period(model, attached.rotor, control)
    bins = np.asarray(np.fft.rfftfreq(len(wave), step), dtype=np.float64)
    band = (bins >= chirp.low) & (bins <= chirp.high)
    spectrum = np.fft.rfft(speed, axis=0)[band] / np.fft.rfft(torque)[band, None]
    torsion = drive.torsion(x[:, 0], x[:, 1])
    transmitted = drive.coefficients(torsion, 1)[:, 0, 0]
    return FrequencyResponse(
        frequency=bins[band],
        rotor=spectrum[:, 0],
        link=spectrum[:, 1],
        largest_torque=float(np.abs(transmitted).max()),
    )


def _bench(masses: TwoMass, step: float) -> mujoco.MjSpec:
    """Model of a link on a hinge without gravity."""
    spec = mujoco.MjSpec()
    spec.option.timestep = step
    spec.option.gravity = [0.0, 0.0, 0.0]
    spec.option.integrator = mujoco.mjtIntegrator.mjINT_RK4
    link = spec.worldbody.add_body(name="link")
    link.add_joint(name=JOINT, type=mujoco.mjtJoint.mjJNT_HINGE, axis=[0, 0, 1])
    link.mass, link.inertia = 1.0, [masses.link_inertia] * 3
    link.explicitinertial = True
    return spec


def _second_period(
    model: mujoco.MjModel, rotor: str, control: Array
) -> tuple[Array, Array]:
    """Angles and speeds of rotor and link in the second period. Shapes (n, 2)."""
    data = mujoco.MjData(model)
    full = mujoco.mjtState.mjSTATE_FULLPHYSICS
    state = np.empty(mujoco.mj_stateSize(model, full))
    mujoco.mj_getState(model, data, state, full)
    joints = [model.joint(name) for name in (rotor, JOINT)]
    # the state vector begins with the time
    q = [1 + int(joint.qposadr[0]) for joint in joints]
    v = [1 + model.nq + int(joint.dofadr[0]) for joint in joints]
    for _ in range(2):
        states, _ = mujoco.rollout.rollout(model, data, state[None], control[None])
        state = states[0, -1]
    if not np.isfinite(states).all():
        raise ComputationError("the response diverged; try a smaller step")
    return states[0][:, q], states[0][:, v]
