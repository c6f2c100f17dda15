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
# # Wave generators compared: one line of the design, four different joints
#
# The same 120 and 122 teeth, the same rim, four shapes that deflect it: an ellipse that
# holds the rim all around, two half circles that leave it free between the lobes
# (simplified), a parabola that fits the lobe only, and four rollers. The thesis behind
# these designs compares their stresses; here they become joints of a UR5e.

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
# Finite elements in the plane, both members elastic, contact everywhere, large
# rotations, 24 or 48 positions of the wave generator over a pitch, as many torques as
# contacts ask for. That takes half a minute to two minutes of a core a drive, so the
# maps are read from files, which
#
#     swgjoint map reference-2d --no-fields -o notebooks/maps/reference-2d.swg
#
# writes again, and the other designs alike.

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
# ## Torsion: what holds the rim decides
#
# Input locked, torque up and down at the output. The ellipse is an order of magnitude
# stiffer than the next, because the rim cannot leave it. Where the rim is free beside
# the lobes, it first bends and then lies down on the wave generator: the simplified
# drive hardens fivefold.

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
# Error over a pitch comes in the opposite order: four rollers hold the rim at four
# lines and let the teeth push it about. Two things follow, and they pull against each
# other: a soft drive winds up, a stiff one turns every error into torque.

# %%
K = {name: sheet.figures["K1_Nm_rad"] for name, sheet in sheets.items()}
error = {n: s.figures["transmission_accuracy_arcmin"] for n, s in sheets.items()}
assert list(K) == sorted(K, key=K.get, reverse=True)
assert error["four rollers"] == max(error.values())
assert error["elliptical"] == min(error.values())

# %% [markdown]
# ## On the arm
#
# A slow sweep of a UR5e, once with each drive in all joints. `ripple rms` [% of rated
# torque] and mean `torsion` [arcmin] are those of the worst joint; `tool` [mm, rms] is
# the distance of the tool from that of the rigid arm.

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
# Torque ripple is error times stiffness, filtered by the arm. The parabolic drive has
# the most: thirteen times stiffer than four rollers at a fifth of their error. The
# simplified drive has the least, and a tool a millimetre off its path. Which is better
# depends on what the joint is for; a position-controlled arm wants the ellipse, a
# torque-controlled one may prefer a softer drive.
#
# Pan and wrists turn too fast for a step of 1 ms to carry their tooth order, which is
# left out there and listed; see `error-against-time.py` for what that costs.

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
# The same as a table, a picture and a page for the browser, with stresses at rated
# torque:
#
#     swgjoint compare reference-2d reference-2d-parabolic reference-2d-simplified \
#         reference-2d-four-roller --scene ur5e-sweep --out compared
