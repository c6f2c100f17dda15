"""Pictures of a spec sheet and of an acceptance test can be read."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from swgjoint.maps.drive_map import DriveMap
from swgjoint.maps.fit.error_spectrum import with_assumed_error
from swgjoint.maps.sheet.spec_sheet import measure_spec
from swgjoint.units import arcmin
from swgjoint.view import acceptance
from swgjoint.view.plots import spec as plots

FULL_TURN = {"ratio": 100, "rated_torque": 50.0}


@pytest.fixture
def figures(monkeypatch):
    """The figures that are drawn, instead of their files."""
    drawn = []
    for module in (plots, acceptance):
        monkeypatch.setattr(module, "png", lambda figure, dpi: drawn.append(figure))
    return drawn


def test_a_dense_output_turn_is_an_envelope_and_its_waves(figures):
    """Two hundred waves per turn would be a solid area; the bounds keep its width."""
    drive = DriveMap.from_numbers(stiffness=2e4, **FULL_TURN)
    sheet = measure_spec(with_assumed_error(drive, arcmin))
    plots.spec_picture("a", sheet)
    *_, whole, waves = figures[0].axes
    assert (
        "one output turn" in whole.get_title() and "input turns" in waves.get_xlabel()
    )
    low = min(line.get_ydata().min() for line in whole.lines)
    high = max(line.get_ydata().max() for line in whole.lines)
    assert high - low == pytest.approx(
        sheet.figures["transmission_accuracy_arcmin"],
        rel=0.01,  # samples beside the extremes
    )
    angle = waves.lines[0].get_xdata()
    assert angle[-1] == pytest.approx(3.0 * 360.0 / 100, rel=0.01)


def test_many_orders_stay_apart(figures):
    """At most forty lines for each load, and labels at the strongest orders."""
    drive = DriveMap.from_numbers(
        stiffness=2e4,
        kinematic_error={1 + k: 0.1 / (1.0 + k) ** 0.5 for k in range(90)},
        **FULL_TURN,
    )
    plots.spec_picture("a", measure_spec(drive))
    (orders,) = [axis for axis in figures[0].axes if "orders" in axis.get_title()]
    assert "40" in orders.get_title()
    assert all(line.get_xdata().size == 40 for line in orders.lines)
    labels = [tick for tick in orders.get_xticks() if 1.0 <= tick <= 40.0]
    assert labels[0] == 1.0 and min(np.diff(np.log(labels))) > 0.1


def test_rows_without_a_value_are_inside_the_panel(figures):
    """The first row keeps its place if it has no bar."""
    row = SimpleNamespace(
        figure="lost_motion_arcmin",
        condition="",
        limit=1.0,
        passed=None,
        simulated=None,
        measured=None,
    )
    logs = {"measured": {}, "simulated": {}}
    accepted = SimpleNamespace(rows=[row, row], logs=logs, passed=False, ratio=100.0)
    acceptance.acceptance_picture(accepted, "a")
    bottom, top = figures[0].axes[0].get_ylim()
    assert (bottom, top) == (1.5, -0.5)
