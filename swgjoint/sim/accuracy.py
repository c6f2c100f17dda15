"""Outcome, error and cost of running a scene at one level, integrator and time step.

Scenes do not offer the integrators Euler and implicitfast. For these, the model is
compiled as for RK4 and its integrator is then replaced.
"""

from __future__ import annotations

import time
from collections.abc import Mapping
from dataclasses import dataclass, replace
from fractions import Fraction

import mujoco
import numpy as np

from swgjoint.errors import ComputationError, SwgError
from swgjoint.maps.drive_map import DriveMap
from swgjoint.sim.actuators import control_inputs
from swgjoint.sim.assembly import Assembly, assemble
from swgjoint.sim.equilibrium import set_start
from swgjoint.sim.figures.metrics import torque_ripple
from swgjoint.sim.run import Run
from swgjoint.sim.scene.scene import Scene
from swgjoint.sim.simulation import simulate
from swgjoint.typing import Array
from swgjoint.units import arcmin, mm

SCENE_INTEGRATORS = ("discrete", "RK4")
"""Integrators that a scene file can name."""
RECORD = 1e-3
"""Interval between recorded samples of runs with smaller steps [s]."""
TIMED_STEPS = 400
"""Number of engine steps per timing."""
QUANTITIES = {
    "link_angle": "arcmin",
    "tool_position": "mm",
    "torsion": "arcmin",
    "ripple_spectrum": "%",
}
"""Quantities that are compared with a reference run, with the unit of their errors."""


@dataclass(frozen=True, kw_only=True)
class Setting:
    """Level, integrator and time step of a simulation."""

    level: str
    """Level of detail of all joints."""
    integrator: str
    """Name of the engine's integrator, for example ``discrete`` or ``implicitfast``."""
    step: float
    """Time step of the scene [s]."""

    @property
    def name(self) -> str:
        """Integrator and step as text, for example ``RK4, 0.5 ms``."""
        return f"{self.integrator}, {1e3 * self.step:g} ms"


@dataclass(frozen=True, kw_only=True, eq=False)
class SettingOutcome:
    """Result of running a scene at one setting."""

    run: Run | None
    """The run; None if the setting was refused or the run diverged."""
    assembly: Assembly | None
    """The compiled scene; None if the setting was refused."""
    outcome: str
    """``ok``, ``sub_stepped``, ``refused`` or ``diverged``."""
    reason: str | None = None
    """Error message, or bounds that require sub-steps; None if the outcome is ``ok``.
    """


def assemble_setting(
    scene: Scene, setting: Setting, drives: Mapping[str, DriveMap] | None = None
) -> Assembly:
    """Compile a scene at a setting, with sub-steps only if it is ``discrete``.

    Args:
        scene: The scene.
        setting: Level, integrator and time step.
        drives: Maps by drive reference, used instead of loading or building them.

    Raises:
        SwgError: If the setting is refused, see
            :func:`swgjoint.sim.assembly.assemble`.
    """
    explicit = setting.integrator != "discrete"
    changes = {
        "simulation.step_s": setting.step,
        "simulation.integrator": "RK4" if explicit else "discrete",
    }
    if explicit:
        changes["simulation.max_sub_steps"] = 1
    one = scene.with_level(setting.level).with_changes(changes)  # type: ignore[arg-type]
    assembly = assemble(one, drives=drives)
    if setting.integrator not in SCENE_INTEGRATORS:
        assembly.model.opt.integrator = getattr(
            mujoco.mjtIntegrator, f"mjINT_{setting.integrator.upper()}"
        )
    return assembly


def attempt(
    scene: Scene,
    setting: Setting,
    drives: Mapping[str, DriveMap] | None = None,
) -> SettingOutcome:
    """Run a scene at a setting; refusal and divergence are reported as outcomes.

    Args:
        scene: The scene.
        setting: Level, integrator and time step.
        drives: Maps by drive reference, used instead of loading or building them.
    """
    try:
        whole = assemble_setting(scene, setting, drives)
    except SwgError as exc:
        return SettingOutcome(
            run=None, assembly=None, outcome="refused", reason=str(exc)
        )
    return attempt_assembled(whole)


def attempt_assembled(whole: Assembly) -> SettingOutcome:
    """Run a compiled scene; divergence is reported as an outcome.

    Args:
        whole: The compiled scene.
    """
    try:
        run = simulate(thin_samples(whole), name=whole.scene.name)
    except ComputationError as exc:
        return SettingOutcome(
            run=None, assembly=whole, outcome="diverged", reason=str(exc)
        )
    cut = whole.sub_steps > 1
    return SettingOutcome(
        run=run,
        assembly=whole,
        outcome="sub_stepped" if cut else "ok",
        reason="; ".join(dict.fromkeys(whole.outside.values())) or None,
    )


def thin_samples(whole: Assembly) -> Assembly:
    """Copy whose runs record one sample per :data:`RECORD` instead of one per step.

    The scene is returned unchanged if its steps do not fit into intervals of
    :data:`RECORD`, or if it has a sampled loop, which counts the steps of the scene.
    """
    step = whole.scene.simulation.step_s
    n = round(RECORD / step)
    steps = (whole.trajectory.time.size - 1) // whole.sub_steps
    fits = abs(n * step - RECORD) < 1e-9 and steps % max(n, 1) == 0
    if n < 2 or not fits or whole.loops.sampled:
        return whole
    return replace(whole, sub_steps=n * whole.sub_steps)


def errors(run: Run, reference: Run) -> dict[str, float]:
    r"""Errors of a run relative to a reference, under the keys of :data:`QUANTITIES`.

    - ``link_angle`` and ``torsion``: root mean square over the run, of the joint with
      the largest value.
    - ``tool_position``: root mean square of the distance of the tool.
    - ``ripple_spectrum``: difference of the amplitude spectra of the torque ripple up
      to the highest line of the reference, :math:`\sqrt{\sum (A_k - A_k^{ref})^2/2}`,
      divided by the rated torque, of the joint with the largest value. The spectra
      cover the part of the motion that the metrics use.

    Args:
        run: The run.
        reference: Reference run of the same motion.

    Returns:
        Errors in the units of :data:`QUANTITIES`, without ``tool_position`` if the arm
        has no tool site.

    Raises:
        ValueError: If the two runs have no samples at the same times.
    """
    own, theirs = common_samples(run, reference)

    def off(name: str) -> Array:
        return np.asarray(getattr(run, name)[own] - getattr(reference, name)[theirs])

    def worst(name: str) -> float:
        return float(np.sqrt(np.mean(off(name) ** 2, axis=0)).max())

    errors_by_name = {
        "link_angle": worst("position") / arcmin,
        "torsion": worst("torsion") / arcmin,
        "ripple_spectrum": _ripple_error(run, reference),
    }
    if run.tool_position.size:
        away = np.sum(off("tool_position") ** 2, axis=1)
        errors_by_name["tool_position"] = float(np.sqrt(away.mean())) / mm
    return {name: errors_by_name[name] for name in QUANTITIES if name in errors_by_name}


def common_samples(run: Run, other: Run) -> tuple[slice, slice]:
    """Slices that select the samples of two runs at common times.

    The common samples are one least common multiple of the two sampling intervals
    apart: 1 ms for intervals of 0.2 ms and 0.125 ms.

    Args:
        run: The first run.
        other: The second run.

    Returns:
        Slices of ``run`` and of ``other``.

    Raises:
        ValueError: If the two runs have no samples at the same times after the first.
    """
    # scenes with a sampled loop keep every step, so neither interval need divide the
    # other
    most = max(run.time.size, other.time.size)
    ratio = Fraction(run.time[1] / other.time[1]).limit_denominator(most)
    by = ratio.denominator, max(1, ratio.numerator)
    count = min(len(run.time[:: by[0]]), len(other.time[:: by[1]]))
    own, theirs = (slice(0, (count - 1) * n + 1, n) for n in by)
    same = np.allclose(run.time[own], other.time[theirs], rtol=0.0, atol=1e-9)
    if count < 2 or not same:
        raise ValueError("the two runs have no samples at the same times")
    return own, theirs


def _ripple_error(run: Run, reference: Run) -> float:
    """Largest ``ripple_spectrum`` error of all joints [%], see :func:`errors`."""
    worst = 0.0
    for j, transmission in enumerate(reference.assembly.transmissions):
        lines = _lines(torque_ripple(reference, j))
        own = np.zeros_like(lines)
        got = _lines(torque_ripple(run, j))[: lines.size]
        own[: got.size] = got
        rated = transmission.drive.ratings.rated_torque
        error = 100.0 * float(np.sqrt(0.5 * np.sum((own - lines) ** 2))) / rated
        worst = max(worst, error)
    return worst


def _lines(ripple: Array) -> Array:
    """Amplitudes at whole numbers of cycles per record [N·m].

    The last sample is dropped, because the spectrum assumes a periodic record.
    """
    n = ripple.size - 1
    return np.asarray(2.0 * np.abs(np.fft.rfft(ripple[:-1]))[1:] / max(n, 1))


@dataclass(frozen=True, kw_only=True, eq=False)
class Stepper:
    """A compiled scene in its initial state, ready for timing."""

    assembly: Assembly
    """The compiled scene."""
    data: mujoco.MjData
    """Engine data, which advances with every timing."""

    @classmethod
    def from_assembly(cls, whole: Assembly) -> Stepper:
        """Set the initial state of a scene, and the inputs of its first step."""
        data = mujoco.MjData(whole.model)
        set_start(whole, data)
        if whole.model.nu:
            data.ctrl[:] = control_inputs(whole)[0]
        return cls(assembly=whole, data=data)

    def seconds(self) -> float:
        """CPU time of one engine step, averaged over :data:`TIMED_STEPS` [s]."""
        begin = time.process_time()
        mujoco.mj_step(self.assembly.model, self.data, TIMED_STEPS)
        return (time.process_time() - begin) / TIMED_STEPS


def relative_speed(own: Stepper, rigid: Stepper, *, pairs: int = 7) -> float:
    """Engine steps per CPU second of a scene, divided by those of another scene.

    Args:
        own: The scene.
        rigid: The scene to compare with, usually the rigid arm.
        pairs: Number of timings of each scene; the result is the median of the ratios.
    """
    own.seconds(), rigid.seconds()
    ratios = [rigid.seconds() / own.seconds() for _ in range(pairs)]
    return float(np.median(ratios))


def relative_cost(own: Stepper, rigid: Stepper, *, pairs: int = 7) -> float:
    """Measured cost of a scene relative to the rigid arm, see :func:`cost_at`.

    Args:
        own: The scene.
        rigid: The same scene with rigid joints.
        pairs: Number of timings, see :func:`relative_speed`.
    """
    return cost_at(own.assembly, relative_speed(own, rigid, pairs=pairs))


def cost_at(whole: Assembly, speed: float) -> float:
    """CPU time per simulated time, relative to that of the rigid arm at 1 ms steps.

    Args:
        whole: The scene at its setting.
        speed: Relative engine speed, see :func:`relative_speed`.
    """
    return 1e-3 / (whole.step * speed)


def rigid_arm(scene: Scene, drives: Mapping[str, DriveMap] | None = None) -> Stepper:
    """The scene with rigid joints at its own time step, ready for timing.

    Args:
        scene: The scene.
        drives: Maps by drive reference, used instead of loading or building them.
    """
    step = scene.simulation.step_s
    setting = Setting(level="rigid", integrator="discrete", step=step)
    return Stepper.from_assembly(assemble_setting(scene, setting, drives))
