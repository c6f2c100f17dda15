"""Warn if a model in a user's own loop leaves the region of stable integration.

Attaching a drive gives a warning if the step is outside the region at rest. Step,
integrator and speed may change later. Therefore the model stores the bounds in a custom
numeric named :data:`NUMERIC`, and the engine plugin checks them in every step. It calls
``mju_warning`` once per model and step size; the warning appears on the console and in
``MUJOCO_LOG.TXT``, or goes to the handler set by ``mujoco.set_mju_user_warning``. A
scene checks the region itself, so its model has no such numeric.
"""

from __future__ import annotations

import warnings
from collections.abc import Iterable

import mujoco
import numpy as np
from numpy.typing import NDArray

from swgjoint.joint.callers import depth_of_caller
from swgjoint.joint.drive import JointDrive
from swgjoint.joint.region import MAX_PHASE_STEP, check_region

NUMERIC = "swgjoint_region"
"""Name of the custom numeric. Its four values are the largest step under ``discrete``,
under RK4 and under the other integrators [s], and the largest phase step [rad]."""
SCHEMES = ("discrete", "RK4", "implicitfast")
"""Integrators of the first three values; ``implicitfast`` represents all others."""
UNBOUNDED = 1e6
"""Value that means that the step has no limit [s]."""


def limits(drives: Iterable[JointDrive]) -> NDArray[np.float64]:
    """Largest steps at rest [s] and largest phase step [rad], see :data:`NUMERIC`."""
    steps = np.full(len(SCHEMES), UNBOUNDED)
    for drive in drives:
        for k, scheme in enumerate(SCHEMES):
            region = check_region(drive, timestep=UNBOUNDED, integrator=scheme)
            steps[k] = min(
                [steps[k]]
                + [b.timestep for b in region.bounds if not b.ok and b.timestep]
            )
    return np.append(steps, MAX_PHASE_STEP)


def add_watch(spec: mujoco.MjSpec, drives: Iterable[JointDrive]) -> None:
    """Make the plugin check the steps of a model against the bounds of its drives.

    Args:
        spec: The model, which is changed.
        drives: Drives of the model.
    """
    bounds = limits(drive for drive in drives if drive.plugin is not None)
    if (bounds[:-1] == UNBOUNDED).all():
        return
    for numeric in spec.numerics:
        if numeric.name == NUMERIC:
            numeric.data = np.minimum(numeric.data, bounds)
            return
    spec.add_numeric(name=NUMERIC, data=bounds, size=len(bounds))


def warn_outside(
    drives: Iterable[JointDrive], *, timestep: float, integrator: mujoco.mjtIntegrator
) -> None:
    """Warn once for all joints if the step is outside the region at rest.

    Args:
        drives: Drives of the model.
        timestep: Step h [s].
        integrator: Integrator of the model.
    """
    name = integrator.name.removeprefix("mjINT_")
    name = name if name == "RK4" else name.lower()
    regions = [check_region(d, timestep=timestep, integrator=name) for d in drives]
    outside = [region for region in regions if not region.ok]
    if not outside:
        return
    steps = [region.suggested_timestep for region in outside]
    worst = outside[int(np.argmin([-1.0 if s is None else s for s in steps]))]
    warnings.warn(
        worst.message
        + (f" ({len(outside)} joints outside)" if len(outside) > 1 else ""),
        stacklevel=depth_of_caller(),
    )
