# ---
# jupyter:
#   jupytext:
#     text_representation:
#       extension: .py
#       format_name: percent
#   kernelspec:
#     display_name: Python 3
#     language: python
#     name: python3
# ---

# %% [markdown]
# # How control reduces the errors of a strain wave joint
#
# A motor encoder resolves the output angle to a hundredth of an arcmin, yet the link
# behind the drive deviates from its command by several arcmin, because of friction,
# torsion and kinematic error. This notebook compensates these errors of one joint one
# after the other. Each step is judged by the figure that it is meant to improve.
# `swgjoint study control` does the same for ten specimens.
#
# The drive is a CSG-25-100 with the stiffness, ratings and friction of its catalogue.
# The controllers do *not* know the specimen: its kinematic error has the peak to peak
# that the catalogue allows, its friction deviates by up to 20 % from the nominal value,
# and the load by up to 10 %. The encoders have finite resolution and noise, and their
# readings are 1 ms old. The controllers know this delay: they compare each reading with
# the plan of the instant at which it was taken.

# %%
import matplotlib.pyplot as plt
import numpy as np

from swgjoint.control.flexible import flexible_plan
from swgjoint.control.kinematic_error import compensate, identify_kinematic_error
from swgjoint.control.learning import LearningCompensation
from swgjoint.control.motor_side import MotorPID, ideal_plan, rigid_plan
from swgjoint.maps.drive_map import DriveMap
from swgjoint.maps.fit.error_spectrum import peak_to_peak
from swgjoint.units import arcmin
from swgjoint.validation.control.bench import (
    FREQUENCY,
    record_turn,
    run_motion,
    two_per_turn,
)
from swgjoint.validation.control.ladder import LEARNED
from swgjoint.validation.control.specimens import specimen

SEED = 4
drive = DriveMap.from_catalogue("CSG-25-100", kinematic_error_arcmin=0.0)
plant = specimen(drive, SEED)
print(f"kinematic error: {peak_to_peak(plant) / arcmin:.2f} arcmin over one turn")
print(f"friction: {plant.friction.coulomb / drive.friction.coulomb:.2f} of the nominal")


def error(run):
    """Link error: position minus command [arcmin]. Shape (n,)."""
    return (run.position - run.reference)[:, 0] / arcmin


# %% [markdown]
# ## A fast motion: what feed-forward improves
#
# The joint moves by 20 degrees in 0.7 s under 26 N·m. A PD controller of the motor
# alone needs a position error to produce the torque against load and friction. With
# feed-forward of the torque of a rigid arm and of the catalogue friction, the motor
# follows its command, but the link lags behind by the torsion of the drive. The plan of
# a flexible joint uses the map to compute the motor angle $\theta$ for which the *link*
# is at its commanded position under the torque $T$, and the motor torque from
# $\ddot\theta$.

# %%
plans = {"PD": ideal_plan, "feed-forward": rigid_plan, "flexible": flexible_plan}
moves = {
    name: run_motion(drive, plant, MotorPID(plan, frequency=FREQUENCY), "move", SEED)
    for name, plan in plans.items()
}
figure, axes = plt.subplots(1, 2, figsize=(11, 3.4), layout="constrained")
for name, run in moves.items():
    axes[0].plot(run.time, error(run), lw=1, label=name)
    off = run.reference - run.motor_position / drive.ratio
    axes[1].plot(run.time, off[:, 0] / arcmin, lw=1)
axes[0].set(xlabel="time [s]", ylabel="link error [arcmin]")
axes[1].set(xlabel="time [s]", ylabel="command - motor/i [arcmin]")
axes[0].legend()
rms = {name: np.sqrt(np.mean(error(run)[300:] ** 2)) for name, run in moves.items()}
print({name: round(float(value), 3) for name, value in rms.items()}, "arcmin rms")
assert rms["flexible"] < 0.5 * rms["feed-forward"] < 0.5 * rms["PD"]

# %% [markdown]
# ## One slow turn: the kinematic error of a specimen
#
# The remaining error is the kinematic error: two cycles per turn of the wave generator,
# from each of the two toothed members, which beat with each other. Its harmonics are
# identified from a record of one turn with a noisy link encoder, at twice the load. The
# record is taken on a drive with a different *random* part of the error. Only the low
# orders, which are the same in both drives, can therefore be compensated.

# %%
record = record_turn(drive, SEED)
table = identify_kinematic_error(record, drive)
true = {
    tuple(sign * pq): np.hypot(*pair) / arcmin
    for pq, pair in zip(plant.orders, plant.kinematic_error, strict=True)
    for sign in (1, -1)
}
for pq, pair in zip(table.orders, table.amplitudes, strict=True):
    size = np.hypot(*pair) / arcmin
    print("{:+d} alpha {:+d} beta:".format(*pq), end=" ")
    print(f"{size:.4f} arcmin, true value of this specimen {true[tuple(pq)]:.4f}")

slow = {
    "flexible": MotorPID(flexible_plan, frequency=FREQUENCY),
    "with the table": MotorPID(compensate([table]), frequency=FREQUENCY),
}
turns = {
    name: run_motion(drive, plant, controller, "slow", SEED)
    for name, controller in slow.items()
}
figure, axis = plt.subplots(figsize=(11, 3.2), layout="constrained")
for name, run in turns.items():
    off = error(run)[run.steady]
    pp = np.ptp(off)
    angle = np.degrees(run.reference[run.steady, 0])
    axis.plot(angle, off - off.mean(), lw=0.6, label=f"{name}: {pp:.2f} arcmin pp")
axis.set(xlabel="output [deg]", ylabel="link error without mean [arcmin]")
axis.legend(loc="upper right")
pp = [np.ptp(error(run)[run.steady]) for run in turns.values()]
print(f"one-way positioning error: {100 * (1 - pp[1] / pp[0]):.0f} % less")
assert pp[1] < 0.7 * pp[0]

# %% [markdown]
# ## Constant speed: learning what repeats with every turn
#
# At 30 degrees per second, two cycles per turn of the wave generator are 17 Hz, halfway
# to the resonance, and an error of a tenth of an arcmin causes a torque of the order of
# a newton metre. Learning needs no error table. After every quarter turn of the output
# it fits the harmonics of the remaining link error and adds a motion that cancels most
# of it.

# %%
even = {
    "flexible": MotorPID(flexible_plan, frequency=FREQUENCY),
    "learning": LearningCompensation(
        MotorPID(flexible_plan, frequency=FREQUENCY), orders=LEARNED, rate=0.7
    ),
}
spins = {
    name: run_motion(drive, plant, controller, "even", SEED)
    for name, controller in even.items()
}
figure, axes = plt.subplots(1, 2, figsize=(11, 3.2), layout="constrained")
for name, run in spins.items():
    torque = run.output_torque[:, 0]
    axes[0].plot(run.time[::3], (torque - torque.mean())[::3], lw=0.4, label=name)
    axes[1].plot(run.time[-500:], (torque - torque.mean())[-500:], lw=1)
for axis in axes:
    axis.set(xlabel="time [s]", ylabel="ripple of the output torque [N·m]")
axes[0].legend(loc="upper right")
waves = {name: two_per_turn(run) for name, run in spins.items()}
print({name: round(value, 4) for name, value in waves.items()}, "N·m at 2 per turn")
assert waves["learning"] < 0.1 * waves["flexible"]

# %% [markdown]
# None of these controllers removes the random part of the error, which comes from
# single teeth, the friction that changes its sign with the speed, or anything that the
# encoders do not measure.
