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
# A text file describes a strain wave gear. This notebook goes from that file to the
# tooth flanks, the deformed flexspline, a map of torque against torsion and gear
# angles, and finally to a robot joint whose error can be measured.

# %%
import matplotlib.pyplot as plt
import mujoco
import numpy as np

import swgjoint
from swgjoint.gear.catalogue import ratings_of
from swgjoint.gear.teeth.tooth_profile import tooth_profile
from swgjoint.models_path import models_path
from swgjoint.sim.scene.scene import Scene
from swgjoint.units import arcmin, deg, mm

# %% [markdown]
# ## The design
#
# The attributes of a design are the keys of its file; their names include the unit. A
# changed copy is checked in the same way as a file.

# %%
design = swgjoint.Design.load("reference-2d")
thick = design.with_changes({"flexspline.rim_mm": 1.5})
ratings = ratings_of(design)
print(f"ratio {design.ratio:g}, pitch diameter {design.pitch_diameter / mm:g} mm")
print(f"rims {design.flexspline.rim_mm} and {thick.flexspline.rim_mm} mm")
print(f"rated {ratings.rated_torque:g} N·m, peak {ratings.repeated_peak:.4g} N·m")

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
# and then the wave generator turns. Here it turns by the angle of one tooth pitch of
# the circular spline; after that everything repeats.

# %%
pitch = 1.0 / design.drive.teeth_circular_spline
meshing = swgjoint.simulate_meshing(
    design, torque=ratings.rated_torque, steps=8, turn=pitch, half=True
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
# The energy balance is a check of the solution: the mean torque on the wave generator
# must be T/i.

# %%
input_torque = meshing.series("wave_generator_torque")
ideal = ratings.rated_torque / design.ratio
print(f"mean {input_torque.mean():.5f} N·m, T/i = {ideal:.5f} N·m")
assert abs(input_torque.mean() / ideal - 1.0) < 0.005

# %% [markdown]
# ## The map
#
# The map is a potential energy, fitted to samples over one pitch and for both signs of
# the torque. It takes about half a minute and is then stored in the cache. Torque and
# stiffness are derivatives of the potential, so this part of the joint can neither
# create nor dissipate energy.

# %%
drive = swgjoint.build_map(design)
low, high = drive.torsion_knots[[0, -1]]
torsion = np.linspace(low, high, 200)
figure, axes = plt.subplots(figsize=(6, 3.5))
axes.plot(torsion / arcmin, drive.torque(torsion, 0.0, 0.0))
axes.set(xlabel="torsion [arcmin]", ylabel="output torque [N·m]")
print(f"{drive.mean_stiffness:.4g} N·m/rad up to rated torque")
print(f"{len(drive.orders) - 1} harmonics, lowest {drive.orders[1][0]} per input turn")

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
scene = Scene.load_file("bench").with_changes({"simulation.duration_s": 3.0})
run = swgjoint.run_scene(scene, drives={"reference-2d": drive})
figures = run.metrics()["joints"]["joint"]
print(f"torsion {figures['torsion_arcmin']['mean']:.4f} arcmin")
print(f"transmission error {figures['transmission_error_arcmin']['pp']:.4f} arcmin pp")
print(f"torque ripple {figures['ripple_pp_percent']:.3f} % of rated, peak to peak")
for line in figures["orders"]:
    print(f"  {line['order']:.1f} per input turn: {line['amplitude_percent']:.4f} %")

figure, axes = plt.subplots(figsize=(6, 3.5))
part = run.steady
axes.plot(run.time[part], run.transmission_error[part, 0] / arcmin)
axes.set(xlabel="time [s]", ylabel="transmission error [arcmin]")

# %% [markdown]
# `run.to_rerun("run.rrd")` writes a recording; `swgjoint view run.rrd` shows it.
