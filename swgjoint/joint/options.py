"""Model options that drives need: integrator and solver settings.

Under ``discrete`` the engine solves (M + h² P)(v+ - v) = h f by conjugate gradients, in
at most ``iterations`` iterations, to the relative residual ``tolerance``. Models for
reinforcement learning often allow only 1 to 5 iterations. The solution then does not
converge with the drive stiffness, which the engine reports only on the console. On nine
robots with 6 to 32 joints, catalogue drives needed at most 15 iterations (steps up to
5 ms), and drives of 1e7 N·m/rad with rotors of 1e-6 kg·m² at most 70. A tolerance of
1e-6 changes torques by a fraction of 3e-5, a tolerance of 1e-4 by a fraction of 1e-3.
"""

from __future__ import annotations

import warnings
from dataclasses import dataclass

import mujoco

from swgjoint.errors import InputError
from swgjoint.joint.callers import depth_of_caller

INTEGRATORS = ("discrete", "keep")
"""Accepted values of the option ``integrator`` of ``attach``."""
ITERATIONS, LS_ITERATIONS = 100, 50
"""MuJoCo's default limits of solver and line-search iterations; lower limits are
raised to them."""
TOLERANCE = 1e-8
"""MuJoCo's default tolerance [-]; replaces those above :data:`LARGEST_TOLERANCE`."""
LARGEST_TOLERANCE = 1e-6
"""Largest tolerance of the solver that is kept [-]."""
_DIVERGES = (
    mujoco.mjtIntegrator.mjINT_EULER,
    mujoco.mjtIntegrator.mjINT_IMPLICIT,
    mujoco.mjtIntegrator.mjINT_IMPLICITFAST,
)


@dataclass(frozen=True, kw_only=True)
class EngineOptions:
    """Integrator and solver options of a model with drives, and their warnings."""

    integrator: mujoco.mjtIntegrator
    iterations: int
    ls_iterations: int
    tolerance: float
    said: tuple[str, ...]
    """Warnings, one line each."""

    def warn(self) -> None:
        """Warn about options that were changed and options that may be unsuitable."""
        for line in self.said:
            warnings.warn(line, stacklevel=depth_of_caller())

    def apply(self, spec: mujoco.MjSpec) -> None:
        """Write the options into a spec."""
        spec.option.integrator = self.integrator
        spec.option.iterations = self.iterations
        spec.option.ls_iterations = self.ls_iterations
        spec.option.tolerance = self.tolerance


def options_for(spec: mujoco.MjSpec, wanted: str, *, rotors: bool) -> EngineOptions:
    """Options with which the engine integrates the drives of a model correctly.

    Args:
        spec: Model; unchanged.
        wanted: ``discrete`` replaces unsuitable options, ``keep`` replaces none.
        rotors: Whether any drive has a rotor; otherwise all options are kept.

    Raises:
        InputError: If ``wanted`` is unknown or the solver omits the drive stiffness.
    """
    if wanted not in INTEGRATORS:
        raise InputError(f"integrator {wanted!r}; accepted: {', '.join(INTEGRATORS)}")
    option, said = spec.option, []
    old = mujoco.mjtIntegrator(option.integrator)
    integrator = old
    solver = int(option.iterations), int(option.ls_iterations), float(option.tolerance)
    if rotors and wanted == "discrete" and old in _DIVERGES:
        integrator = mujoco.mjtIntegrator.mjINT_DISCRETE
        if old != mujoco.mjtIntegrator.mjINT_EULER:  # MuJoCo's default: no warning
            name = old.name.removeprefix("mjINT_").lower()
            said.append(
                f"integrator {name} replaced by discrete: {name} treats a drive as an"
                " explicit force and diverges; integrator='keep' keeps it. RK4 is never"
                " replaced"
            )
    if rotors and integrator == mujoco.mjtIntegrator.mjINT_DISCRETE:
        if option.solver == mujoco.mjtSolver.mjSOL_PGS:
            raise InputError(
                "solver PGS omits tendons from the discrete integrator's metric and "
                "would integrate the drive explicitly; accepted: Newton, CG"
            )
        if option.noslip_iterations > 0:
            said.append(
                "noslip_iterations > 0 solves contacts without the drives' stiffness; "
                "accepted for models with drives: 0"
            )
        enough = _converging(spec)
        if solver != enough:
            does = "set to" if wanted == "discrete" else "use"
            said.append(
                f"solver {_text(solver)}: may not converge with the drive stiffness"
                f" under integrator discrete; {does} {_text(enough)}"
            )
            if wanted == "discrete":
                solver = enough
    return EngineOptions(
        integrator=integrator,
        iterations=solver[0],
        ls_iterations=solver[1],
        tolerance=solver[2],
        said=tuple(said),
    )


def _converging(spec: mujoco.MjSpec) -> tuple[int, int, float]:
    """Sufficient iterations, line-search iterations and tolerance."""
    option = spec.option
    coarse = option.tolerance > LARGEST_TOLERANCE
    return (
        max(int(option.iterations), ITERATIONS),
        max(int(option.ls_iterations), LS_ITERATIONS),
        TOLERANCE if coarse else float(option.tolerance),
    )


def _text(solver: tuple[int, int, float]) -> str:
    return "iterations {}, ls_iterations {}, tolerance {:g}".format(*solver)
