"""Level native: what MuJoCo's own elements hold of a map."""

from __future__ import annotations

from dataclasses import replace

import mujoco
import numpy as np
import pytest
from played import play_hysteresis

from swgjoint.joint.native import fit_native, native_map
from swgjoint.joint.region import check_region
from swgjoint.maps.drive_map import DriveMap
from swgjoint.maps.friction import Friction
from swgjoint.maps.from_catalogue import catalogue_names
from swgjoint.maps.hysteresis import Jenkin
from swgjoint.maps.sheet.spec_sheet import spec_sheet


def with_mean(drive, torque):
    """The map with another polynomial as torque of its mean curve, no harmonics."""
    plain = drive.with_harmonics(np.zeros(len(drive.orders)))
    energy = np.polynomial.Polynomial(torque).integ()
    potential = np.zeros_like(plain.potential)
    for j, knot in enumerate(plain.torsion_knots[:-1]):
        shifted = energy(np.polynomial.Polynomial([knot, 1.0])).coef
        potential[0, 0, j, : shifted.size] = shifted
    ends = np.zeros_like(plain.end_stiffness)
    ends[0, 0] = energy.deriv(2)(plain.torsion_knots[[0, -1]])
    return replace(
        plain,
        potential=potential,
        end_stiffness=ends,
        kinematic_error=0 * plain.kinematic_error,
    )


def test_cubic_curve_comes_back(synthetic_map):
    """A map whose mean curve is a x + c x³ gives these two coefficients."""
    spring = fit_native(synthetic_map)
    x0 = synthetic_map.torsion_knots[-1]
    assert spring.linear == pytest.approx(2e4, rel=1e-9)
    assert spring.cubic == pytest.approx(2e4 * 2.0 / x0**2, rel=1e-9)
    assert spring.residual < 1e-9 and spring.note == ""
    assert spring.fitted_to == 100.0


def test_linear_map_stays_linear():
    """A map of constant stiffness has no cubic part."""
    spring = fit_native(DriveMap.linear(3e4))
    assert spring.linear == pytest.approx(3e4, rel=1e-9)
    assert spring.cubic == 0.0


def test_softening_curve_is_followed(synthetic_map):
    """A curve that softens gets dead bands of negative stiffness, slopes stay > 0."""
    x0 = synthetic_map.torsion_knots[-1]
    soft = with_mean(synthetic_map, [0, 2e4, 0, -0.1 * 2e4 / x0**2])
    soft = replace(soft, ratings=replace(soft.ratings, repeated_peak=80.0))
    spring = fit_native(soft)
    assert spring.corners and all(c.stiffness < 0.0 for c in spring.corners)
    x = np.linspace(0.0, soft.mean_torsion(80.0), 50)
    torque = soft.coefficients(x, 1)[:, 0, 0]
    assert np.abs(spring.torque(x) - torque).max() < 0.01 * soft.ratings.rated_torque
    assert spring.slope(10.0) > 0.0 and spring.note == ""


def test_curve_with_clearance_keeps_a_little_stiffness(synthetic_map):
    """Where the stiffness about zero vanishes a thousandth of the mean stays."""
    x0 = synthetic_map.torsion_knots[-1]
    loose = with_mean(synthetic_map, [0, -500.0, 0, 120.0 / x0**3])
    spring = fit_native(loose)
    assert spring.linear == pytest.approx(1e-3 * loose.mean_stiffness)
    assert "no stiffness near zero" in spring.note


@pytest.mark.parametrize("name", [n for n in catalogue_names() if "-25-" in n])
def test_catalogue_lines_are_three_tendons(name):
    """K1, K2, K3 of the level's own loop are the catalogue's within 2 %."""
    drive = DriveMap.from_catalogue(name, kinematic_error_arcmin=0.0)
    law = native_map(drive, fit_native(drive))
    keys = ["K1_Nm_rad", "K2_Nm_rad", "K3_Nm_rad"]
    found = spec_sheet(law, only=keys)
    for key in keys:
        assert found[key] == pytest.approx(drive.info["stated"][key], rel=0.02)


@pytest.mark.slow
def test_every_catalogue_row_has_its_slopes():
    """K1, K2, K3 of every row are the catalogue's within 2 %."""
    for name in catalogue_names():
        test_catalogue_lines_are_three_tendons(name)


def test_engine_has_the_torque_that_a_controller_is_told(bench):
    """Torque on the link, energy and told map agree to round-off, across corners."""
    drive = DriveMap.from_catalogue("CSG-25-100", kinematic_error_arcmin=0.0)
    b = bench(drive, level="native")
    law = native_map(b.drive.drive, b.drive.native)
    assert len(b.drive.corners) == 2 and b.model.ntendon == 3
    b.model.opt.enableflags |= int(mujoco.mjtEnableBit.mjENBL_ENERGY)
    for torque in np.linspace(-250.0, 250.0, 41):
        x = law.mean_torsion(torque)
        b.place(b.drive.ratio * x, 0.0, 0.0, 0.0)
        mujoco.mj_forward(b.model, b.data)
        assert b.data.qfrc_passive[b.v[1]] == pytest.approx(torque, abs=1e-9)
        assert b.data.energy[0] == pytest.approx(float(law.energy(x, 0.0, 0.0)))
        signals = b.drive.observe(b.model, b.data)
        assert signals.torque == pytest.approx(torque, abs=1e-9)
        assert b.drive.native.torsion(torque) == pytest.approx(x, abs=1e-12)


@pytest.mark.parametrize("integrator", ["RK4", "discrete"])
def test_native_is_full_without_the_angles(bench, synthetic_map, integrator):
    """Native elements move as the plugin with the same mean curve: RK4 to round-off.

    Under discrete both approach that motion; the native step damps the swing, by h w/2
    of critical, which takes 7 % in these 40 ms.
    """
    drive = with_mean(synthetic_map, [0, 2e4, 0, 2e4 * 2 / 0.005**2])
    paths = {}
    for level in ("native", "full"):
        b = bench(drive, level=level, integrator=integrator, step=2e-5)
        b.place(0.0, 2e-3, 10.0, 0.0)
        path = []
        for _ in range(100):
            mujoco.mj_step(b.model, b.data, 20)
            path.append(b.data.qpos[b.q].copy())
        paths[level] = np.array(path)
    swing = np.ptp(paths["full"] @ [1 / drive.ratio, -1])
    close = 1e-9 if integrator == "RK4" else 0.1
    off = (paths["native"] - paths["full"]) @ [1 / drive.ratio, -1]
    assert swing > 1e-3
    assert np.abs(off).max() < close * swing


def test_native_law_is_the_polynomial(synthetic_map):
    """The map that stands for the level has the tendon's torque."""
    spring = fit_native(synthetic_map)
    law = native_map(synthetic_map, spring)
    x = np.linspace(-0.01, 0.01, 21)
    np.testing.assert_allclose(
        law.coefficients(x, 1)[:, 0, 0], spring.torque(x), atol=1e-9 * 100.0
    )
    assert law.ratio == synthetic_map.ratio


def test_what_a_map_does_not_have_is_absent(bench, synthetic_map):
    """One tendon, no plugin, no plastic state, no friction unless the map has them."""
    b = bench(synthetic_map, level="native")
    m = b.model
    assert (m.nplugin, m.ntendon, m.nplastic, m.nv) == (0, 1, 0, 2)
    assert not m.dof_frictionloss.any()
    assert b.drive.plugin is None and b.drive.hysteresis == ()
    lossy = replace(
        synthetic_map,
        hysteresis=(
            Jenkin(stiffness=3e3, yield_torque=1.0),
            Jenkin(stiffness=2e3, yield_torque=2.0),
        ),
        friction=Friction(stiffness=50.0, coulomb=0.05, static=0.05),
    )
    b = bench(lossy, level="native")
    assert (b.model.ntendon, b.model.nplastic) == (3, 4)  # low and high end each
    assert b.drive.hysteresis == ("j_hysteresis0", "j_hysteresis1")
    np.testing.assert_allclose(b.model.dof_frictionloss[b.v], [0.05, 0.0])


def test_hysteresis_loop_loses_four_f_times_the_slip(bench):
    """A slow cycle of a Jenkin element loses 4 f (X - f/k), in the engine and played.

    Closed form of the parallelogram of one elasto-plastic element.
    """
    k, f, amplitude = 4e3, 2.0, 2e-3
    drive = replace(
        DriveMap.linear(2e4),
        hysteresis=(Jenkin(stiffness=k, yield_torque=f),),
    )
    b = bench(drive, level="native", step=1e-6)  # the step itself moves nothing
    turn = np.linspace(0.0, 4.0 * np.pi, 2001)
    torque, torsion = [], []
    for x in amplitude * np.sin(turn):
        b.place(b.drive.ratio * x, 0.0)
        b.data.qvel[:] = 0.0
        mujoco.mj_forward(b.model, b.data)
        signals = b.drive.observe(b.model, b.data)
        # the engine lets an element slip at the end of a step, so it is one step late
        late = k * amplitude * (turn[1] - turn[0])
        assert signals.torque == pytest.approx(
            b.data.qfrc_passive[b.v[1]], abs=1.001 * late
        )
        torque.append(float(signals.torque))
        torsion.append(float(signals.torsion))
        mujoco.mj_step(b.model, b.data)
    x, t = np.array(torsion), np.array(torque)
    last = slice(1000, 2001)
    loss = float(np.trapezoid(t[last], x[last]))
    assert loss == pytest.approx(4.0 * f * (amplitude - f / k), rel=0.01)
    played = 2e4 * x + play_hysteresis([Jenkin(stiffness=k, yield_torque=f)], x)
    loss = float(np.trapezoid(played[last], x[last]))
    assert loss == pytest.approx(4.0 * f * (amplitude - f / k), rel=1e-3)


def test_region_of_native_under_rk4_counts_the_hardening(bench, synthetic_map):
    """The explicit bound is on the stiffest tangent; discrete has no bound."""
    drive = bench(synthetic_map, level="native").drive
    soft = bench(synthetic_map, level="linear").drive
    steps = [
        check_region(d, timestep=1.0, integrator="RK4").suggested_timestep
        for d in (drive, soft)
    ]
    assert steps[0] < 0.8 * steps[1]
    assert check_region(drive, timestep=5e-3).ok
