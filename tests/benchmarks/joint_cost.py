"""Cost of the joint levels: python tests/benchmarks/joint_cost.py.

Against the rigid arm: a 7-joint arm (iiwa 7) turns slowly under gravity with a speed
loop on every motor (``--bare``: no actuators and no gravity), slowly enough for the
step to carry all harmonics, as `attach` sees to. One thread, `mj_step` in C, CPU time
of the process; per level the median over interleaved pairs rigid, level of the ratio of
their steps per second. ``+friction`` is a level with friction that slips,
``+hysteresis`` one with three elements, ``+losses`` one with both, ``+corners`` one
with the three lines of a catalogue. A temperature changes only the numbers of the
friction, so it costs no step any time. Not a test: nothing is asserted.
"""

from __future__ import annotations

import argparse
import copy
import json
import platform
import time
from dataclasses import replace

import mujoco
import numpy as np
from mujoco.batch import Batch

from swgjoint.drives.references import load_drive
from swgjoint.gear.ratings import Ratings
from swgjoint.joint.attach import LEVELS, attach
from swgjoint.maps.drive_map import DriveMap
from swgjoint.maps.friction import Friction
from swgjoint.maps.from_catalogue import three_lines
from swgjoint.maps.hysteresis import Jenkin
from swgjoint.maps.torsion_law import potential_of_stiffness
from swgjoint.sim.arm.rigid_arm import RigidArm

STIFFNESS = (4e4, 4e4, 3e4, 3e4, 1.5e4, 8e3, 8e3)
"""N·m/rad, the size of catalogue drives for the joints of such an arm."""
ROTOR = (1e-4, 1e-4, 1e-4, 1e-4, 5e-5, 5e-5, 5e-5)
SPEED = 0.6
"""Of the motors [rad/s]: order 404 moves by 0.24 rad in 1 ms."""
GAIN = 5.0
"""Of the speed loops [N·m·s/rad]."""
FRICTION = Friction(
    stiffness=70.0,
    coulomb=0.05,
    static=0.07,
    stribeck_speed=2.0,
    viscous=6e-4,
    load=0.08,
    damping=0.07,
)
HYSTERESIS = (
    Jenkin(stiffness=8e3, yield_torque=0.4),
    Jenkin(stiffness=4e3, yield_torque=0.8),
    Jenkin(stiffness=2e3, yield_torque=1.6),
)
LOSSES = ("hysteresis", "friction", "losses")
START = (0.2, 0.5, -0.2, -1.2, 0.3, 0.8, 0.1)


def drive(stiffness: float, orders: tuple[int, ...]) -> DriveMap:
    """Hardening spring; every order has 2 % of torque ripple and e0 of 5e-5/n rad."""
    x0 = 100.0 / stiffness
    knots = np.linspace(-x0, x0, 21)
    energy = np.polynomial.Polynomial(
        [0, 0, 0.5 * stiffness, 0, 0.5 * stiffness / x0**2]
    )
    n = 1 + len(orders)
    potential = np.zeros((n, 2, knots.size - 1, 5))
    for j, knot in enumerate(knots[:-1]):
        potential[0, 0, j] = energy(np.polynomial.Polynomial([knot, 1.0])).coef
    ends = np.zeros((n, 2, 2))
    ends[0, 0] = energy.deriv(2)(knots[[0, -1]])
    error = np.zeros((n, 2))
    for k, order in enumerate(orders, start=1):
        potential[k], ends[k] = 0.014 * potential[0, 0], 0.014 * ends[0, 0]
        error[k] = 3.5e-5 / order
    return DriveMap(
        name="benchmark",
        level="synthetic",
        layout="circular_spline_fixed",
        teeth_flexspline=200,
        teeth_circular_spline=202,
        torsion_knots=knots,
        orders=np.array([(0, 0), *((order, 0) for order in orders)]),
        potential=potential,
        end_stiffness=ends,
        kinematic_error=error,
        friction=FRICTION,
        ratings=Ratings(
            rated_torque=40.0, repeated_peak=100.0, momentary_peak=200.0, T1=10, T2=30
        ),
    )


def cornered(stiffness: float, orders: tuple[int, ...]) -> DriveMap:
    """The same with the three lines of a catalogue as its mean curve, no harmonics."""
    slopes = (0.7 * stiffness, 1.05 * stiffness, 1.2 * stiffness)
    knots, slope = three_lines(14.0, 48.0, *slopes, largest=200.0)
    potential, ends = potential_of_stiffness(knots, slope)
    plain = drive(stiffness, ())
    return replace(plain, torsion_knots=knots, potential=potential, end_stiffness=ends)


def build(
    level: str, *, step: float, orders: tuple[int, ...], bare: bool, map_name: str = ""
) -> tuple[mujoco.MjModel, mujoco.MjData]:
    """The arm at its start, links and motors in place.

    Args:
        level: Level of all joints, with ``+`` and what it has besides.
        step: Timestep [s].
        orders: Harmonics of the synthetic drive per turn of the motor.
        bare: Whether the arm has neither actuators nor gravity.
        map_name: Drive of all joints instead of the synthetic one.
    """
    spec = RigidArm("iiwa7").spec()
    spec.option.timestep = step
    spec.option.integrator = mujoco.mjtIntegrator.mjINT_DISCRETE
    if bare:
        spec.option.gravity = [0, 0, 0]
    names = [joint.name for joint in spec.joints]
    base, _, lossy = level.partition("+")
    elements = HYSTERESIS if lossy in ("hysteresis", "losses") else ()
    shape = cornered if lossy == "corners" else drive
    drives = [
        attach(
            spec,
            joint=name,
            drive=load_drive(map_name)
            if map_name
            else replace(shape(stiffness, orders), hysteresis=elements),
            level=base,
            rotor_inertia=rotor,
            damping_ratio=0.02,
            friction=lossy in ("friction", "losses"),
        )
        for name, stiffness, rotor in zip(names, STIFFNESS, ROTOR, strict=True)
    ]
    for one in drives if not bare else ():
        motor = spec.add_actuator(
            name=f"{one.joint}_motor", target=one.rotor or one.joint
        )
        motor.trntype = mujoco.mjtTrn.mjTRN_JOINT
        motor.gaintype = mujoco.mjtGain.mjGAIN_FIXED
        motor.biastype = mujoco.mjtBias.mjBIAS_AFFINE
        motor.gear[0] = 1.0 if one.rotor else one.ratio
        motor.gainprm[0] = 1.0
        motor.biasprm[:3] = [0.0, 0.0, -GAIN]
    model = spec.compile()
    data = mujoco.MjData(model)
    for one, angle in zip(drives, START, strict=True):
        data.joint(one.joint).qpos = angle
        data.joint(one.joint).qvel = SPEED / one.ratio
        if one.rotor:
            data.joint(one.rotor).qvel = SPEED
            data.joint(one.rotor).qpos = one.ratio * angle
        if not bare:
            data.actuator(f"{one.joint}_motor").ctrl = GAIN * SPEED
    return model, data


def seconds(model: mujoco.MjModel, start: mujoco.MjData, steps: int) -> float:
    """CPU time of some steps, always the same ones."""
    data = copy.copy(start)
    mujoco.mj_step(model, data, 500)
    begin = time.process_time()
    mujoco.mj_step(model, data, steps)
    took = time.process_time() - begin
    if not np.isfinite(data.qpos).all() or any(w.number for w in data.warning):
        raise SystemExit("the motion diverged")
    return took


def measure(args: argparse.Namespace) -> list[dict[str, float | str]]:
    """One row per level."""
    orders = tuple(args.orders)
    keys = {
        **{"step": args.step, "orders": orders, "bare": args.bare},
        "map_name": args.drive,
    }
    rigid = build("rigid", **keys)
    rows: list[dict[str, float | str]] = []
    for level in args.levels:
        other = build(level, **keys)
        times = np.array(
            [
                [seconds(*rigid, args.steps), seconds(*other, args.steps)]
                for _ in range(args.pairs)
            ]
        )
        ratio = times[:, 0] / times[:, 1]
        rows.append(
            {
                "level": level,
                "against_rigid": float(np.median(ratio)),
                "lowest": float(ratio.min()),
                "highest": float(ratio.max()),
                "microseconds_a_step": float(1e6 * np.median(times[:, 1]) / args.steps),
            }
        )
    return rows


def batch(args: argparse.Namespace) -> dict[str, float]:
    """Steps per second of 64 arms at level full on one and two threads, wall time."""
    model, data = build(
        "full",
        step=args.step,
        orders=tuple(args.orders),
        bare=args.bare,
        map_name=args.drive,
    )
    out = {}
    for threads in (1, 2):
        many = Batch(model, 64, nthread=threads)
        many.qpos[:] = data.qpos
        many.ctrl[:] = data.ctrl
        many.step(nstep=10)
        steps = max(args.steps // 64, 10)
        begin = time.perf_counter()
        many.step(nstep=steps)
        out[f"threads_{threads}"] = 64 * steps / (time.perf_counter() - begin)
    return out


def main() -> None:
    """Print the table, or JSON."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    losses = [f"{level}+{loss}" for loss in LOSSES for level in ("native", "full")]
    levels = (*LEVELS, "native+corners", *losses)
    parser.add_argument("--levels", nargs="+", choices=levels, default=levels)
    parser.add_argument("--pairs", type=int, default=9)
    parser.add_argument("--steps", type=int, default=4_000)
    parser.add_argument("--step", type=float, default=1e-3, help="timestep [s]")
    parser.add_argument("--orders", type=int, nargs="*", default=[2, 4, 202, 404])
    parser.add_argument("--drive", default="", help="drive of all joints, by name")
    parser.add_argument("--bare", action="store_true", help="without actuators")
    parser.add_argument("--json", action="store_true")
    args = parser.parse_args()
    rows, many = measure(args), batch(args)
    if args.json:
        print(json.dumps({"rows": rows, "batch": many, "args": vars(args)}))
        return
    print(f"{platform.processor() or platform.machine()}, mujoco {mujoco.__version__}")
    print(f"{'level':17} {'ratio':>6} {'low':>6} {'high':>6} {'µs/step':>8}")
    for row in rows:
        print(
            f"{row['level']:17} {row['against_rigid']:6.3f} {row['lowest']:6.3f}"
            f" {row['highest']:6.3f} {row['microseconds_a_step']:8.2f}"
        )
    print("Batch of 64, full, steps/s:", {k: round(v) for k, v in many.items()})


if __name__ == "__main__":
    main()
