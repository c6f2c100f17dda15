"""Least-squares fit of a model to a log, and what its Jacobian tells."""

from __future__ import annotations

from collections.abc import Mapping
from functools import partial

import numpy as np

from swgjoint.errors import ComputationError
from swgjoint.identify.model import Model
from swgjoint.typing import Array

_ROUNDS = 2  # fits, each with updated weights
_CORRELATED = 200  # largest lag of the autocorrelation [samples]
_SINGULAR = 1e-10  # smallest reciprocal condition number of D'D


def rms(x: Array) -> float:
    """Root mean square including the mean."""
    return float(np.sqrt(np.mean(x**2)))


def solve(model: Model) -> tuple[Array, dict[str, Array], Array]:
    """Parameter values, residuals by channel, and the weighted Jacobian.

    Raises:
        ComputationError: If the least-squares fit diverges.
    """
    from scipy.optimize import least_squares

    unknowns = model.unknowns
    values = np.array([p.start for p in unknowns])
    scale = np.array([p.scale for p in unknowns])
    bounds = (np.array([p.least for p in unknowns]), np.inf)
    measured = model.measured_torques()
    weight = {key: 1.0 / max(rms(x), 1e-12) for key, x in measured.items()}

    for _ in range(_ROUNDS):
        solution = least_squares(
            partial(_weighted, model, weight),
            values,
            bounds=bounds,
            x_scale=scale,
            max_nfev=60,
        )
        if not np.isfinite(solution.x).all():
            raise ComputationError(
                "identification diverged: check that torques and angles of the log"
                " have the signs of the drive"
            )
        values = solution.x
        got = model.torques(values)
        off = {key: measured[key] - got[key] for key in measured}
        weight = _weights(off, measured)
    # rescale the Jacobian to the final weights for the covariance
    rows = [len(r) for r in off.values()]
    old = np.sqrt([np.mean(r**2) for r in np.split(solution.fun, rows[:-1])])
    jacobian = solution.jac / np.repeat(np.maximum(old, 1e-9), rows)[:, None]
    return values, off, np.asarray(jacobian)


def _weights(
    residuals: Mapping[str, Array], measured: Mapping[str, Array]
) -> dict[str, float]:
    """Weight of each channel by its own residual; a perfect log has none."""
    return {
        key: 1.0 / max(rms(r), 1e-9 * rms(measured[key]), 1e-12)
        for key, r in residuals.items()
    }


def _weighted(model: Model, weight: Mapping[str, float], values: Array) -> Array:
    """Modelled minus measured torques of all channels, weighted [-]."""
    got, measured = model.torques(values), model.measured_torques()
    return np.concatenate([(got[key] - measured[key]) * w for key, w in weight.items()])


def newton_step(model: Model, values: Array, residuals: Mapping[str, Array]) -> Array:
    """First change of the parameters in a fit that begins at given values.

    Args:
        model: Model of a log.
        values: Parameters of a similar log.
        residuals: Measured minus modelled torque of that log by channel [N·m].
    """
    from scipy.optimize import least_squares

    weight = _weights(residuals, model.measured_torques())
    # the Jacobian at the start, by differences like those of the fit
    scale = np.array([p.scale for p in model.unknowns])
    weighted = partial(_weighted, model, weight)
    jacobian = least_squares(weighted, values, x_scale=scale, max_nfev=1).jac
    size = np.linalg.norm(jacobian, axis=0)
    step = np.linalg.lstsq(jacobian / size, -weighted(values), rcond=None)[0]
    return np.asarray(step / size)


def correlation_factor(residual: Array) -> float:
    """Factor kappa; the sum ends where the autocorrelation disappears in noise."""
    x = residual - residual.mean()
    n = len(x)
    power = float(x @ x)
    total = 1.0
    for k in range(1, min(_CORRELATED, n // 4)):
        rho = float(x[k:] @ x[:-k]) / power if power else 0.0
        if rho < 2.0 / np.sqrt(n):
            break
        total += 2.0 * rho
    return total


def effects_of(
    model: Model, values: Array, residuals: Mapping[str, Array], jacobian: Array
) -> dict[str, float]:
    """Effect of each parameter on the torques, relative to their rms [-].

    Args:
        model: The fitted model.
        values: Its parameters.
        residuals: Residual of each channel [N·m].
        jacobian: Weighted Jacobian; the rows of a channel are relative to its residual.
    """
    measured = model.measured_torques()
    left = np.array([rms(r) / rms(measured[key]) for key, r in residuals.items()])
    rows = jacobian.reshape(len(residuals), -1, values.size)
    shares = left[:, None] * np.sqrt(np.mean(rows**2, axis=1)) * np.abs(values)
    return {
        p.name: float(share)
        for p, share in zip(model.unknowns, shares.max(axis=0), strict=True)
    }


def least_determined(model: Model, information: Array) -> str | None:
    """Name of the least determined parameter; None if all are determined.

    Args:
        model: The fitted model.
        information: Product of the weighted Jacobian and its transpose.
    """
    names = [p.name for p in model.unknowns]
    scale = np.sqrt(np.diag(information))
    if not scale.all():
        return names[int(np.argmin(scale))]
    normal = information / np.outer(scale, scale)
    if np.linalg.cond(normal) > 1.0 / _SINGULAR:
        return names[int(np.abs(np.linalg.eigh(normal)[1][:, 0]).argmax())]
    return None


def covariance_of(information: Array, kappa: float) -> Array:
    """Covariance of the parameters, in their units.

    Args:
        information: Product of the weighted Jacobian and its transpose.
        kappa: Factor of correlated residuals [-].
    """
    scale = np.sqrt(np.diag(information))
    normal = information / np.outer(scale, scale)
    return np.asarray(kappa * np.linalg.inv(normal) / np.outer(scale, scale))
