"""Level kinematic in a scene: who moves when the gear errs."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from swgjoint.maps.drive_map import DriveMap

ORDER, ERROR, LINK = 4, 1e-4, 1.0  # bench.xml: 1 kg·m² about the axis


@pytest.fixture
def wave() -> DriveMap:
    """A stiff drive with one harmonic of kinematic error."""
    linear = DriveMap.linear(
        3e6, teeth_flexspline=120, teeth_circular_spline=122, rated_torque=20.0
    )
    return replace(
        linear,
        orders=np.array([[0, 0], [ORDER, 0]]),
        potential=np.concatenate([linear.potential, 0 * linear.potential]),
        end_stiffness=np.concatenate([linear.end_stiffness, 0 * linear.end_stiffness]),
        kinematic_error=np.array([[0.0, 0.0], [ERROR, 0.0]]),
    )


def at_order(run, signal):
    """Complex amplitude of a signal at the error's order, by least squares."""
    window = run.steady
    phase = ORDER * run.motor_position[window, 0]
    t = np.linspace(-1, 1, phase.size)
    basis = np.column_stack([np.cos(phase), -np.sin(phase), np.ones_like(t), t, t**2])
    x = np.linalg.lstsq(basis, signal[window], rcond=None)[0]
    return complex(x[0], x[1])


SLOW = {
    "simulation__duration_s": 3.0,
    "trajectory__settle_s": 1.0,
    "trajectory__speed_deg_s__joint": 30.0,
    "load__joint__torque_Nm": 0.5,
}


def test_error_of_a_run_is_the_kinematic_error(bench, wave):
    """Link less ideal link is e0 of the motor angle, and there is no torsion."""
    run = bench(wave, defaults__level="kinematic", **SLOW)
    theta = run.motor_position[:, 0]
    e0 = ERROR * np.cos(ORDER * run.assembly.ratio[0] * run.reference[:, 0])
    np.testing.assert_allclose(run.transmission_error[:, 0], e0, atol=1e-12)
    np.testing.assert_allclose(
        run.position[:, 0] - theta / run.assembly.ratio[0], e0, atol=1e-12
    )
    assert not run.torsion.any()
    joint = run.metrics()["joints"]["joint"]
    assert joint["level"] == "kinematic"
    [line] = joint["transmission_error_orders"][:1]
    assert line["order"] == pytest.approx(ORDER, abs=0.05)
    assert joint["transmission_error_arcmin"]["pp"] == pytest.approx(
        2 * ERROR * 10_800 / np.pi, rel=1e-3
    )


@pytest.mark.parametrize("rotor", [1e-5, 1e-4, 1e-3])
def test_fast_error_is_shared_by_the_inertias(bench, wave, rotor):
    """Above the loop's bandwidth the link takes i²J/(M + i²J) of the error.

    Momentum of rotor and link under the constraint, to first order in e0.
    """
    loop = {"controller__natural_frequency_Hz": 1.0, "controller__damping_ratio": 0.5}
    run = bench(
        wave,
        defaults__level="kinematic",
        defaults__rotor_inertia_kgm2=rotor,
        **SLOW,
        **loop,
    )
    share = at_order(run, run.position[:, 0] - run.reference[:, 0]) / ERROR
    reflected = 60.0**2 * rotor
    want = reflected / (LINK + reflected)
    # 1 Hz loop against 20 Hz of the error: two inertias, 5 % of phase from damping
    assert share.real == pytest.approx(want, abs=0.02)
    assert abs(share.imag) < 0.08


def test_slow_error_goes_to_the_link(bench, wave):
    """Well below the loop's bandwidth the motor stays on its reference."""
    slow = {**SLOW, "trajectory__speed_deg_s__joint": 1.0}
    run = bench(
        wave,
        defaults__level="kinematic",
        controller__natural_frequency_Hz=20.0,
        controller__damping_ratio=1.0,
        **slow,
    )
    share = at_order(run, run.position[:, 0] - run.reference[:, 0]) / ERROR
    assert abs(share - 1.0) < 0.02


@pytest.mark.parametrize("integrator", ["discrete", "RK4"])
def test_kinematic_agrees_with_a_stiff_full_drive(bench, wave, integrator):
    """Link motion and torque at the error's order are those of ``full`` with K high."""
    keys = {
        **SLOW,
        "simulation__integrator": integrator,
        "simulation__step_s": 1e-4,
        "simulation__duration_s": 2.0,
    }
    got = {
        level: bench(wave, defaults__level=level, **keys)
        for level in ("kinematic", "full")
    }
    for name in ("position", "output_torque", "motor_torque"):
        link, want = (
            at_order(got[level], getattr(got[level], name)[:, 0])
            for level in ("kinematic", "full")
        )
        assert abs(want) > 1e-6
        assert abs(link - want) < 0.03 * abs(want)


def test_motor_holds_the_start(bench, wave):
    """At rest the joint stays where link and motor fit together."""
    run = bench(
        wave,
        defaults__level="kinematic",
        trajectory__speed_deg_s__joint=0.0,
        trajectory__start_deg={"joint": 17.0},
        load__joint__torque_Nm=5.0,
    )
    assert np.abs(np.ptp(run.position[:, 0])) < 1e-12
    assert np.abs(run.output_torque[:, 0] - 5.0).max() < 1e-9


def test_contents_name_what_is_neglected(bench, wave):
    """No degree of freedom beside the link; the ratio's change is stated in percent."""
    run = bench(wave, defaults__level="kinematic", **SLOW)
    found = run.contains
    assert (found["degrees_of_freedom"], found["tendons"]) == (1, 0)
    assert found["plugin_instances"] == 0
    assert found["joints"]["joint"]["orders"] == [4.0]
    parts = " ".join(item["part"] for item in found["left_out"])
    # i n e0 = 60 x 4 x 1e-4
    assert "up to 2.4 %" in parts and "torsion" in parts


def test_native_runs_and_says_what_has_no_native_form(bench, synthetic_map):
    """Level native: rotor and tendon, no plugin; torque near that of ``full``."""
    got = {
        level: bench(synthetic_map, defaults__level=level)
        for level in ("native", "full")
    }
    found = got["native"].contains
    assert (found["degrees_of_freedom"], found["tendons"]) == (2, 1)
    assert found["plugin_instances"] == 0
    assert found["joints"]["joint"]["native"]["cubic_Nm_rad3"] > 0.0
    left = {item["part"]: item["reason"] for item in found["left_out"]}
    assert left["kinematic error and torque ripple (level native)"] == "no native form"
    torsion = [run.torsion[:, 0].mean() for run in got.values()]
    assert torsion[0] == pytest.approx(torsion[1], rel=0.05)
