"""What the comparison with the catalogue adds up to: nothing that failed is dropped."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from swgjoint.gear.design.design import Design
from swgjoint.gear.mounting import series_compliance
from swgjoint.maps.sheet.sampled_accuracy import ORDERS, accuracy_bracket, peaks
from swgjoint.units import arcmin
from swgjoint.validation.catalogue import catalogue as study
from swgjoint.validation.catalogue.file import CatalogueFile, variant_design
from swgjoint.validation.catalogue.printed import catalogue_row
from swgjoint.validation.catalogue.rows import ratcheting_rows
from swgjoint.validation.catalogue.shares import scatter, single_stiffnesses
from swgjoint.validation.catalogue.summary import (
    compare_scaling,
    ratcheting_orders,
    summary,
)
from swgjoint.validation.rows import StudyOptions
from swgjoint.validation.runner import run_study
from swgjoint.view.plots.catalogue import catalogue_picture


def similar(task):
    """Rings of one stiffness, by the cube of the size; straight lines."""
    drive = task.design.drive
    K = 1e5 * (drive.module_mm * drive.teeth_flexspline / 63.5) ** 3
    torque = np.array([0.005 * task.torques[-1], *task.torques])
    n = torque.size
    return {
        "torque_Nm": torque.tolist(),
        "ring_torsion_rad": (torque / K).tolist(),
        "work_per_mu_J": [1e-3] * (n - 1),
        "race_part": [0.2] * (n - 1),
        "ring_compliance_rad_Nm": [1.0 / K] * n,
        "ring_shares": {"rim": [1.0] * n},
        "balls": [9.0] * n,
        "tooth_pairs": [4.0] * n,
    }


def run(monkeypatch, broken=(), **options):
    """The part ``stiffness`` at once, some paths failed."""

    def instant(task):
        bad = task.name.startswith(tuple(broken)) if broken else False
        return {"fault": "no equilibrium"} if bad else similar(task)

    monkeypatch.setattr(study, "run_task", instant)
    return study.run_catalogue(StudyOptions(jobs=1, only=("stiffness",), **options))


def test_similar_gears_scale_by_the_cube(monkeypatch):
    """Straight lines with K as the cube, and cups that do not follow it."""
    found = run(monkeypatch)
    rows = found.more["scaling"]["rows"]
    assert len(rows) == 12
    variant = CatalogueFile.load("catalogue").variants[0]
    for row in rows:
        scale = (row["size"] / 25) ** 3
        cups = [
            series_compliance(variant_design(size, row["ratio"], variant), cup=True)
            for size in (25, row["size"])
        ]
        over = (1e-5 + cups[0]) / (1e-5 + scale * cups[1])
        # 1e-5: lengths of the family are rounded to a nanometre
        assert row["K_over_scaled"] == pytest.approx([over] * 3, rel=1e-5)
    top = {(row["size"], row["ratio"]): row["up_to_Nm"] for row in rows}
    # size 14 goes to its own 30 N·m, of the 178 of size 25 31.3
    assert top[14, 80] == 30.0
    # the 433 N·m of size 32 are more than the 204 of size 25, scaled
    assert top[32, 100] == pytest.approx(204.0 * (32 / 25) ** 3)
    worst = max(abs(row["K_over_scaled"][0] - 1.0) for row in rows)
    percent = "/".join([f"{100 * worst:.0f}"] * 3)
    assert any(f"within {percent} % of those of" in line for line in found.summary)


def line_of(found, start):
    (line,) = (line for line in found.summary if line.startswith(start))
    return line


def test_failed_cases_count_as_not_met(monkeypatch):
    """Three of four sizes without a value leave one of four, not one of one."""
    found = run(monkeypatch, [f"path {size} 100" for size in (17, 20, 32)])
    line = line_of(found, "K2, ratio 100")
    assert "3 of 5 cases have no middle" in line
    assert line.endswith("1 of 4 (3 with missing variants count as not met)")
    line = line_of(found, "K1 < K2")
    assert line.endswith("of 15 cases and is unknown in 3")


def test_a_bracket_that_lost_a_variant_is_not_met(monkeypatch):
    """K2 is 0.96 of the catalogue by both flanks; by one alone it does not count."""
    case = "size 20, ratio 80"
    for broken, met, line in (
        ([], True, "within 25 %: 4 of 4"),
        (
            ["path 20 80 28"],
            False,
            "within 25 %: 3 of 4 (1 with missing variants count as not met)",
        ),
    ):
        found = run(monkeypatch, broken)
        (row,) = (r for r in found.rows if (r.case, r.quantity) == (case, "K2"))
        assert row.more["over_source"] == pytest.approx(0.96, abs=0.01)
        assert row.more["met"] is met
        assert line_of(found, "K2, ratio 80").endswith(line)


def test_effect_of_the_ratio_is_that_of_the_middles(monkeypatch):
    """K(50)/K(100) by hand from the rows, and the count of figures within 25 %."""
    found = run(monkeypatch)
    rows = {(r.quantity, r.more["size"], r.more["ratio"]): r for r in found.rows}
    for key in ("K1", "K2", "K3"):
        pairs = [(rows[key, s, 50], rows[key, s, 100]) for s in (17, 20, 25, 32)]
        ours = np.mean([low.ours / high.ours for low, high in pairs])
        theirs = np.mean([low.source_value / high.source_value for low, high in pairs])
        line = line_of(found, f"{key}(50)/{key}(100), mean over 4 of 4 sizes")
        assert f"model {ours:.2f}, catalogue {theirs:.2f}, " in line
        assert line.endswith("missed)") == (abs(ours / theirs - 1.0) > 0.15)
    count = sum(
        abs(row.more["over_source"] - 1.0) <= 0.25
        for row in found.rows
        if row.more["goal"]
    )
    assert line_of(found, "stiffness figures") == (
        f"stiffness figures within their goal: {count} of 36 (goal: 30)"
    )
    broken = run(monkeypatch, ["path 17 50"])
    assert line_of(broken, "K1(50)/K1(100), mean over 3 of 4").endswith("missed)")


def teeth(limits):
    """Results of ratcheting at size 25 by ratio and flank; negative: a lower bound."""
    found = {
        f"ratcheting 25 {ratio} {flank}": {"limit_Nm": abs(value), "passed": value > 0}
        for (ratio, flank), value in limits.items()
    }
    mountings = {
        "fixed": {"limit_Nm": 9e3, "passed": False},
        "rigid": {"limit_Nm": 2e3, "passed": True},
        "floating": {"limit_Nm": 1.2e3, "passed": True},
    }
    return found | {
        f"ratcheting 25 {ratio} 20 {name}": one
        for ratio in (50, 80, 100)
        for name, one in mountings.items()
    }


def test_a_flank_without_a_limit_leaves_a_lower_bound():
    """The bracket has a lower end alone, and the ratio is in no ranking."""
    limits = {(50, 20): 1800, (50, 28): 1900, (80, 20): 1300, (80, 28): -1200}
    found = teeth(limits | {(100, 20): 1400, (100, 28): 1100})
    file = CatalogueFile.load("catalogue")
    (open_end,) = ratcheting_rows(file, catalogue_row(25, 80), found, 25)
    assert open_end.ours is None
    assert (open_end.more["low"], open_end.more["high"]) == (1200.0, None)
    assert open_end.more["low_over_source"] == pytest.approx(1200 / 880)
    assert "28 deg: no limit up to 1.2e+03 N·m" in open_end.reason
    (closed,) = ratcheting_rows(file, catalogue_row(25, 50), found, 25)
    # the floating wave generator is the lower end
    assert (closed.ours, closed.more["high"]) == (1550.0, 1900.0)
    assert "without the bearing: 2e+03 N·m" in closed.reason
    rows = [open_end, closed]
    lines = summary(file, rows)
    assert "ratio 50: model over catalogue 2.67 to 2.67" in lines[0]
    assert lines[1].endswith("ratio 80: no middle; lower bounds 1.36 to 1.36")
    picture = catalogue_picture([open_end])
    assert picture is not None and picture.startswith(b"\x89PNG")
    first, second = ratcheting_orders(file, found, 25)
    assert first.endswith(
        "20 deg, by ratio: model 50 > 100 > 80, catalogue 80 > 100 > 50"
    )
    assert second.endswith("28 deg, by ratio: model 50 > 100, catalogue 100 > 50")


def test_what_is_scaled_stands_over_what_is_computed():
    """Ratcheting by the cube of the size, accuracy by its inverse."""
    strewn = np.random.default_rng(0).uniform(size=96)
    theta = 160.0 * np.pi * (np.arange(96) + strewn) / 96
    error = {"input_angles_rad": theta.tolist()}
    found = {
        "ratcheting 25 80 20": {"limit_Nm": 1000.0, "passed": True},
        "ratcheting 14 80 20": {"limit_Nm": 140.496, "passed": True},
        "accuracy 25 80": error | {"error_rad": (1.4e-4 * np.cos(2 * theta)).tolist()},
        "accuracy 14 80": error | {"error_rad": (2e-4 * np.cos(2 * theta)).tolist()},
    }
    file = CatalogueFile.load("catalogue")
    lines = compare_scaling(file, found, 25, (14, 80))
    # 1000 x 0.56^3 = 175.616; 1.4 / 0.56 / 2 = 1.25
    assert [line.split(": ")[-1] for line in lines] == ["1.250", "1.250"]
    assert compare_scaling(file, {}, 25, (14, 80)) == []


@pytest.mark.parametrize("seed", range(2))
def test_peaks_of_a_known_spectrum(seed):
    """Low orders come back whole; of samples alone a part of the peaks is missed."""
    design = Design.preset("size-25-100")
    rng = np.random.default_rng(seed)
    size, phase = rng.uniform(0.2, 1.0, len(ORDERS)), rng.uniform(0, 2 * np.pi, 12)

    def error(theta):
        # alpha = theta and beta = theta - psi of a fixed circular spline, i = -100
        beta = theta + theta / 100.0
        return sum(
            a * np.cos(p * theta + q * beta + f)
            for (p, q), a, f in zip(ORDERS, size, phase, strict=True)
        )

    theta = 200.0 * np.pi * (np.arange(96) + rng.uniform(size=96)) / 96
    # 37 points a wave of the highest order, unlike those that are looked at
    dense = np.ptp(error(np.linspace(0.0, 200.0 * np.pi, 44_401)))
    low, rest = peaks(theta, error(theta), design)
    assert low == pytest.approx(dense, rel=0.01)
    assert rest < 1e-9
    assert np.ptp(error(theta)) < 0.97 * dense
    noise = 0.1 * rng.standard_normal(96)
    low, rest = peaks(theta, error(theta) + noise, design)
    # 71 degrees of freedom know a standard deviation to 8 %
    assert rest == pytest.approx(0.1, rel=0.3)


def test_the_middle_of_the_accuracy_is_hardly_biased():
    """A rest of many small orders, as rings show: 0.95 in the mean, samples 0.77."""
    design = Design.preset("size-25-50")
    size = [0.112, 0.059, 0.066, 0.068, 0.027, 0.021, 0.013, 0.018, 0.05, 0.022, 0.01]
    size.append(0.024)
    dense = np.linspace(0.0, 100.0 * np.pi, 6_001)
    over = []
    for seed in range(10):
        rng = np.random.default_rng(seed)
        more = rng.integers((-10, 1), (13, 13), size=(30, 2))
        orders = np.concatenate([ORDERS, more])
        parts = np.concatenate([size, rng.uniform(0.005, 0.022, 30)]) * arcmin
        phase = rng.uniform(0.0, 2.0 * np.pi, len(parts))

        def error(theta, orders=orders, parts=parts, phase=phase):
            angles = np.stack([theta, theta + theta / 50.0], axis=-1)
            return np.cos(angles @ orders.T + phase) @ parts

        theta = 100.0 * np.pi * (np.arange(96) + rng.uniform(size=96)) / 96
        found = {"input_angles_rad": theta, "error_rad": error(theta)}
        whole = np.ptp(error(dense)) / arcmin
        seen = np.ptp(error(theta)) / arcmin
        low, high = accuracy_bracket(found, design)
        assert seen <= low * (1.0 + 1e-12)
        over.append([seen / whole, 0.5 * (low + high) / whole])
    # three standard deviations of the mean of 10
    assert np.mean(over, axis=0) == pytest.approx([0.77, 0.95], abs=0.07)
    assert np.std(over, axis=0)[1] < 0.1


def test_scatter_within_and_among_gears():
    """Made of both: three gears apart by known steps, two angles by known steps."""
    gear, angle = np.array([-3.0, 0.0, 3.0]), np.array([-1.0, 1.0])
    within, between = scatter((10.0 + gear[:, None] + angle)[..., None])
    assert within == pytest.approx(np.sqrt(2.0))
    # means over two angles keep half of that variance: 9 - 1
    assert between == pytest.approx(np.sqrt(8.0))


def test_individual_gears_alone(monkeypatch, tmp_path):
    """They give no rows: the summary is written, and no table or picture."""

    def instant(task):
        torque = np.array([0.1, *task.torques])
        soft = 1e-5 * (1.0 + 0.05 * task.design.tolerances.seed)
        x = [(a * soft * torque).tolist() for a in (1.0, 0.8)]
        return {"torque_Nm": torque.tolist(), "ring_torsion_rad": x}

    monkeypatch.setattr(study, "run_task", instant)
    options = StudyOptions(jobs=1, only=("individuals",), folder=tmp_path)
    found = run_study("catalogue", options)
    assert [Path(name).name for name in found.files] == ["catalogue.json"]
    written = json.loads((tmp_path / "catalogue.json").read_text())
    assert written["rows"] == []
    assert "from gear to gear" in written["summary"][0]
    own = CatalogueFile.load("catalogue").individual(1)
    one = found.more["computations"]["individual 1"]
    row = catalogue_row(25, 100)
    K = single_stiffnesses(one, own, row)
    assert K.shape == (2, 3)
    # the straight line and the cup behind it
    assert 1.0 / K[0] - 1.0 / K[1] == pytest.approx([0.2 * 1.05e-5] * 3)
