"""Options of a model under which drives hold: integrator and linear solver.

Under ``discrete`` the engine solves (M + h² P)(v+ - v) = h f by conjugate gradients, at
most ``iterations`` of them, to the relative residual ``tolerance``. Files for
reinforcement learning state 1 to 5, which leaves the drives' stiffness half solved: the
engine says so on the console alone. On nine robots of 6 to 32 joints, catalogue drives
took at most 15 iterations (steps up to 5 ms), drives of 1e7 N·m/rad with rotors of 1e-6
kg·m² at most 70. A tolerance of 1e-6 changes torques by 3e-5, one of 1e-4 by 1e-3.
"""

from __future__ import annotations

import warnings
from dataclasses import dataclass

import mujoco

from swgjoint.errors import InputError
from swgjoint.joint.callers import depth_of_caller

INTEGRATORS = ("discrete", "keep")
ITERATIONS, LS_ITERATIONS = 100, 50
"""MuJoCo's default limits of its solvers; fewer are raised to them."""
TOLERANCE = 1e-8
"""MuJoCo's default, for a tolerance above :data:`LARGEST_TOLERANCE`."""
LARGEST_TOLERANCE = 1e-6
_DIVERGES = (
    mujoco.mjtIntegrator.mjINT_EULER,
    mujoco.mjtIntegrator.mjINT_IMPLICIT,
    mujoco.mjtIntegrator.mjINT_IMPLICITFAST,
)


@dataclass(frozen=True, kw_only=True)
class EngineOptions:
    """What a model with drives will have."""

    integrator: mujoco.mjtIntegrator
    iterations: int
    ls_iterations: int
    tolerance: float
    said: tuple[str, ...]
    """Warnings, each one line."""

    def warn(self) -> None:
        """Say what changes and what may not hold."""
        for line in self.said:
            warnings.warn(line, stacklevel=depth_of_caller())

    def apply(self, spec: mujoco.MjSpec) -> None:
        """Set them."""
        spec.option.integrator = self.integrator
        spec.option.iterations = self.iterations
        spec.option.ls_iterations = self.ls_iterations
        spec.option.tolerance = self.tolerance


def options_for(spec: mujoco.MjSpec, wanted: str, *, rotors: bool) -> EngineOptions:
    """Options under which drives hold in a model.

    Args:
        spec: Model; unchanged.
        wanted: ``discrete`` replaces what does not hold, ``keep`` nothing.
        rotors: Whether a drive has a rotor; without one all options are kept.

    Raises:
        InputError: For a solver that leaves the drive's stiffness out.
    """
    if wanted not in INTEGRATORS:
        raise InputError(f"integrator {wanted!r}; accepted: {', '.join(INTEGRATORS)}")
    option, said = spec.option, []
    old = mujoco.mjtIntegrator(option.integrator)
    integrator = old
    solver = int(option.iterations), int(option.ls_iterations), float(option.tolerance)
    if rotors and wanted == "discrete" and old in _DIVERGES:
        integrator = mujoco.mjtIntegrator.mjINT_DISCRETE
        if old != mujoco.mjtIntegrator.mjINT_EULER:  # MuJoCo's default goes silently
            name = old.name.removeprefix("mjINT_").lower()
            said.append(
                f"integrator {name} replaced by discrete: {name} takes a drive as an"
                " explicit force and diverges; integrator='keep' keeps it, RK4 is kept"
                " as the reference"
            )
    if rotors and integrator == mujoco.mjtIntegrator.mjINT_DISCRETE:
        if option.solver == mujoco.mjtSolver.mjSOL_PGS:
            raise InputError(
                "solver PGS leaves tendons out of the discrete integrator's metric and "
                "would integrate the drive explicitly; accepted: Newton, CG"
            )
        if option.noslip_iterations > 0:
            said.append(
                "noslip_iterations > 0 solves contacts without the drives' stiffness; "
                "set it to 0 with drives"
            )
        enough = _converging(spec)
        if solver != enough:
            does = "set to" if wanted == "discrete" else "use"
            said.append(
                f"solver {_text(solver)} leave the drives' stiffness half solved under"
                f" integrator discrete; {does} {_text(enough)}"
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
    """Iterations, iterations of the line search and tolerance that do."""
    option = spec.option
    coarse = option.tolerance > LARGEST_TOLERANCE
    return (
        max(int(option.iterations), ITERATIONS),
        max(int(option.ls_iterations), LS_ITERATIONS),
        TOLERANCE if coarse else float(option.tolerance),
    )


def _text(solver: tuple[int, int, float]) -> str:
    return "iterations {}, ls_iterations {}, tolerance {:g}".format(*solver)
