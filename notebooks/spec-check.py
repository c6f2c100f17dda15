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
# # Does this arm meet its spec? Drives for a UR5e that carries 5 kg
#
# A robot designer has an arm, a motion, a payload and a list of limits, and asks which
# drives to buy. Here every joint gets the same catalogue drive first, then each joint
# is asked what it costs, then the money goes where it matters.
#
# The arm, its links and its motion are those of the bundled scene `ur5e-catalogue`;
# 5 kg hang 60 mm in front of the flange. The maps come from the stiffness, ratings and
# losses that a catalogue states, so nothing has to be built.

# %%
from itertools import pairwise

import matplotlib.pyplot as plt
import numpy as np

from swgjoint.explore.compare.compare import compare, missed_limits
from swgjoint.sim.scene.scene import Scene
from swgjoint.units import mm
from swgjoint.view.run import run_scene
from swgjoint.view.words import format_figure, short

LOAD = {"payload.mass_kg": 5.0, "payload.centre_mm": [0.0, 0.0, 60.0]}
scene = Scene.load_file("ur5e-catalogue").with_changes(LOAD)

# %% [markdown]
# ## The limits
#
# What `swgjoint compare --spec FILE` reads from a file with a table `[spec]`. Torques
# count against the ratings of each drive: the peak against the repeated peak torque,
# the cubed mean against the rated one, as a catalogue asks for. The tool may leave its
# path by 0.8 mm rms.

# %%
spec = {
    "peak_torque_of_rating": 0.8,
    "cubed_mean_torque_of_rating": 1.0,
    "tool_path_rms_mm": 0.8,
}

# %% [markdown]
# ## One size for all joints
#
# The smallest sizes carry the arm, but not the payload; the next ones carry it, but
# wind up too far. Ratings alone would have chosen too small a drive.

# %%
sizes = ("CSG-14-100", "CSG-17-100", "CSG-20-100", "CSG-25-100", "CSG-32-100")
rows = compare(sizes, scene, spec=spec)
print(f"{'':12}  peak  mean  tool [mm]  torsion [arcmin]")
for row in rows:
    print(
        f"{row.argument:12}  {row.peak_torque_of_rating:4.2f}"
        f"  {row.cubed_mean_torque_of_rating:4.2f}  {row.tool_path_rms_mm:9.3f}"
        f"  {row.torsion_arcmin:16.2f}  misses: {', '.join(row.missed) or 'nothing'}"
    )

figure, axes = plt.subplots(1, 3, figsize=(11, 3.4), layout="constrained", sharey=True)
titles = (
    "peak torque / repeated peak",
    "cubic mean torque / rated torque",
    "tool path error, rms [mm]",
)
for axis, (key, limit), title in zip(axes, spec.items(), titles, strict=True):
    values = [getattr(row, key) for row in rows]
    colors = ["tab:red" if key in row.missed else "tab:green" for row in rows]
    axis.barh(sizes, values, color=colors)
    axis.axvline(limit, color="black", ls="--", lw=1)
    axis.set_title(title, fontsize="medium")
    for k, value in enumerate(values):
        axis.text(
            value, k, f" {format_figure(float(value))}", va="center", fontsize="small"
        )
    axis.set_xlim(0.0, 1.25 * max(values))
axes[0].invert_yaxis()

# %% [markdown]
# Torsion falls with every size, as the stiffness grows with about the cube of the
# diameter; the same load finds a stiffer spring.

# %%
for small, large in pairwise(rows):
    assert large.torsion_arcmin < small.torsion_arcmin
    assert large.K1_Nm_rad > small.K1_Nm_rad

# %% [markdown]
# ## Which joint costs what
#
# One joint keeps its drive of size 20, all others are made rigid: what the tool then
# misses is the share of that joint. The shares are vectors: they add up to more than
# the whole.

# %%
base = scene.with_drive("CSG-20-100")
shares = {}
for joint in scene.joints:
    levels = {
        f"joints.{name}.level": "full" if name == joint else "rigid"
        for name in scene.joints
    }
    alone = run_scene(base.with_changes(levels))
    shares[joint] = float(np.sqrt(np.mean(alone.tool_error() ** 2))) / mm
whole = rows[sizes.index("CSG-20-100")].tool_path_rms_mm

figure, axis = plt.subplots(figsize=(7, 3), layout="constrained")
axis.barh([short(joint) for joint in shares], list(shares.values()))
axis.axvline(whole, color="black", ls="--", lw=1, label="all joints together")
axis.set_xlabel("tool path error, rms [mm], drives of size 20")
axis.invert_yaxis()
axis.legend()
for joint, share in shares.items():
    print(f"{short(joint):14} {share:6.3f} mm")

# %% [markdown]
# ## The money where it matters
#
# Size 32 in shoulder lift and elbow, size 17 in the wrists, 20 in the pan joint: three
# small drives at the end of the arm and yet a better tool than size 25 everywhere.

# %%
mixed = dict.fromkeys(scene.joints, "CSG-17-100") | {
    "shoulder_pan_joint": "CSG-20-100",
    "shoulder_lift_joint": "CSG-32-100",
    "elbow_joint": "CSG-32-100",
}
chosen = scene.with_changes({f"joints.{k}.drive": v for k, v in mixed.items()})
(row,) = compare(["full"], chosen, spec=spec)
print(f"mixed: tool {row.tool_path_rms_mm:.3f} mm, misses: {row.missed or 'nothing'}")
for joint, figures in row.run.metrics()["joints"].items():
    use = figures["ratings"]
    print(
        f"{short(joint):14} {mixed[joint]}  peak {use['peak_Nm']:5.1f}"
        f" of {use['repeated_peak_Nm']:5.0f} N·m, cubed mean"
        f" {use['cubed_mean_Nm']:5.1f} of {use['rated_Nm']:4.1f} N·m"
    )
assert missed_limits(row, spec) == ()
assert row.tool_path_rms_mm < rows[sizes.index("CSG-25-100")].tool_path_rms_mm

# %% [markdown]
# ## What this does not tell
#
# A catalogue states the transmission accuracy as an upper bound, so these maps have no
# kinematic error and hardly any ripple; a design with finite elements behind it has
# both (`wave-generators.py`). Links, bearings and flange are rigid here. The same check
# for a script, with exit status 1 where a limit is missed:
#
#     swgjoint compare CSG-20-100 CSG-25-100 --scene ur5e-catalogue --spec spec.toml \
#         --set payload.mass_kg=5 --out check
