"""Springs at boss and housing against equilibria in which they are followed."""

from __future__ import annotations

from functools import cache
from math import pi

import numpy as np
import pytest
from messages import naming
from solved import coarse

from swgjoint.errors import DesignError
from swgjoint.fe.common.sampling import sample_map
from swgjoint.fe.meshing import simulate_meshing
from swgjoint.fe.plane.continuation import Continuation
from swgjoint.fe.plane.drive2d import sector_model
from swgjoint.gear.design.design import Design
from swgjoint.gear.mounting import series_compliance, torque_shares
from swgjoint.maps.fit.fit import fit_map

TORQUE = 20.0
LAYOUTS = ("circular_spline_fixed", "flexspline_fixed", "wave_generator_fixed")
BOSS, HOUSING = 2e5, 1e5


def mounted(layout, plain=None, **stiffness):
    parts = stiffness or {"boss": BOSS, "housing": HOUSING}
    changes = {"drive.layout": layout} | {
        f"{name}.torsional_stiffness_Nm_rad": k for name, k in parts.items()
    }
    return (plain or Design.load("reference-2d")).with_changes(changes)


@cache
def follower(layout):
    design = mounted(layout)
    model = sector_model(design, half=True)
    return Continuation(model=model, ratio=design.ratio, layout=layout)


def in_series(layout, theta, torque):
    """Psi, T_in and energy at a shaft angle, the twists of both springs followed.

    The toothed members stand at their own angles; each member's shaft or frame stands
    beyond its spring by the outside torque on the member over the stiffness. All is
    turned back until what is fixed stands at zero.
    """
    follow = follower(layout)
    state = follow.to_torque(follow.engage(follow.deflect()), torque)
    inner = theta
    for _ in range(6):
        state = follow.to_angle(state, inner)
        assert state.outcome.ok
        generator = state.wave_generator_torque
        moment = state.tooth_moment
        flexspline, circular_spline = -generator - moment, moment
        boss = state.rotation + flexspline / BOSS
        housing = state.circular_spline_rotation + circular_spline / HOUSING
        wave = state.wave_generator_angle
        fixed, shaft, output = {
            "circular_spline_fixed": (housing, wave, boss),
            "flexspline_fixed": (boss, wave, housing),
            "wave_generator_fixed": (wave, boss, housing),
        }[layout]
        inner += theta - (shaft - fixed)
    energy = state.energy + 0.5 * (flexspline**2 / BOSS + circular_spline**2 / HOUSING)
    return output - fixed, follow.input_torque(state), energy


@pytest.mark.fe
@pytest.mark.parametrize("layout", LAYOUTS)
def test_output_yields_as_two_springs_do(layout):
    """Output angle and energy of an explicit equilibrium, at a position within a pitch.

    What is left out is ripple: of the input torque on a spring, and along the turn by
    which the pattern shifts.
    """
    design = mounted(layout)
    theta = 0.3 * 2.0 * pi / 122
    follow = follower(layout)
    rigid = follow.to_torque(follow.engage(follow.deflect()), TORQUE)
    rigid = follow.to_angle(rigid, theta)
    psi, _, energy = in_series(layout, theta, TORQUE)
    yielding = series_compliance(design, cup=False)
    twist = follow.output_angle(rigid) - psi
    assert twist == pytest.approx(TORQUE * yielding, rel=2e-4)
    stored = energy - rigid.energy
    assert stored == pytest.approx(0.5 * TORQUE**2 * yielding, rel=4e-4)


@pytest.mark.fe
def test_work_equals_energy_with_springs_followed():
    """T_wg dtheta - T dpsi = dU, springs in psi and in U."""
    layout, theta, h = "circular_spline_fixed", 0.3 * 2.0 * pi / 122, 2e-4
    low, high = (in_series(layout, theta + s * h, TORQUE) for s in (-1, 1))
    gained = high[2] - low[2] + TORQUE * (high[0] - low[0])
    middle = in_series(layout, theta, TORQUE)[1]
    assert gained == pytest.approx(middle * 2 * h, rel=1e-4)


def test_shares_are_the_torques_of_the_members():
    """T on the output, T z_cs/z_fs on a fixed circular spline, T/i on an input."""
    shares = {layout: torque_shares(mounted(layout)) for layout in LAYOUTS}
    assert shares["circular_spline_fixed"] == pytest.approx(
        {"flexspline": 1.0, "circular_spline": 122 / 120}
    )
    for layout in LAYOUTS[1:]:
        assert shares[layout] == pytest.approx(
            {"flexspline": 120 / 122, "circular_spline": 1.0}
        )


@pytest.mark.fe
def test_map_and_meshing_have_the_springs():
    """The torsion of the map is larger by T sum s^2/k; its energy closes."""
    layout = "circular_spline_fixed"
    stiff = coarse()
    design = mounted(layout, stiff)
    soft, hard = (fit_map(sample_map(d, angles=4)) for d in (design, stiff))
    yielding = series_compliance(design, cup=False)
    torsion = [float(m.mean_torsion(np.array(TORQUE))) for m in (soft, hard)]
    # two fits on different knots
    assert torsion[0] - torsion[1] == pytest.approx(TORQUE * yielding, rel=1e-3)
    # four positions alias the ripple of both alike
    check = [m.info["energy_check"]["strain_energy_relative"] for m in (soft, hard)]
    assert check[0] < 1e-3
    assert soft.info["label"]["springs_Nm_rad"] == {"boss": BOSS, "housing": HOUSING}
    assert hard.info["label"]["springs_Nm_rad"] is None
    runs = [
        simulate_meshing(d, torque=TORQUE, steps=1, half=True) for d in (design, stiff)
    ]
    error = [run.series("output_error")[0] for run in runs]
    assert error[1] - error[0] == pytest.approx(TORQUE * yielding, rel=1e-9)
    energy = [run.series("energy")[0] for run in runs]
    assert energy[0] - energy[1] == pytest.approx(0.5 * TORQUE**2 * yielding, rel=1e-9)


@pytest.mark.fe
@pytest.mark.slow
def test_meshing_in_space_has_the_springs():
    """Output error and energy of a small drive whose cup is in the model itself."""
    stiff = Design.load("reference-3d-modified").with_changes(
        {
            "drive.teeth_flexspline": 40,
            "drive.teeth_circular_spline": 42,
            "drive.layout": "flexspline_fixed",
            "cup.length_mm": 14.0,
            "cup.bore_radius_mm": 7.0,
            "mesh.refinement": 0.5,
        }
    )
    design = stiff.with_changes(
        {
            "boss.torsional_stiffness_Nm_rad": BOSS,
            "housing.torsional_stiffness_Nm_rad": HOUSING,
        }
    )
    yielding = 1.0 / HOUSING + (40 / 42) ** 2 / BOSS
    runs = [
        simulate_meshing(d, model="3d", torque=5.0, steps=1, half=True)
        for d in (design, stiff)
    ]
    error = [run.series("output_error")[0] for run in runs]
    assert error[1] - error[0] == pytest.approx(5.0 * yielding, rel=1e-9)
    energy = [run.series("energy")[0] for run in runs]
    assert energy[0] - energy[1] == pytest.approx(0.5 * 5.0**2 * yielding, rel=1e-6)
    assert runs[0].to_json()["label"]["springs_Nm_rad"] == {
        "boss": BOSS,
        "housing": HOUSING,
    }


def test_springs_must_be_positive():
    """A spring without stiffness is none."""
    for name in ("boss", "housing"):
        with pytest.raises(
            DesignError,
            match=naming(
                f"{name}.torsional_stiffness_Nm_rad",
                "0 N·m/rad",
                "> 0 N·m/rad",
                "<= 1e+12 N·m/rad",
            ),
        ):
            mounted("flexspline_fixed", **{name: 0.0})
