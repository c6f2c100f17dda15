"""What the bench scene must show, from rigid to a drive with errors of its teeth."""

import numpy as np
import pytest
from solved import few_teeth, kept

from swgjoint.fe.common.sampling import sample_map
from swgjoint.maps.drive_map import DriveMap
from swgjoint.maps.fit.fit import fit_map
from swgjoint.maps.sheet.spec_sheet import measure_spec
from swgjoint.sim.run import Run
from swgjoint.units import arcmin
from swgjoint.view.run import run_scene

CATALOGUE = {"defaults.drive": "CSG-25-100"}
QUICKER = {"trajectory.speed_deg_s.joint": 12.0, "simulation.duration_s": 4.25}
"""Half the teeth pass as often at four times the speed: once in 16 steps."""
OUTPUT_TURN = {
    "trajectory.speed_deg_s.joint": 6.0,
    "trajectory.settle_s": 2.0,
    "simulation.duration_s": 62.0,
}
"""One slow turn, after what the start leaves."""
FOUR_ROLLERS = {"wave_generator.roller_radius_mm": 4.0}
"""Half as large as those of the bundled drive, like the ring."""


def coarse_map(name: str, **changes: object) -> DriveMap:
    """Map of a drive with 60/62 teeth from finite elements, sampled coarsely."""
    return kept(
        f"coarse map of {name}, {changes}, 6 angles",
        lambda: fit_map(sample_map(few_teeth(name, **changes), angles=6)),
    )


@pytest.fixture(scope="module")
def built() -> dict[str, DriveMap]:
    """Maps of two wave generators."""
    return {
        "ellipse": coarse_map("reference-2d"),
        "four rollers": coarse_map("reference-2d-four-roller", **FOUR_ROLLERS),
    }


def bench(drive: DriveMap | None = None, **overrides: object) -> Run:
    dotted = {key.replace("__", "."): value for key, value in overrides.items()}
    if drive is None:
        return run_scene("bench", overrides={**CATALOGUE, **dotted})
    return run_scene(
        "bench",
        overrides={"defaults.drive": "map", **QUICKER, **dotted},
        drives={"map": drive},
    )


def test_a_rigid_bench_has_no_error_and_no_ripple():
    """Zero, not small: there is nothing between motor and link."""
    joint = bench(defaults__level="rigid").metrics()["joints"]["joint"]
    zero = {"mean": 0.0, "rms": 0.0, "pp": 0.0}
    assert joint["torsion_arcmin"] == zero
    assert joint["transmission_error_arcmin"] == zero
    assert joint["ripple_pp_percent"] < 1e-6
    assert joint["orders"] == joint["transmission_error_orders"] == []


@pytest.mark.parametrize("share", [1.0, -0.4])
def test_a_linear_bench_twists_by_torque_over_stiffness(share):
    """Constant load of the scene over the drive's stiffness, within 0.1 %."""
    run = bench(defaults__level="linear", load__joint__rated_fraction=share)
    drive = run.assembly.transmissions[0].drive
    expected = share * drive.ratings.rated_torque / drive.mean_stiffness / arcmin
    torsion = run.metrics()["joints"]["joint"]["torsion_arcmin"]
    assert torsion["mean"] == pytest.approx(expected, rel=1e-3)
    assert torsion["pp"] < 1e-3 * abs(expected)


@pytest.mark.fe
@pytest.mark.slow
def test_a_drive_with_tooth_errors_meets_its_spec_sheet():
    """Over one slow output turn the error spans the sheet's transmission accuracy."""
    errors = {
        "tolerances.circular_spline_cumulative_pitch_um": 10.0,
        "tolerances.circular_spline_ovality_um": 5.0,
    }
    drive = coarse_map("reference-2d", **errors)
    for share, key in ((0.0, ""), (1.0, "_rated")):
        run = bench(drive, load__joint__rated_fraction=share, **OUTPUT_TURN)
        joint = run.metrics()["joints"]["joint"]
        assert joint["input_turns"] == pytest.approx(30.0, abs=0.01)
        name = f"transmission_accuracy{key}_arcmin"
        stated = measure_spec(drive, only=(name,)).as_dict()[name]
        # 10 % is asked for; 0.06 and 0.2 % were seen: inertia and what is unresolved
        assert joint["transmission_error_arcmin"]["pp"] == pytest.approx(
            stated, rel=0.02
        )
        # two and four per turn, within one bin of the 30 turns of the record
        lines = [line["order"] for line in joint["transmission_error_orders"][:2]]
        np.testing.assert_allclose(sorted(lines), [2.0, 4.0], atol=1.0 / 30.0)


@pytest.mark.fe
@pytest.mark.slow
def test_four_rollers_ripple_more_than_an_ellipse(built):
    """The wave generator that holds the flexspline at four lines ripples more."""
    ripple = {
        name: bench(drive).metrics()["joints"]["joint"]["ripple_rms_percent"]
        for name, drive in built.items()
    }
    assert ripple["four rollers"] > 1.5 * ripple["ellipse"] > 0.0


@pytest.mark.fe
@pytest.mark.slow
def test_ripple_stands_at_the_orders_of_the_drive(built):
    """Within one bin of the record at multiples of the teeth of the fixed member.

    Without errors of the teeth the pattern repeats after 1/62 of a turn: 62 per turn
    and its multiples, of which the step carries the first.
    """
    for drive in built.values():
        joint = bench(drive).metrics()["joints"]["joint"]
        bin_width = 1.0 / joint["input_turns"]
        assert bin_width == pytest.approx(1.0 / 3.75, rel=1e-3)
        strongest = joint["orders"][0]
        assert strongest["drive_order"] == 62.0
        assert strongest["order"] == pytest.approx(62.0, abs=bin_width)
        others = [line["amplitude_Nm"] for line in joint["orders"][1:]]
        assert max(others, default=0.0) < 1e-3 * strongest["amplitude_Nm"]
        assert [left["order"] for left in joint["unresolved"]] == [124.0]
    # at half the speed the step carries the second one, too
    slow = bench(
        built["ellipse"],
        trajectory__speed_deg_s__joint=6.0,
        simulation__duration_s=8.0,
    ).metrics()["joints"]["joint"]
    found = sorted(line["order"] for line in slow["orders"])
    np.testing.assert_allclose(found, [62.0, 124.0], atol=0.25)
