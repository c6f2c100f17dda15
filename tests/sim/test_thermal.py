"""Drives that warm by their own losses: laws of the temperature, and the run."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest
from messages import naming

from swgjoint.cli.run import report
from swgjoint.envs.arm_tracking import ArmTrackingEnv
from swgjoint.errors import ComputationError, InputError
from swgjoint.maps.drive_map import DriveMap
from swgjoint.maps.friction import Friction
from swgjoint.maps.friction_temperature import KEY, at_temperature, friction_table
from swgjoint.maps.hysteresis import Jenkin
from swgjoint.models_path import models_path
from swgjoint.sim.figures.energy import dissipation
from swgjoint.sim.run import Run
from swgjoint.sim.thermal import HeatCourse, ThermalNode
from swgjoint.units import ZERO_CELSIUS
from swgjoint.view.recording.entities import signals_of
from swgjoint.view.report.report import write_report

NODE = ThermalNode(capacity=50.0, conductance=2.0, ambient=293.15)
FAST = {"trajectory__speed_deg_s__joint": 20.0}
SIGNALS = (
    *("position", "velocity", "motor_position", "motor_velocity", "torsion"),
    *("output_torque", "motor_torque", "slipping_torque", "friction_torque"),
)


def law(viscous: float) -> Friction:
    """Friction with all terms and a given viscosity."""
    return Friction(
        stiffness=70.0,
        coulomb=0.04,
        static=0.05,
        stribeck_speed=2.0,
        viscous=viscous,
        load=0.05,
        damping=0.05,
    )


def drive_over(plain_map: DriveMap, cold: float, warm: float) -> DriveMap:
    """A lossy drive whose viscosity goes from ``cold`` to ``warm``, 0 to 40 °C."""
    laws = {ZERO_CELSIUS: law(cold), ZERO_CELSIUS + 40.0: law(warm)}
    return replace(
        plain_map,
        friction=law(cold),
        hysteresis=(Jenkin(stiffness=1e4, yield_torque=3.0),),
        info={KEY: friction_table(laws, lubricant="test oil")},
    )


@pytest.fixture
def constant(plain_map: DriveMap) -> DriveMap:
    """A drive whose friction does not depend on the temperature."""
    return drive_over(plain_map, 4e-3, 4e-3)


@pytest.fixture
def falling(plain_map: DriveMap) -> DriveMap:
    """A drive whose viscosity falls to a fifth from 0 to 40 °C."""
    return drive_over(plain_map, 2e-2, 4e-3)


def thermal(capacity: float, conductance: float, **more: float) -> dict[str, float]:
    """Overrides of a scene whose joint warms."""
    keys = {"heat_capacity_J_K": capacity, "conductance_W_K": conductance, **more}
    return {f"joints__joint__thermal__{key}": value for key, value in keys.items()}


def heat_of(run: Run) -> HeatCourse:
    """Temperatures of the only joint."""
    return run.heat["joint"]


def test_temperature_rises_as_the_closed_form():
    """T - T_a = P/G (1 - exp(-G t/C)) for constant power, in steps of any length."""
    for step in (1e-3, 0.4, 7.0, 400.0):
        temperature, end = NODE.ambient, 0.0
        for _ in range(20):
            temperature, _ = NODE.advance(temperature, 30.0, step)
            end += step
        rise = 15.0 * -np.expm1(-end / 25.0)
        assert temperature - NODE.ambient == pytest.approx(rise, rel=1e-10, abs=1e-12)


@pytest.mark.parametrize("x", [0.0, 1e-9, 0.0099, 0.0101, 3.0, 1e6])
def test_heat_is_stored_or_released(x):
    """P h = C (T - T_0) + G integral (T - T_a), the integral by quadrature."""
    duration = 3.0
    node = replace(NODE, conductance=x * NODE.capacity / duration)
    end, released = node.advance(300.0, 40.0, duration)
    stored = node.capacity * (end - 300.0)
    assert stored + released == pytest.approx(120.0, rel=1e-9)
    if x < 10.0:
        points, weights = np.polynomial.legendre.leggauss(20)
        times = 0.5 * duration * (points + 1.0)
        above = [node.advance(300.0, 40.0, t)[0] - node.ambient for t in times]
        integral = 0.5 * duration * float(weights @ above)
        assert released == pytest.approx(node.conductance * integral, rel=1e-9)


@pytest.mark.parametrize("capacity", [1e-300, 1e-12, 1e-3])
def test_a_node_without_capacity_releases_all_heat(capacity):
    """At once, at P/G above the surroundings, also where rates overflow."""
    node = ThermalNode(capacity=capacity, conductance=1e15, ambient=300.0)
    end, released = node.advance(300.0, 40.0, 0.1)
    assert end == pytest.approx(300.0) and released == pytest.approx(4.0, rel=1e-12)


def test_run_with_constant_losses_approaches_ambient_plus_power_over_conductance(
    bench, constant
):
    """At constant speed T follows the closed form within 1e-3 of its rise.

    Several time constants C/G of 0.4 s; the power is that of the steady motion.
    """
    run = bench(constant, simulation__duration_s=3.0, **FAST, **thermal(0.2, 0.5))
    heat = heat_of(run)
    steady = heat.time >= 0.7
    time, found = heat.time[steady], heat.celsius[steady]
    power = heat.power[-1]
    np.testing.assert_allclose(heat.power[steady[1:]], power, rtol=1e-4)
    goal = 20.0 + power / 0.5
    want = goal + (found[0] - goal) * np.exp(-(time - time[0]) / 0.4)
    rise = abs(goal - found[0])
    assert rise > 0.1
    np.testing.assert_allclose(found, want, rtol=0, atol=1e-3 * rise)
    assert found[-1] == pytest.approx(goal, abs=0.01 * (goal - 20.0))


def test_energy_of_a_run_is_stored_or_released(bench, falling):
    """Losses are those of the energy balance and go into C dT and the surroundings."""
    run = bench(falling, **FAST, **thermal(0.5, 0.5, update_s=0.02))
    heat, figures = heat_of(run), run.metrics()["joints"]["joint"]["thermal"]
    lost = dissipation(run, 0)
    assert lost > 0.3
    assert heat.loss.sum() == pytest.approx(lost, rel=1e-9)
    assert figures["loss_J"] == pytest.approx(lost, rel=1e-9)
    balance = figures["stored_J"] + figures["released_J"]
    assert balance == pytest.approx(lost, rel=1e-9)
    still = bench(falling, **FAST, joints__joint__temperature_C=20.0)
    errors = [one.metrics()["energy"]["balance_error_J"] for one in (run, still)]
    # the sums over samples err by 4e-3; the change of friction adds 1e-4
    assert abs(errors[0] - errors[1]) < 2e-4 * lost


@pytest.mark.parametrize("more", [{}, {"controller__control_period_s": 0.002}])
def test_change_of_the_model_does_not_disturb_the_motion(bench, constant, more):
    """A drive with constant friction moves as without thermal state, to 1e-9.

    Bristle, hysteresis, controller and engine continue in every new model, both in the
    engine's own loop and in a sampled one.
    """
    still = {"joints__joint__temperature_C": 20.0, **more}
    want = bench(constant, **still)
    run = bench(constant, **thermal(0.1, 0.1, update_s=0.01), **more)
    assert np.ptp(heat_of(run).celsius) > 0.5
    for key in SIGNALS:
        size = np.abs(getattr(want, key)).max()
        assert size > 0.0
        np.testing.assert_allclose(
            getattr(run, key), getattr(want, key), rtol=0, atol=1e-9 * size
        )


def test_infinite_conductance_keeps_the_temperature(bench, falling):
    """With a conductance of 1e15 W/K all signals are those of constant temperature."""
    want = bench(falling, joints__joint__temperature_C=15.0)
    run = bench(falling, **thermal(1.0, 1e15, ambient_C=15.0))
    np.testing.assert_allclose(heat_of(run).celsius, 15.0, rtol=0, atol=1e-9)
    for key in SIGNALS:
        size = np.abs(getattr(want, key)).max()
        np.testing.assert_allclose(
            getattr(run, key), getattr(want, key), rtol=0, atol=1e-9 * size
        )


def test_friction_falls_after_a_cold_start(bench, falling):
    """From 5 °C the friction torque falls to that of the temperature reached."""
    run = bench(
        falling,
        simulation__duration_s=1.5,
        **FAST,
        joints__joint__temperature_C=5.0,
        **thermal(0.5, 0.2, ambient_C=20.0),
    )
    celsius, rubs = heat_of(run).celsius, np.abs(run.friction_torque[:, 0])
    assert celsius[0] == 5.0
    assert 15.0 < celsius[-1] < 40.0
    assert (np.diff(celsius)[1:] > 0.0).all()
    steady = run.time > 0.7
    late = rubs[steady].reshape(-1)
    assert late[-1] < 0.9 * late[0]
    one = run.assembly.transmissions[0]
    last = heat_of(run).temperature[-2]  # that of the last interval
    friction = at_temperature(one.attached.drive, last, where="test").friction
    assert friction is not None
    nu = float(np.dot(one.drive.friction_direction, run_rates(run)))
    want = friction.steady(nu, float(run.output_torque[-1, 0] / one.ratio))
    # T/i contains the friction torque itself
    assert rubs[-1] == pytest.approx(abs(want), rel=2e-3)


def run_rates(run: Run) -> tuple[float, float]:
    """Speeds of motor and link at the end [rad/s]."""
    return float(run.motor_velocity[-1, 0]), float(run.velocity[-1, 0])


def test_shorter_updates_converge(bench, falling):
    """The end temperature is of first order in the interval of the updates."""
    ends = [
        heat_of(
            bench(
                falling,
                simulation__duration_s=0.8,
                **FAST,
                **thermal(0.5, 0.1, update_s=update),
            )
        ).celsius[-1]
        for update in (0.08, 0.04, 0.02)
    ]
    first, second = np.abs(np.diff(ends))
    assert first < 0.2
    assert first / second == pytest.approx(2.0, abs=0.5)


def test_friction_of_the_drive_continues_after_the_last_update(bench, falling):
    """A duration that is no multiple of the interval has a last, shorter interval."""
    run = bench(falling, simulation__duration_s=0.55, **thermal(1.0, 0.1))
    np.testing.assert_allclose(
        heat_of(run).time, [0.0, 0.1, 0.2, 0.3, 0.4, 0.5, 0.55], rtol=0, atol=1e-12
    )


@pytest.mark.parametrize(
    ("key", "value", "named"),
    [
        ("heat_capacity_J_K", -5.0, "> 0"),
        ("heat_capacity_J_K", 0.0, "> 0"),
        ("conductance_W_K", -0.1, ">= 0"),
        ("update_s", -1.0, "> 0"),
        ("ambient_C", -300.0, ">= -60"),
    ],
)
def test_values_out_of_range_are_refused(bench, falling, key, value, named):
    """One line states key, value and range."""
    with pytest.raises(InputError, match=naming(f"thermal.{key}", named)) as caught:
        bench(falling, **thermal(1.0, 1.0) | thermal(1.0, 1.0, **{key: value}))
    assert str(caught.value).count("\n") == 0


def test_drive_without_table_is_refused(bench, plain_map):
    """A drive that states no lubricant has no friction at the temperature."""
    with pytest.raises(InputError, match=naming("thermal.ambient_C", "[losses]")):
        bench(replace(plain_map, friction=law(1e-3)), **thermal(1.0, 1.0))


def test_temperature_outside_the_table_ends_the_run(bench, falling):
    """The message names joint, temperature, time and the range of the table."""
    with pytest.raises(
        ComputationError, match=naming("'joint'", "°C at t =", "0 to 40 °C")
    ):
        bench(falling, joints__joint__temperature_C=39.9, **thermal(0.01, 0.0))


def test_friction_beyond_an_explicit_integrator_ends_the_run(bench, plain_map):
    """Cooling from 30 to 5 °C makes a drive too viscous for steps of RK4."""
    cooling = drive_over(plain_map, 20.0, 1e-3)
    with pytest.raises(
        ComputationError, match=naming("'joint'", "°C at t =", "decay rate of friction")
    ):
        bench(
            cooling,
            simulation__integrator="RK4",
            simulation__step_s=1e-4,
            joints__joint__temperature_C=30.0,
            **thermal(1.0, 10.0, ambient_C=5.0),
        )


@pytest.mark.parametrize("level", ["rigid", "linear", "native"])
def test_other_levels_say_that_they_do_not_warm(bench, falling, level):
    """Levels other than full keep the friction of the start, and list it."""
    run = bench(falling, defaults__level=level, **thermal(1.0, 1.0))
    parts = [item["part"] for item in run.contains["left_out"]]
    assert "warming of the drive by its losses" in parts
    assert not run.heat
    assert "thermal" not in run.metrics()["joints"]["joint"]
    assert "thermal" not in run.contains


def test_scene_without_thermal_has_none(bench, falling):
    """Neither figures nor contents mention temperatures that do not change."""
    run = bench(falling)
    assert not run.heat
    assert "thermal" not in run.contains
    assert not any("warming" in item["part"] for item in run.contains["left_out"])


def test_episodes_are_refused(tmp_path):
    """Environments keep the temperature constant, so they reject a scene that warms."""
    text = (models_path() / "scenes" / "ur5e-catalogue.toml").read_text("utf-8")
    table = "[joints.elbow_joint.thermal]\nheat_capacity_J_K = 500.0\n"
    path = tmp_path / "scene.toml"
    path.write_text(f"{text}\n{table}conductance_W_K = 2.0\n", encoding="utf-8")
    found = naming("'ur5e-catalogue'", "thermal", "temperature_C")
    with pytest.raises(InputError, match=found):
        ArmTrackingEnv(scene=str(path))


@pytest.fixture
def warm(bench, falling) -> Run:
    """A run whose joint warms."""
    return bench(falling, **FAST, **thermal(0.5, 0.5))


def test_run_command_prints_the_temperatures(warm):
    """The table states start, end, losses and the time constant C/G."""
    metrics = warm.metrics() | {
        "scene": "bench test",
        "contains": warm.contains,
        "files": [],
        "drive_choice": {},
    }
    text = report(json.loads(json.dumps(metrics)))
    [line] = [one for one in text.splitlines() if one.split()[:2] == ["joint", "20.00"]]
    assert f"{heat_of(warm).celsius[-1]:.2f}" in line
    assert line.split()[-1] == "1"
    assert warm.contains["thermal"]["joint"]["heat_capacity_J_K"] == 0.5


def test_recording_and_report_have_the_curve(warm, tmp_path):
    """One signal in the recording; a table and a picture in the report."""
    celsius = signals_of(warm, 0)["temperature_C"]
    assert celsius.shape == warm.time.shape
    np.testing.assert_array_equal(celsius[[0, -1]], heat_of(warm).celsius[[0, -1]])
    assert "temperature_C" in signals_of(warm, 0, slice(3, 5))
    path = write_report({"warm": warm}, tmp_path / "report.html", check_step=False)
    page = path.read_text("utf-8")
    assert page.count("Temperatures of warm") == 2
    assert f"{heat_of(warm).celsius[-1]:.2f}" in page


def test_tasks_of_a_cycle_say_that_they_start_anew(bench, falling):
    """The temperature does not pass from task to task, which the contents list."""
    run = bench(
        falling,
        cycle=[{"times": 2}, {"rest": True, "duration_s": 5.0}],
        **thermal(1, 1),
    )
    parts = [item["part"] for item in run.contains["left_out"]]
    assert "temperature at the end of one task at the start of the next" in parts
