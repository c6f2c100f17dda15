"""Energy of runs: every term by itself, and the balance closes."""

from dataclasses import replace

import numpy as np
import pytest

from swgjoint.maps.drive_map import DriveMap
from swgjoint.maps.friction import Friction
from swgjoint.maps.hysteresis import Jenkin
from swgjoint.sim.arm.scene import scene_of_arm
from swgjoint.sim.scene.scene import Scene
from swgjoint.view.run import run_scene

LINEAR = DriveMap.linear(2e4, teeth_flexspline=120, teeth_circular_spline=122)
LOSSY = replace(
    LINEAR,
    hysteresis=(
        Jenkin(stiffness=2e4, yield_torque=3.0),
        Jenkin(stiffness=1e4, yield_torque=6.0),
    ),
    friction=Friction(stiffness=50.0, coulomb=0.05, static=0.05, load=0.1, damping=0.0),
)
SWEEP = {"kind": "sweep", "hold_s": 0.1, "ramp_s": 0.3, "end_deg": {"joint": 10.0}}


@pytest.mark.parametrize(
    ("level", "integrator"),
    [
        *((level, "discrete") for level in ("rigid", "linear", "native", "full")),
        ("full", "RK4"),
        *(
            pytest.param(level, "RK4", marks=pytest.mark.slow)
            for level in ("rigid", "linear", "native")
        ),
    ],
)
@pytest.mark.parametrize("drive", [LINEAR, LOSSY], ids=["plain", "lossy"])
def test_the_balance_closes(bench, level, drive, integrator):
    """Work in is storage and losses, with hysteresis and friction and without."""
    run = bench(
        drive,
        defaults__level=level,
        defaults__friction=True,
        trajectory=SWEEP,
        simulation={"duration_s": 1.5, "step_s": 1e-4, "integrator": integrator},
    )
    energy = run.metrics()["energy"]
    joint = run.metrics()["joints"]["joint"]["energy"]
    load = -20.0 * (run.position[-1, 0] - run.position[0, 0])
    assert energy["load_work_J"] == pytest.approx(load)
    assert energy["motor_work_J"] == joint["motor_work_J"] > 3.0
    lossy = level in ("native", "full") and drive is LOSSY
    assert (energy["dissipated_J"] > 0.4) == lossy
    # 3.5 J of load: 3e-7 J is the end of the ramp, of first order in the step
    bound = 0.01 * energy["dissipated_J"] if lossy else 1e-6
    assert abs(energy["balance_error_J"]) < bound


def test_springs_of_the_hysteresis_keep_their_energy(bench):
    """Elements that stretch and do not slip dissipate nothing."""
    element = Jenkin(stiffness=2e4, yield_torque=30.0)
    sine = {"kind": "joint_sine", "joint": "joint", "torque_Nm": 5.0}
    run = bench(
        replace(LINEAR, hysteresis=(element,)),
        defaults__damping_ratio=0.0,
        trajectory=SWEEP,
        # ends at the largest torque
        simulation={"duration_s": 1.125, "step_s": 1e-4},
        disturbance=[sine | {"frequency_Hz": 2.0}],
    )
    energy = run.metrics()["energy"]
    stretch = run.torsion[-1, 0] - run.torsion[0, 0]
    held = 0.5 * element.stiffness * stretch**2
    assert held > 1e-4
    assert abs(energy["dissipated_J"]) < 0.01 * held


def test_the_balance_of_an_arm_closes(synthetic_map):
    """Weight, coupled inertias, spinning rotors, springs: nothing is left over."""
    missed = []
    for step in (1e-3, 5e-4):
        run = run_scene(
            "ur5e-sweep",
            overrides={
                "simulation": {"duration_s": 3.0, "step_s": step},
                "trajectory.settle_s": 0.1,
                "disturbance": [
                    {"kind": "tool_force", "force_N": [0.0, 20.0, -30.0],
                     "start_s": 0.5, "duration_s": 1.0},
                    {"kind": "joint_sine", "joint": "elbow_joint", "torque_Nm": 5.0,
                     "frequency_Hz": 2.0},
                ],
            },
            drives={"reference-2d": synthetic_map},
        )  # fmt: skip
        energy = run.metrics()["energy"]
        moved = abs(energy["motor_work_J"]) + abs(energy["load_work_J"])
        assert moved > 5.0
        missed.append(abs(energy["balance_error_J"]))
        assert missed[-1] < 1e-4 * moved
    assert missed[1] < 0.7 * missed[0]


def test_swinging_inertia_takes_no_work(bench):
    """A chirp gives back what it takes: work is what the damper takes, to 1 %."""
    chirp = {
        "kind": "chirp",
        "joint": "joint",
        "amplitude_deg": 1.0,
        "from_Hz": 2.0,
        "to_Hz": 8.0,
    }
    run = bench(
        LINEAR,
        defaults__level="full",
        defaults__damping_ratio=0.1,
        trajectory=chirp,
        load={},
        simulation__duration_s=3.0,
    )
    energy = run.metrics()["energy"]
    # one millisecond, joules of kinetic energy to and fro
    assert energy["dissipated_J"] > 0.01
    assert abs(energy["balance_error_J"]) < 0.01 * energy["dissipated_J"]


def test_efficiency_is_work_out_over_work_in(bench):
    """A drive without friction gives all; with it, by how much less it gives."""
    keys = dict(simulation__duration_s=2.0, trajectory__settle_s=1.0)
    for level in ("linear", "full"):
        got = bench(LINEAR, defaults__level=level, **keys).metrics()
        efficiency = got["joints"]["joint"]["energy"]["efficiency"]
        assert efficiency == pytest.approx(1.0, abs=1e-6)
    run = bench(LOSSY, defaults__friction=True, **keys)
    # 20 N·m over 60, and the friction 0.05 + 0.1 T/i against the flexspline
    rubs = (0.05 + 0.1 * 20.0 / 60.0) * (1.0 + 1.0 / 60.0)
    expected = (20.0 / 60.0) / (20.0 / 60.0 + rubs)
    got = run.metrics()["joints"]["joint"]["energy"]["efficiency"]
    assert got == pytest.approx(expected, rel=2e-3)
    # a load that drives: the motor brakes, friction helps it
    back = bench(LOSSY, defaults__friction=True, load__joint__torque_Nm=-20.0, **keys)
    got = back.metrics()["joints"]["joint"]["energy"]["efficiency"]
    assert got == pytest.approx((20.0 / 60.0 - rubs) / (20.0 / 60.0), rel=5e-3)


def test_efficiency_is_null_where_no_work_is_done(bench):
    """An idle joint, and one that never has a constant speed, say why."""
    idle = bench(LINEAR, load={}).metrics()["joints"]["joint"]["energy"]
    assert idle["efficiency"] is None
    assert idle["missing"]["efficiency"] == "the joint runs idle"
    chirp = {
        "kind": "chirp",
        "joint": "joint",
        "amplitude_deg": 1.0,
        "from_Hz": 1.0,
        "to_Hz": 2.0,
    }
    swings = bench(LINEAR, trajectory=chirp, simulation__duration_s=2.0).metrics()
    energy = swings["joints"]["joint"]["energy"]
    assert energy["missing"]["efficiency"] == "the joint has no constant speed"
    assert "no speed is constant" in swings["ripple_of"]


def test_a_motor_states_its_current_and_its_time_at_the_limit(bench):
    """Peak and effective torque over the torque constant; time at the clamp."""
    run = bench(
        LINEAR,
        defaults__level="rigid",
        defaults__motor={
            "torque_limit_Nm": 0.4,
            "torque_constant_Nm_A": 0.08,
        },
        trajectory={"kind": "step", "at_s": 0.05, "step_deg": {"joint": 30.0}},
        load={},
    )
    motor = run.metrics()["joints"]["joint"]["motor"]
    assert motor["peak_Nm"] == 0.4
    assert motor["current_peak_A"] == pytest.approx(5.0)
    clamped = np.count_nonzero(np.abs(run.wanted_torque[1:, 0]) > 0.4 + 1e-9)
    assert motor["at_limit_s"] == pytest.approx(clamped * 1e-3)
    assert motor["at_limit_s"] > 0.05


def test_scene_bands_are_used():
    """A wider band is reached sooner."""
    scene = Scene.load_file("bench", {"metrics.settle_band_arcmin": 30.0})
    assert scene.metrics.settle_band_arcmin == 30.0


@pytest.mark.parametrize(
    "losses", ["", 'damping="2"', 'frictionloss="3"', 'stiffness="5" springref="0.4"']
)
def test_losses_and_springs_of_the_arm_are_in_the_balance(losses, tmp_path):
    """Damping, dry friction and springs of a file balance within 1 % of the work."""
    path = tmp_path / "arm.xml"
    path.write_text(
        f"""<mujoco><worldbody><body><joint name="lift" axis="0 1 0" {losses}/>
        <inertial mass="2" pos=".3 0 0" diaginertia=".1 .1 .1"/></body></worldbody>
        </mujoco>"""
    )
    energy = run_scene(scene_of_arm(str(path))).metrics()["energy"]
    work = abs(energy["motor_work_J"]) + abs(energy["stored_J"])
    assert abs(energy["balance_error_J"]) < 0.01 * work
    assert (energy["arm_dissipated_J"] > 0.05) == (losses[:1] in ("d", "f"))
    assert (abs(energy["spring_change_J"]) > 0.1) == losses.startswith("s")
