"""Maps from stated figures: the standard procedures find them again."""

from __future__ import annotations

import numpy as np
import pytest
from messages import naming

from swgjoint.errors import InputError
from swgjoint.maps.drive_map import DriveMap
from swgjoint.units import arcmin

KEYS = ["K1_Nm_rad", "K2_Nm_rad", "K3_Nm_rad"]
LOOP = ["lost_motion_arcmin", "hysteresis_loss_arcmin"]


def random_figures(seed: int) -> dict:
    """Rated torque, rising slopes and a pair of figures of the loop that agree."""
    rng = np.random.default_rng(seed)
    rated = 10.0 ** rng.uniform(0.5, 2.5)
    first = rated / 10.0 ** rng.uniform(-3.5, -2.5)
    slopes = first * np.cumprod([1.0, *rng.uniform(0.9, 2.0, 2)])
    straight = 0.08 * rated / first / arcmin
    lost = straight * rng.uniform(1.05, 3.0)
    return {
        "stiffness": slopes.tolist(),
        "rated_torque": rated,
        "lost_motion_arcmin": lost,
        "hysteresis_loss_arcmin": lost * rng.uniform(0.9, 1.0),
    }


@pytest.mark.parametrize("without", [(), LOOP[:1], LOOP[1:]])
def test_figures_come_back(without):
    """Ten random drives, both figures of the loop or one alone, within 0.1 %."""
    for seed in range(10):
        stated = random_figures(seed)
        stated = {key: value for key, value in stated.items() if key not in without}
        sheet = DriveMap.from_numbers(**stated).spec_sheet([*KEYS, *LOOP])
        found = [sheet[key] for key in KEYS]
        assert found == pytest.approx(stated["stiffness"], rel=1e-3)
        for key in LOOP:
            if key in stated:
                assert sheet[key] == pytest.approx(stated[key], rel=1e-3)


def test_stiffness_alone_is_a_spring():
    """One slope: no loop, and the lost motion of the slope itself."""
    drive = DriveMap.from_numbers(stiffness=3e4, rated_torque=50.0)
    assert drive.hysteresis == () and drive.ratio == -100.0
    sheet = drive.spec_sheet([*KEYS, *LOOP])
    assert [sheet[key] for key in KEYS] == pytest.approx([3e4] * 3)
    straight = 0.08 * 50.0 / 3e4 / arcmin
    assert sheet["lost_motion_arcmin"] == pytest.approx(straight)
    assert sheet["hysteresis_loss_arcmin"] is None


def test_clearance_is_free():
    """Within the clearance the torque stays below that of an unloaded loop."""
    drive = DriveMap.from_numbers(
        stiffness=3e4, rated_torque=50.0, lost_motion_arcmin=1.0
    )
    # what the first slope does not explain, or more if the teeth are stiffer than it
    least = 0.5 * (arcmin - 0.08 * 50.0 / 3e4)
    assert least < drive.mean_torsion(1e-9 * 50.0) < 0.5 * arcmin


def test_error_comes_back():
    """Each order with its amplitude, and the peak to peak of their sum."""
    error = {2: 0.3, 9: 0.1}
    drive = DriveMap.from_numbers(
        stiffness=3e4, rated_torque=50.0, ratio=80, kinematic_error=error
    )
    sheet = drive.spec_sheet(["orders", "transmission_accuracy_arcmin"])
    found = {row["order"]: row["kinematic_error_arcmin"] for row in sheet["orders"]}
    assert found == pytest.approx(error)
    x = np.linspace(0.0, 2.0 * np.pi, 2000)
    both = 0.3 * np.cos(2 * x) + 0.1 * np.cos(9 * x)
    assert sheet["transmission_accuracy_arcmin"] == pytest.approx(
        np.ptp(both), rel=1e-3
    )


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"stiffness": [1e4, 2e4]}, ("stiffness", "2 values", "K1, K2 and K3")),
        ({"stiffness": -1e4}, ("stiffness", "-10000.0", "N·m/rad", "> 1e-9")),
        ({"rated_torque": float("nan")}, ("rated_torque", "nan", "N·m")),
        ({"ratio": 7}, ("ratio 7", "30 to 320")),
        ({"T1": 30.0, "T2": 20.0}, ("T1 = 30", "T2 = 20", "increasing")),
        ({"lost_motion_arcmin": 0.4}, ("lost_motion_arcmin 0.4", "0.4584")),
        ({"lost_motion_arcmin": 3.0}, ("lost_motion_arcmin 3", "2.292")),
        (
            {"lost_motion_arcmin": 1.0, "hysteresis_loss_arcmin": 0.2},
            ("hysteresis_loss_arcmin 0.2", "0.677", "to 1"),
        ),
        (
            {"lost_motion_arcmin": 1.0, "hysteresis_loss_arcmin": 2.0},
            ("hysteresis_loss_arcmin 2", "leave out one"),
        ),
        ({"kinematic_error": {0.5: 1.0}}, ("order 0.5", "whole numbers")),
        ({"kinematic_error": {2: -1.0}}, ("order 2", "-1.0", "arcmin")),
        ({"kinematic_error": {2: 61.0}}, ("order 2", "61 arcmin", "up to 60")),
        (  # 50 N·m over 9 N·m/rad are 19,099 arcmin
            {"stiffness": 9.0},
            ("9 N·m/rad", "1.91e+04 arcmin", "rated 50 N·m", "in N·m/arcmin or 1e4"),
        ),
        (
            {"stiffness": 3.1},
            ("stiffness 3.1 N·m/rad", "1e4 N·m/rad?", "to 1200 arcmin"),
        ),
        ({"stiffness": 3e8}, ("3e+08 N·m/rad", "0.02 to 1200 arcmin")),
    ],
)
def test_wrong_figures_are_refused(change, message):
    """One line with the figure, its unit and what is accepted."""
    with pytest.raises(InputError, match=naming(*message)) as caught:
        DriveMap.from_numbers(**{"stiffness": 3e4, "rated_torque": 50.0, **change})
    assert "\n" not in str(caught.value)
