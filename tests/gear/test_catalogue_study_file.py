"""The stated designs of the comparison with the catalogue can all be built."""

from __future__ import annotations

import tomllib

import pytest

from swgjoint.gear.cup import cup_torsional_stiffness
from swgjoint.gear.design import Design
from swgjoint.gear.feasibility import design_checks
from swgjoint.models_path import models_path

STUDY = tomllib.loads((models_path() / "studies/catalogue.toml").read_text())


def changed(size, ratio, variant):
    """A family design with the changes of a variant."""
    design = Design.load(f"size-{size}-{ratio}")
    changes = dict(variant.get("changes", {}))
    for table, unit in (
        ("per_pitch_diameter", 2.54 * size),
        ("per_module", design.drive.module_mm),
    ):
        changes |= {k: v * unit for k, v in variant.get(table, {}).items()}
    return design.with_changes(changes)


@pytest.mark.parametrize("variant", STUDY["variants"], ids=lambda v: v["name"])
def test_every_variant_is_feasible(variant):
    """Every size and ratio with the changes of the variant passes all checks."""
    for size in STUDY["sizes"]:
        for ratio in STUDY["ratios"]:
            design = changed(size, ratio, variant)
            assert [c.fault for c in design_checks(design) if not c.ok] == []
            assert design.flexspline.pressure_angle_deg == variant["flank_deg"]


def test_cups_are_as_stiff_as_stated():
    """At size 25 the hard cup is about 1.8 times as stiff as the soft one."""
    by_cup = {v["cup"]: v for v in STUDY["variants"]}
    hard, soft = (
        cup_torsional_stiffness(changed(25, 100, by_cup[name]))
        for name in ("hard", "soft")
    )
    # 17.2 and 9.4 of a Fourier shell of the same cups, in 1e4 N·m/rad
    assert hard == pytest.approx(17.2e4, rel=0.03)
    assert soft == pytest.approx(9.4e4, rel=0.03)


def test_everything_stated_has_a_source():
    """No figure without saying where it comes from."""
    for name, entry in STUDY["stated"].items():
        assert len(entry["source"]) > 8, name
    assert len(STUDY["individuals"]["source"]) > 8
