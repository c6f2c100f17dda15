"""The table of the guide that relates the ripples of one tooth is computed again."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from swgjoint.drives.references import load_drive
from swgjoint.maps.sheet.turn import Turn, measure_turns
from swgjoint.sim.figures.metrics import torque_ripple
from swgjoint.units import arcmin
from swgjoint.view.run import run_scene

ROOT = Path(__file__).parents[2]
PAGE = ROOT / "notebooks/guide/tutorials/first-drive.md"
ORDER = 122


@pytest.fixture(scope="module")
def drive():
    return load_drive(str(ROOT / "notebooks/maps/reference-2d.swg"))


@pytest.fixture(scope="module")
def signals(drive):
    """Output error, input torque and output torque at constant ratio, in SI units."""
    rated = drive.ratings.rated_torque
    turns = measure_turns(drive, {"error": rated}, {"ripple": rated})
    error = turns["error"]
    count = error.signal.size
    angle = 2.0 * np.pi * float(error.period_turns) * np.arange(count) / count
    on_input, on_output = drive.forces(angle, angle / drive.ratio + error.signal)
    assert on_output == pytest.approx(rated, rel=1e-6)  # what is held constant
    torque = Turn(
        period_turns=error.period_turns,
        turns=error.turns,
        signal=-on_input - on_output / drive.ratio,
    )
    return error, torque, turns["ripple"]


def amplitude(turn):
    orders, amplitudes = turn.lines()
    return amplitudes[np.argmin(np.abs(orders - ORDER))]


def rows():
    """Figures of the table: amplitude, peak to peak and rms, by row."""
    lines = PAGE.read_text(encoding="utf-8").splitlines()
    first = next(k for k, line in enumerate(lines) if line.startswith("| quantity"))
    table = [
        line.strip("| ").split(" | ")[-3:] for line in lines[first + 2 : first + 6]
    ]
    return np.array(table, dtype=float)


def test_figures_of_the_drive(drive, signals):
    """Three rows are figures of the map, each in its own unit."""
    rated = drive.ratings.rated_torque
    for turn, unit, row in zip(
        signals, (arcmin, 1e-3, rated / 100.0), rows(), strict=False
    ):
        found = np.array([amplitude(turn), turn.peak_to_peak(), turn.rms()]) / unit
        # three printed digits
        np.testing.assert_allclose(found, row, rtol=5e-3)


def test_relations_of_the_text(drive, signals):
    """Stiffness and slope turn the error into both torques, as far as the text says."""
    error, torque, ripple = map(amplitude, signals)
    assert ripple == pytest.approx(drive.mean_stiffness * error, rel=0.03)
    slope = drive.ratings.rated_torque * ORDER * error
    assert torque == pytest.approx(2.6e-3, rel=0.01)
    assert slope == pytest.approx(3.1e-3, rel=0.01)


def test_figures_of_the_run(drive):
    """The last row and the shares of the text are those of the named command."""
    run = run_scene(
        "bench",
        overrides=["simulation.step_s=0.0001"],
        drives={"reference-2d": drive},
    )
    joint = run.metrics()["joints"]["joint"]
    lines = {
        round(line["order"]): line["amplitude_percent"] for line in joint["orders"]
    }
    found = [lines[ORDER], joint["ripple_pp_percent"], joint["ripple_rms_percent"]]
    np.testing.assert_allclose(found, rows()[3], rtol=5e-3)
    assert lines[610] == pytest.approx(0.75, rel=0.01)
    assert np.ptp(torque_ripple(run, 0)) == pytest.approx(0.2 * rows()[3, 1], rel=5e-3)
    assert rows()[3, 0] / rows()[2, 0] == pytest.approx(0.12, rel=0.05)
    assert "simulation.step_s=0.0001" in PAGE.read_text(encoding="utf-8")
