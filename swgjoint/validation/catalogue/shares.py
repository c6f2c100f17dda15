"""Influences on the stiffness: size, mechanisms, friction, individual errors."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from scipy.interpolate import CubicHermiteSpline

from swgjoint.fe.rings.friction import RubbedPath
from swgjoint.gear.catalogue import CatalogueRow
from swgjoint.gear.design.design import Design
from swgjoint.gear.mounting import series_compliance
from swgjoint.typing import Array
from swgjoint.units import arcmin
from swgjoint.validation.catalogue.file import CatalogueFile, variant_design
from swgjoint.validation.catalogue.printed import STIFFNESS, catalogue_row, edges
from swgjoint.validation.catalogue.rows import friction_of_path, stiffnesses
from swgjoint.validation.catalogue.runs import Found


def cube_scaling(
    study: CatalogueFile, found: Mapping[str, Found], size: int
) -> dict[str, Any]:
    """Compare K of every size with values scaled from one size by the cube of the size.

    Segments end at the largest torque that both sizes reach. The scaled torques of one
    size differ from the torques computed at another, so the curves are interpolated by
    cubics with the computed tangents.

    Args:
        study: Study file.
        found: Results by computation.
        size: Size from which K is scaled.

    Returns:
        ``rows`` and ``lines`` for the terminal.
    """
    rows, worst = [], np.zeros(len(STIFFNESS))
    first = study.variants[0]
    for ratio in study.ratios:
        base = found[f"path {size} {ratio} {first.section}"]
        if "fault" in base:
            continue
        here = friction_of_path(base, variant_design(size, ratio, first))
        for other in study.sizes:
            one = found[f"path {other} {ratio} {first.section}"]
            if "fault" in one or other == size:
                continue
            scale = (other / size) ** 3
            there = friction_of_path(one, variant_design(other, ratio, first))
            reach = min(float(there.torque[-1]), scale * float(here.torque[-1]))
            torques = np.minimum(edges(catalogue_row(other, ratio)), reach)
            own = np.diff(_smooth(there, torques))
            scaled = np.diff(_smooth(here, torques / scale))
            both = np.diff(torques) > 0.0  # omit a last segment that neither reaches
            ratios = scaled[both] / own[both]
            worst[both] = np.maximum(worst[both], np.abs(ratios - 1.0))
            rows.append(
                {
                    "size": other,
                    "ratio": ratio,
                    "up_to_Nm": reach,
                    "K_over_scaled": ratios.tolist(),
                }
            )
    percent = "/".join(f"{100 * value:.0f}" for value in worst)
    line = (
        f"K1/K2/K3 computed at each size are within {percent} % of those of size"
        f" {size} scaled by the cube of the size, up to the torque that both reach;"
        " clearances do not scale"
    )
    return {"rows": rows, "lines": [line]}


def _smooth(path: RubbedPath, torques: Array) -> Array:
    """Torsion [rad] at torques [N·m] of which the first is zero, by Hermite cubics."""
    curve = CubicHermiteSpline(path.torque, path.torsion, path.compliance)
    return np.concatenate([[0.0], curve(torques[1:])])


def shares(
    study: CatalogueFile, found: Mapping[str, Found], size: int
) -> dict[str, Any]:
    """Compute the shares of mechanisms in the compliance, and K without clearance.

    The shares refer to the tangent compliance. A bearing clearance that has been taken
    up has no share in it, but it reduces K.

    Args:
        study: Study file.
        found: Results by computation.
        size: Size of the drives.

    Returns:
        ``rows`` and ``lines`` for the terminal.
    """
    rows, lines = [], []
    first = study.variants[0]
    for ratio in study.ratios:
        name = f"path {size} {ratio} {first.section}"
        if "fault" in found[name]:
            continue
        row, design = catalogue_row(size, ratio), variant_design(size, ratio, first)
        path = friction_of_path(found[name], design)
        parts = {first.cup.name: path.series / path.compliance, **path.shares}
        rows += [
            {
                "size": size,
                "ratio": ratio,
                "mechanism": key,
                "torque_Nm": path.torque.tolist(),
                "share": share.tolist(),
            }
            for key, share in parts.items()
        ]
        text = ", ".join(
            f"{key} {'/'.join(f'{100 * part:.0f}' for part in share)}"
            for key, share in parts.items()
        )
        torques = "/".join(f"{torque:.3g}" for torque in path.torque)
        lines.append(
            f"share of the compliance [%], size {size}, ratio {ratio}, at {torques}"
            f" N·m: {text}"
        )
        tight = found[f"{name} tight"]
        if "fault" not in tight:
            K, free = (
                stiffnesses(path, row),
                stiffnesses(friction_of_path(tight, design), row),
            )
            less = "/".join(f"{value:.2f}" for value in free / K)
            rising = [f"{k[2] / k[0]:.2f}" for k in (K, free)]
            lines[-1] += (
                f"; without bearing clearance, K1/K2/K3 are multiplied by {less}, and"
                f" K3/K1 is {rising[1]} instead of {rising[0]}"
            )
            rows.append(
                {
                    "size": size,
                    "ratio": ratio,
                    "mechanism": "bearing clearance",
                    "K_without_over_with": (free / K).tolist(),
                }
            )
    return {"rows": rows, "lines": lines}


def individual_summary(
    study: CatalogueFile, found: Mapping[str, Found]
) -> dict[str, Any]:
    """Compute the mean of K over individual gears and its scatter.

    The scatter is split into that between gears and that within a gear, over the
    wave-generator angle.

    Args:
        study: Study file.
        found: Results by computation.

    Returns:
        ``rows`` and ``lines`` for the terminal.
    """
    own = study.individuals
    row = catalogue_row(own.size, own.ratio)
    tables = [
        single_stiffnesses(one, study.individual(seed), row)
        for seed in own.seeds
        if "fault" not in (one := found[f"individual {seed}"])
    ]
    if len(tables) < 2:
        return {"rows": [], "lines": ["fewer than two individual gears were solved"]}
    K = np.array(tables)
    within, between = scatter(K)
    mean = K.mean(axis=(0, 1))
    percent = ["/".join(f"{100 * v:.1f}" for v in s / mean) for s in (between, within)]
    line = (
        f"{len(K)} individual gears, size {own.size}, ratio {own.ratio}: K1/K2/K3"
        f" scatter by {percent[0]} % (one sigma) from gear to gear, and within a gear"
        f" by {percent[1]} % with the wave-generator angle ({K.shape[1]} over an"
        " output turn)"
    )
    rows = [
        {"quantity": key, "mean_Nm_rad": m, "sigma_Nm_rad": s, "within_Nm_rad": w}
        for key, m, s, w in zip(
            STIFFNESS, mean.tolist(), between.tolist(), within.tolist(), strict=True
        )
    ]
    return {"rows": rows, "lines": [line]}


def single_stiffnesses(found: Found, design: Design, row: CatalogueRow) -> Array:
    """K1, K2, K3 of an individual gear at each wave-generator angle.

    Args:
        found: Result of kind ``individual``.
        design: Individual gear, for the compliance of the cup.
        row: Ratings with the torques of the segments.

    Returns:
        Stiffnesses, shape (n_angles, 3) [N·m/rad].
    """
    torque = np.array(found["torque_Nm"])
    series = series_compliance(design, cup=True)
    x = np.array(found["ring_torsion_rad"]) + series * torque
    torques = edges(row)
    at = np.searchsorted(torque, torques[1:])
    return np.diff(torques) / np.diff(x[:, at], axis=1, prepend=0.0)


def scatter(values: Array) -> tuple[Array, Array]:
    """Standard deviations within and between gears, by one-way analysis of variance.

    The mean of a gear over a few angles scatters even if all gears are equal; this part
    is subtracted from the variance between gears.

    Args:
        values: Values, shape (n_gears, n_angles, n).

    Returns:
        Standard deviations within and between gears, shape (n,) each.
    """
    within = values.var(axis=1, ddof=1).mean(axis=0)
    means = values.mean(axis=1).var(axis=0, ddof=1)
    between = np.maximum(means - within / values.shape[1], 0.0)
    return np.sqrt(within), np.sqrt(between)


def friction(
    study: CatalogueFile, found: Mapping[str, Found], size: int
) -> dict[str, Any]:
    """Compute the width and work of the hysteresis loop at one size.

    The rows list them by friction coefficient and torque amplitude.

    Args:
        study: Study file.
        found: Results by computation.
        size: Size of the drives.

    Returns:
        ``rows`` and ``lines`` for the terminal.
    """
    rows, lines = [], []
    first = study.variants[0]
    for ratio in study.ratios:
        one = found[f"path {size} {ratio} {first.section}"]
        if "fault" in one:
            continue
        path = friction_of_path(one, variant_design(size, ratio, first))
        torque = path.torque.tolist()
        for mu in (0.0, *study.coefficients):
            rows.append(
                {
                    "size": size,
                    "ratio": ratio,
                    "mu": mu,
                    "hysteresis_loss_arcmin": path.hysteresis_loss(mu) / arcmin,
                    "torque_Nm": torque,
                    "width_arcmin": (path.widths(mu) / arcmin).tolist(),
                    "round_loss_J": path.round_loss(mu).tolist(),
                }
            )
        some = rows[-1 - len(study.coefficients) :]
        loss = "/".join(f"{row['hysteresis_loss_arcmin']:.3f}" for row in some)
        wide = "/".join(f"{width:.3f}" for width in some[-1]["width_arcmin"])
        work = np.array(some[-1]["round_loss_J"])
        grows = np.polyfit(np.log(torque[2:]), np.log(work[2:]), 1)[0]
        mus = "/".join(f"{row['mu']:g}" for row in some)
        lines.append(
            f"friction, size {size}, ratio {ratio}: the loop width at zero load is"
            f" {loss} arcmin for mu {mus} (including play); for mu"
            f" {some[-1]['mu']:g} it is {wide} arcmin at torque amplitudes of"
            f" {', '.join(f'{t:.3g}' for t in torque)} N·m, and the work per cycle is"
            f" proportional to torque to the power {grows:.1f}"
        )
    return {"rows": rows, "lines": lines}
