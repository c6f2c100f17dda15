"""Distribution of a lot and its yield."""

from __future__ import annotations

import numpy as np
import pytest
from messages import names, naming
from solved import few_teeth, kept

from swgjoint.errors import DesignError
from swgjoint.explore import lot
from swgjoint.explore.lot import (
    FIGURES,
    LOWER,
    _figures,
    distribution,
    draw,
    run_lot,
    wilson,
)
from swgjoint.fe.tolerances.cycle import gap_errors, pitch_of, pitches_of
from swgjoint.fe.tolerances.lot import outline_change, perfect_positions, sample_lot
from swgjoint.gear.design.design import Design
from swgjoint.gear.design.tolerances import without_errors
from swgjoint.units import arcmin
from swgjoint.view.plots.lot import lot_picture

DESIGN = few_teeth("reference-2d-tolerances")


@pytest.fixture(scope="module")
def three():
    """Three drives against a limit that one of them keeps."""
    return kept("three drives of a lot", three_drives)


def three_drives():
    found = run_lot(DESIGN, count=3)
    accuracy = sorted(row["transmission_accuracy_arcmin"] for row in found["rows"])
    limit = 0.5 * (accuracy[0] + accuracy[1])
    spec = {"transmission_accuracy_arcmin": limit, "torsional_stiffness_Nm_rad": 1e3}
    return found, run_lot(DESIGN, count=3, spec=spec)


def test_interval_of_wilson():
    """Hand-checked points: none of ten, half of ten, symmetric."""
    none, half, every = wilson(0, 10), wilson(5, 10), wilson(10, 10)
    assert (none["low"], every["high"]) == (0.0, 1.0)
    assert none["high"] == pytest.approx(0.2775, abs=1e-4)
    assert half["low"] == pytest.approx(0.2366, abs=1e-4)
    assert half["high"] == pytest.approx(1.0 - half["low"])
    assert every["low"] == pytest.approx(1.0 - none["high"])


def test_percentiles_of_a_ramp():
    """0 to 100: each percentile is itself."""
    found = distribution([float(k) for k in range(101)])
    assert found == {
        "mean": 50.0,
        "std": pytest.approx(np.sqrt(850.0)),
        **{f"p{k}": float(k) for k in (1, 5, 50, 95, 99)},
    }
    assert distribution([]) is None


def test_sizes_are_the_tolerances_or_lie_below():
    """Uniform draws halve them on average; zero stays zero; seeds are drives."""
    limits = DESIGN.tolerances.model_dump(exclude={"seed"})
    assert draw(DESIGN, 5).tolerances.model_dump() == {**limits, "seed": 5}
    drawn = [draw(DESIGN, k, "uniform").tolerances for k in range(1, 200)]
    assert drawn[0] == draw(DESIGN, 1, "uniform").tolerances
    for key, limit in limits.items():
        sizes = np.array([getattr(one, key) for one in drawn])
        assert (sizes <= limit).all() and (sizes >= 0.0).all()
        # four standard deviations of the mean of 199
        assert sizes.mean() == pytest.approx(0.5 * limit, abs=0.08 * limit)


@pytest.mark.fe
def test_yield_counts_the_drives_that_keep_every_limit(three):
    """One of three, in whole and by limit; stiffness alone holds back none."""
    _, found = three
    assert [row["passed"] for row in found["rows"]].count(True) == 1
    assert found["yield"]["part"] == pytest.approx(1.0 / 3.0)
    alone = found["yield"]["by_limit"]
    assert alone["transmission_accuracy_arcmin"]["part"] == pytest.approx(1.0 / 3.0)
    assert alone["torsional_stiffness_Nm_rad"]["part"] == 1.0
    assert found["failed"] == 0


@pytest.mark.fe
def test_a_drive_does_not_depend_on_its_lot(three):
    """The third one alone has the same figures, bit for bit."""
    (alone,) = run_lot(DESIGN, count=1, seed=3)["rows"]
    assert alone == three[0]["rows"][2]


@pytest.mark.fe
def test_drives_are_kept_and_a_longer_lot_goes_on(tmp_path, monkeypatch, caplog):
    """Only drives that are not kept, or damaged, are solved; all rows stay the same."""
    monkeypatch.setenv("SWGJOINT_CACHE", str(tmp_path))
    solved = []

    def counted(drives, rests, **options):
        solved.extend(drive.tolerances.seed for drive in drives)
        return sample_lot(drives, rests, **options)

    monkeypatch.setattr(lot, "sample_lot", counted)
    first = run_lot(DESIGN, count=2)["rows"]
    assert solved == [1, 2]
    longer = run_lot(DESIGN, count=3)
    assert solved == [1, 2, 3] and longer["rows"][:2] == first
    (damaged,) = (p for p in tmp_path.rglob("*.json") if b'"seed": 2' in p.read_bytes())
    damaged.write_bytes(damaged.read_bytes().replace(b'"seed": 2', b'"seed": 7'))
    again = run_lot(DESIGN, count=3)
    assert solved == [1, 2, 3, 2] and again["rows"] == longer["rows"]
    assert again["validity"] == longer["validity"]
    assert names(caplog.text, damaged.name, "computed again")
    monkeypatch.setattr(lot, "perfect_positions", None)  # nor is the perfect drive
    assert run_lot(DESIGN, count=3)["rows"] == longer["rows"]


@pytest.mark.fe
@pytest.mark.slow
def test_figures_are_those_of_the_map():
    """Seed 1: its map of 29,280 positions has 0.76 arcmin; 320 are 3 % off at most."""
    (first,) = run_lot(Design.preset("reference-2d-tolerances"), count=1)["rows"]
    assert first["transmission_accuracy_arcmin"] == pytest.approx(0.76, rel=0.04)


@pytest.mark.fe
@pytest.mark.parametrize("key", ["circular_spline_ovality", "wave_generator_ovality"])
def test_errors_that_repeat_soon_are_not_extrapolated(key):
    """One error alone repeats with the input turn or with the pitch."""
    alone = without_errors(DESIGN).with_changes({f"tolerances.{key}_um": 6.0})
    rests = perfect_positions(alone, phases=2)
    told = _figures(sample_lot([alone], rests), 0, alone).transmission_accuracy_arcmin
    cycle = np.arange(pitches_of(alone))
    dense = []
    for k, rest in enumerate(rests):
        at = rest.at.with_supports
        outline = np.tile(outline_change(rest.at, alone), (cycle.size, 1))
        teeth = rest.at.gap_change(*gap_errors(alone, cycle))
        angle = at.respond(np.hstack([teeth, outline]), 0.0).output_angle
        dense.append(angle - k / 2 * pitch_of(alone) / alone.ratio)
    # the middle of the bracket; before, 1.4 times and 2000 times as much
    assert told == pytest.approx(np.ptp(dense) / arcmin, rel=0.15)


def test_picture_shows_a_lot_with_a_failed_drive():
    """A PNG; None where there is nothing to show."""
    row = {"seed": 1} | dict.fromkeys(FIGURES, 1.0)
    lost = {"seed": 2} | dict.fromkeys(FIGURES)
    result = {"design": "d", "sizes": "limit", "spec": None, "yield": None}
    figures = {key: distribution([1.0]) for key in FIGURES}
    shown = lot_picture(
        {**result, "rows": [row, lost], "figures": figures}, lower=LOWER
    )
    assert shown is not None and shown.startswith(b"\x89PNG")
    nothing = {**result, "rows": [lost], "figures": dict.fromkeys(FIGURES)}
    assert lot_picture(nothing, lower=LOWER) is None


def test_a_design_without_tolerances_has_no_lot():
    """One line that names what is accepted."""
    with pytest.raises(
        DesignError, match=naming("reference-2d", "zero", "[tolerances]")
    ):
        run_lot(Design.preset("reference-2d"), count=1)
