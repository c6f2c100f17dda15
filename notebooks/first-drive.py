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
# # A first drive: from the teeth to a moving joint
#
# A text file describes a strain wave gear as it is bought: with a ball bearing, a cup,
# manufacturing errors and friction. This notebook goes from that file to the tooth
# flanks, the meshing teeth, a map of torque against torsion and gear angles, and
# finally to a robot joint whose error can be measured. It does so for two drives whose
# files differ in one line.

# %%
import matplotlib.pyplot as plt
import mujoco
import numpy as np

import swgjoint
from swgjoint.gear.catalogue import ratings_of
from swgjoint.gear.teeth.tooth_profile import tooth_profile
from swgjoint.maps.sheet.loop import torque_loop
from swgjoint.maps.sheet.turn import error_turn
from swgjoint.models_path import models_path
from swgjoint.sim.scene.scene import Scene
from swgjoint.units import arcmin, deg, mm

# %% [markdown]
# ## The design
#
# The attributes of a design are the keys of its file; their names include the unit. A
# changed copy is checked in the same way as a file. The copy has a coarser flexspline.

# %%
design = swgjoint.Design.load("size-25-100-bought")
coarse = design.with_changes(
    {
        "drive.name": "size-25-100-bought-coarse",
        "tolerances.flexspline_cumulative_pitch_um": 33.4,
    }
)
ratings = ratings_of(design)
print(f"ratio {design.ratio:g}, pitch diameter {design.pitch_diameter / mm:g} mm")
print(f"rated {ratings.rated_torque:g} N·m, peak {ratings.repeated_peak:.4g} N·m")
for one in (design, coarse):
    tolerances = one.tolerances
    print(f"{one.drive.name}: {tolerances.flexspline_cumulative_pitch_um} µm")

# %% [markdown]
# ## The teeth
#
# Each flank is a chain of arcs and a straight line. Points, normals and curvature are
# known exactly at any arc length.

# %%
figure, axes = plt.subplots(figsize=(6, 3.5))
for member in ("flexspline", "circular_spline"):
    profile = tooth_profile(design, member)
    s = np.linspace(0.0, profile.stations[-1], 400)
    points, normals, curvature = profile.evaluate(s)
    height = points[:, 1] - profile.pitch_radius
    axes.plot(points[:, 0] / mm, height / mm, label=member.replace("_", " "))
axes.set(xlabel="across the tooth [mm]", ylabel="above the pitch circle [mm]")
axes.set_aspect("equal")
axes.legend()

# %% [markdown]
# ## Meshing
#
# The wave generator deflects the flexspline, the teeth engage, the torque is applied,
# and then the wave generator turns. Here it turns by the angle of four tooth pitches of
# the circular spline. No two pitches are equal because every tooth has its own error.

# %%
pitch = 1.0 / design.drive.teeth_circular_spline
meshing = swgjoint.simulate_meshing(
    design, model="2d", torque=ratings.rated_torque, steps=8, turn=4 * pitch
)
angle = meshing.series("wave_generator_angle") / deg
error = meshing.series("output_error") / arcmin
print(f"{meshing.nodes} nodes, {meshing.wall_s:.1f} s, {meshing.outcome.name.lower()}")

figure, (upper, lower) = plt.subplots(2, 1, sharex=True, figsize=(6, 4))
upper.plot(angle, [step.pairs_in_contact for step in meshing.steps], ".-")
upper.set_ylabel("tooth pairs in contact")
lower.plot(angle, error - error.mean(), ".-")
lower.set(xlabel="wave-generator angle [deg]", ylabel="output error [arcmin]")

# %% [markdown]
# ## The map
#
# The map is a potential energy, fitted to samples over the passage of balls and teeth
# and for both signs of the torque, and elements with friction. It is stored in the
# cache. `ring` is the fastest level that has clearance, errors and friction. Torque and
# stiffness are derivatives of the potential, so this part of the joint can neither
# create nor dissipate energy.

# %%
drives = {
    "bought": swgjoint.build_map(design, model="ring"),
    "coarse": swgjoint.build_map(coarse, model="ring"),
}
drive = drives["bought"]
figure, axes = plt.subplots(figsize=(6, 3.5))
loop = torque_loop(drive)
axes.plot(loop.torsion / arcmin, loop.torque)
axes.set(xlabel="torsion [arcmin]", ylabel="output torque [N·m]")
sheet = drive.spec_sheet()
for key in ("K1_Nm_rad", "K2_Nm_rad", "K3_Nm_rad", "lost_motion_arcmin"):
    print(f"{key}: {sheet[key]:.4g}")

# %% [markdown]
# The loop shows play and rising stiffness, and the width of friction under load. The
# errors of the teeth move the output even without load: those of the circular spline
# twice and four times per turn of the input, because both lobes meet them, and those of
# the flexspline, which turns with the output, 2.02 and 4.04 times. Their sum beats.

# %%
figure, axes = plt.subplots(figsize=(6, 3.5))
for label, one in drives.items():
    turn = error_turn(one)
    orders, amplitudes = turn.lines()
    strongest = np.argsort(amplitudes)[-4:][::-1]
    lines = [f"{orders[k]:.2f} ({amplitudes[k] / arcmin:.3f})" for k in strongest]
    print(f"{label}: {turn.peak_to_peak() / arcmin:.2f} arcmin pp, orders {lines}")
    theta, values = turn.output_turn()
    part = theta <= 4 * 2 * np.pi
    axes.plot(theta[part] / (2 * np.pi), values[part] / arcmin, label=label)
axes.set(xlabel="input turns", ylabel="transmission error [arcmin]")
axes.legend()

# %% [markdown]
# The energy balance is a check: over a turn of the output, the mean torque on the wave
# generator must be T/i.

# %%
theta, values = error_turn(drive, ratings.rated_torque).output_turn()
force, _ = drive.forces(theta, theta / drive.ratio + values)
ideal = ratings.rated_torque / drive.ratio
print(f"mean {-force[:-1].mean():.5f} N·m, T/i = {ideal:.5f} N·m")
assert abs(-force[:-1].mean() / ideal - 1.0) < 1e-3

# %% [markdown]
# ## A joint of any arm
#
# `attach` edits a MuJoCo model: the joint gets a rotor, and the drive connects rotor
# and link. The bench has one joint and no actuator.

# %%
spec = mujoco.MjSpec.from_file(str(models_path() / "arms" / "bench.xml"))
joint = swgjoint.attach(
    spec, joint="joint", drive=drive, level="full", rotor_inertia=1e-4
)
model = spec.compile()
print(f"{model.nv} degrees of freedom, integrator {model.opt.integrator}")
print(f"torsion mode at {joint.natural_frequency / (2 * np.pi):.0f} Hz")

# %% [markdown]
# ## A scene
#
# The bench turns at 3 deg/s under its rated load. A rigid joint would show none of the
# errors that the drive causes.

# %%
scene = Scene.load_file("bench")
figure, axes = plt.subplots(figsize=(6, 3.5))
for label in drives:
    run = swgjoint.run_scene(scene.with_drive(label), drives=drives)
    figures = run.metrics()["joints"]["joint"]
    print(f"{label}: torsion {figures['torsion_arcmin']['mean']:.3f} arcmin")
    print(f"  error {figures['transmission_error_arcmin']['pp']:.3f} arcmin pp")
    print(f"  torque ripple {figures['ripple_pp_percent']:.3f} % of rated, pp")
    for line in figures["orders"]:
        print(f"  {line['order']:.2f} per turn: {line['amplitude_percent']:.4f} %")
    part = run.steady
    axes.plot(run.time[part], run.transmission_error[part, 0] / arcmin, label=label)
axes.set(xlabel="time [s]", ylabel="transmission error [arcmin]")
axes.legend()

# %% [markdown]
# `run.to_rerun("run.rrd")` writes a recording; `swgjoint view run.rrd` shows it.
