"""The picture that ``swgjoint run`` writes shows the figures that it prints."""

from __future__ import annotations

import pytest

from swgjoint.view import run_picture
from swgjoint.view.run import run_scene

SHORT = {"simulation.duration_s": 4.0}


@pytest.fixture
def figures(monkeypatch):
    """The figures that are drawn, instead of their files."""
    drawn = []
    monkeypatch.setattr(run_picture, "png", lambda figure, dpi: drawn.append(figure))
    return drawn


def run_of(drive, **changes):
    overrides = {**SHORT, **changes}
    return run_scene("bench", overrides=overrides, drives={"reference-2d": drive})


def test_bars_are_the_printed_ripple(synthetic_map, figures):
    """The bars are peak to peak and rms of the metrics; every time panel has a line."""
    run = run_of(synthetic_map)
    run_picture.run_png(run)
    torque, torsion, error, tool, bars, orders = figures[0].axes
    joint = run.metrics()["joints"]["joint"]
    heights = [bar.get_height() for bar in bars.patches]
    assert heights == [joint["ripple_pp_percent"], joint["ripple_rms_percent"]]
    assert all(len(axis.lines) == 1 for axis in (torque, torsion, error, tool, orders))
    strongest = joint["orders"][0]
    assert orders.lines[0].get_ydata().max() == pytest.approx(
        strongest["amplitude_percent"],
        rel=0.05,  # spacing of the spectrum
    )


def test_rounding_is_not_drawn_as_a_result(synthetic_map, figures):
    """Rigid joints have no ripple, and no axis is finer than the printed digits."""
    run_picture.run_png(run_of(synthetic_map, **{"defaults.level": "rigid"}))
    *lines, bars, orders = figures[0].axes
    for axis in lines:
        bottom, top = axis.get_ylim()
        assert top - bottom >= 0.999 * run_picture.FINEST
    assert [text.get_text() for text in bars.texts] == ["-"]
    assert not orders.lines
    assert "no joint has a ripple" in orders.texts[0].get_text()


def test_marks_of_the_table_are_above_the_bars(synthetic_map, figures):
    """A joint that is too fast for the tooth order has a lower bound."""
    run = run_of(synthetic_map, **{"trajectory.speed_deg_s.joint": 6.0})
    run_picture.run_png(run)
    *_, bars, _ = figures[0].axes
    joint = run.metrics()["joints"]["joint"]
    assert joint["ripple_is_lower_bound"]
    mark = "-" if joint["ripple_missing"] else ">"
    assert [text.get_text() for text in bars.texts] == [mark]
    assert bars.get_xlabel() == "> lower bound"
