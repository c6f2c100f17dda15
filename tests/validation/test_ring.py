"""The plain ring between two rollers: finite elements against thin rings."""

from __future__ import annotations

import json
from functools import cache
from math import pi

import numpy as np
import pytest
from messages import naming

from swgjoint.cli.main import main
from swgjoint.errors import ComputationError
from swgjoint.fe.rings.free_ring import FreeRing, pull_ring
from swgjoint.gear.pulled_ring import elastica, small_deflection
from swgjoint.units import mm
from swgjoint.validation import ring as study

ANGLES = np.array([0.0, pi / 4, pi / 2])


def steel_ring(thickness):
    return FreeRing(
        outer_radius=68 * mm,
        thickness=thickness * mm,
        width=10 * mm,
        youngs_modulus=210e9,
        poisson_ratio=0.29,
    )


@cache
def pulled(thickness):
    travel = np.array([0.001, 0.4, 0.8, 1.2, 1.6]) * mm
    return pull_ring(steel_ring(thickness), travel, ANGLES)


def test_closed_form_of_the_thin_ring():
    """Timoshenko's diameters, and the Fourier series of an inextensional ring."""
    across = (2 / pi - 1 / 2) / (pi / 4 - 2 / pi)
    assert small_deflection(pi / 2) == pytest.approx(-across, rel=1e-12)
    n = np.arange(2, 4000, 2)[:, None]
    phi = np.linspace(0.0, pi / 2, 7)
    series = (np.cos(n * phi) / (n**2 - 1) ** 2).sum(axis=0)
    assert small_deflection(phi) == pytest.approx(series / series[0], abs=1e-9)


def test_elastica_starts_with_the_closed_form():
    """Small crowns give the closed form, its force and its curvature."""
    crown, radius = 1e-6, 0.065
    found = elastica(radius, crown, ANGLES)
    assert found.deflection / crown == pytest.approx(small_deflection(ANGLES), abs=1e-4)
    force = crown / radius / ((pi / 4 - 2 / pi) / 2)
    assert found.force == pytest.approx(force, rel=1e-4)
    assert found.curvature - 1.0 == pytest.approx(force / pi, rel=1e-3)


def test_finite_elements_approach_the_elastica():
    """Deflections and force of a ring of 2 % thickness within its shear and stretch."""
    ring, found = steel_ring(1.4), pulled(1.4)
    for w, force in zip(found.deflection, found.force, strict=True):
        thin = elastica(ring.mean_radius, float(w[0]), ANGLES)
        # 1.4 % of b_G at small deflections, falling with the thickness
        assert w / w[0] == pytest.approx(thin.deflection / w[0], abs=2e-3)
        scale = ring.bending_stiffness / ring.mean_radius**2
        assert force == pytest.approx(thin.force * scale, rel=3e-3)


def test_inward_deflection_doubles_with_large_rotations():
    """At 1.6 mm the ring goes in by twice what small deflections say."""
    w = pulled(4.5).deflection
    ratio = -w[:, 1] / w[:, 0]
    assert ratio[0] == pytest.approx(-small_deflection(pi / 4), rel=0.05)
    assert ratio[-1] == pytest.approx(2 * ratio[0], rel=0.1)


def test_mesh_convergence_of_the_ring():
    """One refinement changes the inward deflection by less than 0.1 %."""
    travel = np.array([0.8, 1.6]) * mm
    fine = pull_ring(steel_ring(4.5), travel, ANGLES, refinement=2)
    coarse = pulled(4.5).deflection[[2, 4]]
    assert -fine.deflection[:, 1] / fine.deflection[:, 0] == pytest.approx(
        -coarse[:, 1] / coarse[:, 0], rel=1e-3
    )


def test_impossible_travel_is_reported():
    """A search that does not converge ends with advice."""
    with pytest.raises(
        ComputationError, match=naming("plain ring", "0.06 m", "load steps")
    ):
        pull_ring(steel_ring(1.4), np.array([60 * mm]), ANGLES)


@pytest.mark.slow
def test_study_ring(monkeypatch, capsys, tmp_path):
    """Rows of the contract, the scaling of Table A.1, files; bad options refused."""
    monkeypatch.setattr(study, "REFINEMENTS", (1, 2))
    monkeypatch.setattr(study, "TRAVEL_mm", (0.001, 0.8, 1.6))
    out = tmp_path / "ring"
    assert main(["study", "ring", "--json", "--out", str(out)]) == 0
    result = json.loads(capsys.readouterr().out)
    rows = result["rows"]
    for row in rows:
        assert {"case", "quantity", "unit", "source_value"} <= set(row)
        assert row["converged"] == pytest.approx(row["ours"], rel=5e-3)
        if row["source_value"] is None:
            assert "withholds" in row["reason"]
        else:
            assert row["ours"] == pytest.approx(row["source_value"], rel=1e-6)
    total = [r for r in rows if r["quantity"].endswith("= 1.575 mm")]
    for a, b in zip(total[::2], total[1::2], strict=True):
        assert a["ours"] + b["ours"] == pytest.approx(1.575)
        assert b["ours"] == pytest.approx(b["thin_ring_large"], rel=0.05)
    assert sorted(p.name for p in out.iterdir()) == [
        *("ring.csv", "ring.json", "ring.png")
    ]
    assert main(["study", "ring", "--model", "3d"]) == 2
    assert main(["study", "ring", "--only", "A.7"]) == 2
