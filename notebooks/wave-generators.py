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
# # Wave generators compared: one section of the design, four different joints
#
# Four wave generators deflect the same rim with the same 120 and 122 teeth: an ellipse
# supports the rim all around, two half-circles (simplified) leave it free between the
# lobes, a parabola fits it at the lobes only, and four rollers touch it at four places.
# The thesis from which these designs come compares their stresses; this notebook
# compares them as joints of a UR5e.

# %%
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np

from swgjoint.maps.drive_map import DriveMap
from swgjoint.maps.sheet.spec_sheet import measure_spec
from swgjoint.sim.scene.scene import Scene
from swgjoint.units import arcmin, mm
from swgjoint.view.plots.runs import comparison_figure
from swgjoint.view.run import run_scene

DESIGNS = {
    "elliptical": "reference-2d",
    "parabolic": "reference-2d-parabolic",
    "simplified": "reference-2d-simplified",
    "four rollers": "reference-2d-four-roller",
}
COLORS = dict(
    zip(DESIGNS, ("tab:blue", "tab:gray", "tab:orange", "tab:green"), strict=True)
)

# %% [markdown]
# ## Four maps
#
# The maps come from 2D finite elements with two elastic members, contact of teeth and
# wave generator, and large rotations. They have 24 or 48 positions of the wave
# generator per pitch, and as many torques as the changes of contact require. A map
# takes half a minute to two minutes on one core, so this notebook reads the maps from
# files. The following command writes one of them; the others are written in the same
# way:
#
#     swgjoint map reference-2d --no-fields -o notebooks/maps/reference-2d.swg

# %%
here = Path(__file__).parent if "__file__" in globals() else Path.cwd()
maps = {
    name: DriveMap.load(here / "maps" / f"{design}.swg")
    for name, design in DESIGNS.items()
}
sheets = {name: measure_spec(drive) for name, drive in maps.items()}
keys = ("K1_Nm_rad", "transmission_accuracy_arcmin", "ripple_rms_percent")
print(f"{'':13} {'K1 [N·m/rad]':>13} {'accuracy [arcmin]':>18} {'ripple rms [%]':>15}")
for name, sheet in sheets.items():
    K1, accuracy, ripple = (sheet.figures[key] for key in keys)
    print(f"{name:13} {K1:13.0f} {accuracy:18.4f} {ripple:15.2f}")

# %% [markdown]
# ## Torsion depends on the support of the rim
#
# With locked input, the torque at the output is varied in both directions. The ellipse
# is an order of magnitude stiffer than the next stiffest, because the rim cannot move
# away from it. Where the rim is free next to the lobes, it first bends and then comes
# into contact with the wave generator: the stiffness of the simplified drive increases
# fivefold.

# %%
figure, (left, right) = plt.subplots(1, 2, figsize=(11, 4), layout="constrained")
for name, drive in maps.items():
    low, high = drive.torsion_knots[[0, -1]]
    torsion = np.linspace(low, high, 300)
    torque = drive.torque(torsion, 0.0, 0.0)
    left.plot(torsion / arcmin, torque, color=COLORS[name], label=name)
    turn = sheets[name].turns["no_load"]
    part = np.linspace(0.0, 1.0, turn.signal.size, endpoint=False)
    error = (turn.signal - turn.signal.mean()) / arcmin
    right.plot(part, error, color=COLORS[name], label=name)
left.set(xlabel="torsion [arcmin]", ylabel="output torque [N·m]")
right.set(xlabel="part of a pitch", ylabel="kinematic error, unloaded [arcmin]")
left.set_title("torque against torsion")
right.set_title("error over one pitch of the circular spline")
left.legend()
for axis in (left, right):
    axis.grid(alpha=0.3)

# %% [markdown]
# The error over a pitch has the opposite order: four rollers hold the rim at only four
# lines, so that the teeth can displace it. The two effects conflict: a soft drive has a
# large torsion, and a stiff drive converts every error into torque.

# %%
K = {name: sheet.figures["K1_Nm_rad"] for name, sheet in sheets.items()}
error = {n: s.figures["transmission_accuracy_arcmin"] for n, s in sheets.items()}
assert list(K) == sorted(K, key=K.get, reverse=True)
assert error["four rollers"] == max(error.values())
assert error["elliptical"] == min(error.values())

# %% [markdown]
# ## On the arm
#
# A UR5e makes a slow sweep, once with each drive in all joints. The table shows the
# largest torque ripple and the largest mean torsion [arcmin] of all joints, the rms
# deviation of the tool from that of the rigid arm [mm], and the steps per second.

# %%
scene = Scene.load_file("ur5e-sweep")
runs = {
    name: run_scene(scene.with_drive(design), drives={design: maps[name]}, name=name)
    for name, design in DESIGNS.items()
}
rigid = run_scene(
    scene.with_level("rigid"), drives={"reference-2d": maps["elliptical"]}
)
print(f"{'':13} {'ripple rms':>10} {'torsion':>9} {'tool':>7} {'steps/s':>9}")
for name, run in runs.items():
    joints = run.metrics()["joints"].values()
    ripple = max(joint["ripple_rms_percent"] for joint in joints)
    torsion = max(abs(joint["torsion_arcmin"]["mean"]) for joint in joints)
    tool = np.sqrt(np.mean(run.tool_error(rigid) ** 2)) / mm
    print(
        f"{name:13} {ripple:8.2f} % {torsion:9.3f} {tool:7.3f}"
        f" {run.steps_per_second:9.0f}"
    )

# %%
comparison_figure(runs, rigid=rigid)

# %% [markdown]
# The torque ripple is the product of error and stiffness, filtered by the arm. The
# parabolic drive has the most ripple: it is thirteen times stiffer than the four
# rollers, with a fifth of their error. The simplified drive has the least ripple, but a
# tool that is about a millimetre off its path. Which drive is better depends on the
# task: a position-controlled arm needs the ellipse, while a torque-controlled arm may
# benefit from a softer drive.
#
# Shoulder pan and wrists turn too fast for a step of 1 ms to resolve their tooth order.
# It is therefore left out and listed; `error-against-time.py` shows the consequence.

# %%
ripple = {
    name: max(joint["ripple_rms_percent"] for joint in run.metrics()["joints"].values())
    for name, run in runs.items()
}
assert ripple["four rollers"] > ripple["elliptical"] > ripple["simplified"]
for name, run in runs.items():
    for joint, figures in run.metrics()["joints"].items():
        left_out = [item["order"] for item in figures["unresolved"]]
        if name == "elliptical":
            print(f"{joint:20} lowest order left out: {left_out[0]:g}")

# %% [markdown]
# This command gives the same comparison as a table, a picture and a page for the
# browser, with the stresses at rated torque:
#
#     swgjoint compare reference-2d reference-2d-parabolic reference-2d-simplified \
#         reference-2d-four-roller --scene ur5e-sweep --out compared
