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
# # Error against run time: how detailed must a model be?
#
# The levels of this package differ widely in run time, from a rigid gear at hundreds of
# times real time to finite elements that take seconds per position. A model should be
# as accurate as the question requires, and no slower than that. This notebook measures
# error and run time for two series of models: the levels of a joint in a scene, and the
# finite elements from which its map is built.

# %%
import matplotlib.pyplot as plt
import numpy as np

import swgjoint
from swgjoint.drives.references import load_drive
from swgjoint.gear.design.design import Design
from swgjoint.sim.scene.scene import Scene
from swgjoint.units import arcmin
from swgjoint.view.run import run_scene
from swgjoint.view.validity import step_error

# %% [markdown]
# ## The joint: levels and steps
#
# One joint turns slowly under rated torque. Its map is built from few positions (six
# per pitch, a few seconds). The reference is level `full` with a step of 1/16 ms. The
# error is the largest difference of the transmission error from this reference after
# the initial transient.

# %%
drive = load_drive("reference-2d-simplified", model="2d", angles=6)
name = "reference-2d-simplified"
scene = Scene.load_file("bench").with_changes(
    {"defaults.drive": name, "simulation.duration_s": 1.5}
)
LEVELS = ("rigid", "kinematic", "linear", "native", "full")
STEPS = (2e-3, 1e-3, 5e-4, 2.5e-4)


def at(level, step):
    """Run of the scene at one level and step [s]."""
    changes = {"defaults.level": level, "simulation.step_s": step}
    return run_scene(scene.with_changes(changes), drives={name: drive})


def grid(run):
    """Settled transmission error at the instants that all runs share [arcmin]."""
    stride = round(2e-3 / (run.time[1] - run.time[0]))
    return run.transmission_error[::stride, 0][250:] / arcmin


reference = grid(at("full", 6.25e-5))
print(f"reference: {np.mean(reference):.3f} arcmin, swing {np.ptp(reference):.4f}")
errors, speeds = {}, {}
for level in LEVELS:
    for step in STEPS:
        # the faster of two runs: the first one includes the warm-up
        run = min((at(level, step) for _ in range(2)), key=lambda found: found.wall)
        errors[level, step] = float(np.abs(grid(run) - reference).max())
        speeds[level, step] = run.time[-1] / run.wall

print(f"{'':10}" + "".join(f"{1e3 * step:>12g} ms" for step in STEPS))
for level in LEVELS:
    print(f"{level:10}" + "".join(f"{errors[level, s]:15.4f}" for s in STEPS))

# %%
figure, axis = plt.subplots(figsize=(8, 4.5), layout="constrained")
for level in LEVELS:
    x = [1.0 / speeds[level, step] for step in STEPS]
    axis.loglog(x, [errors[level, step] for step in STEPS], "o-", label=level)
axis.set_xlabel("CPU seconds per simulated second")
axis.set_ylabel("error of the transmission error [arcmin]")
axis.set_title("one joint at rated torque; steps 2, 1, 0.5 and 0.25 ms")
axis.grid(alpha=0.3, which="both")
axis.legend()

# %% [markdown]
# Without torsion (`rigid`, `kinematic`), the error is the whole torsion under load, and
# a smaller step does not reduce it. The spring of `linear` is the secant stiffness at
# rated torque and therefore correct at this load only; the nonlinear spring of `native`
# is 2 % off here. Both neglect the kinematic error. Only with `full` does the error
# keep decreasing with the step. At 2 ms, `full` has also lost the tooth orders, as
# shown below.

# %%
assert errors["rigid", 1e-3] > errors["linear", 1e-3] > errors["full", 1e-3]
assert errors["full", 2.5e-4] < 0.5 * errors["full", 1e-3]
assert errors["rigid", 2.5e-4] > 0.99 * errors["rigid", 1e-3]

# %% [markdown]
# ## Orders that the step leaves out
#
# A harmonic whose phase advances by more than half a radian per step is left out and
# listed, never aliased. At 3 deg/s a step of 2 ms cannot resolve the tooth order, 122
# per turn of the input; a step of 1 ms can.

# %%
for step in STEPS:
    figures = at("full", step).metrics()["joints"]["joint"]
    left_out = [item["order"] for item in figures["unresolved"]]
    print(
        f"{1e3 * step:5g} ms: up to order {figures['highest_resolved_order']:5.0f},"
        f" {len(left_out)} left out, ripple {figures['ripple_rms_percent']:.3f} % rms"
    )

# %% [markdown]
# ## An error estimate without a reference
#
# In practice there is no reference. A second run with half the step and the same orders
# gives an estimate of the error due to the step. The report states it next to every
# result.

# %%
coarse = at("full", 1e-3)
estimate = step_error(coarse)["joints"]["joint"]
fine = step_error(at("full", 2.5e-4))["joints"]["joint"]
for key, value in estimate.items():
    print(f"{key:28} +- {value:.2g} at 1 ms, +- {fine[key]:.2g} at 0.25 ms")
assert fine["transmission_error_arcmin"] < estimate["transmission_error_arcmin"]

# %% [markdown]
# ## The finite elements
#
# The next cell computes the stress at the tooth root and the torsion under rated torque
# on increasingly fine meshes, at two positions of the wave generator. The finest mesh
# is the reference here; `validation.py` compares the results with an independent code.

# %%
design = Design.load(name)
MESHES = (0.5, 1.0, 1.5)
found = {}
for mesh in MESHES:
    run = swgjoint.simulate_meshing(
        design.with_changes({"mesh.refinement": mesh}),
        model="2d",
        torque=20.0,
        steps=2,
        turn=0.5 / 122,
        half=True,
    )
    stress = run.to_json()["flexspline"]["average_max_MPa"]["tensile"]
    wind_up = abs(float(run.series("output_error").mean())) / arcmin
    found[mesh] = (run.wall_s, stress, wind_up)
    print(
        f"refinement {mesh:3g}: {run.nodes:6d} nodes, {run.wall_s:5.1f} s,"
        f" {stress:6.1f} MPa, output {wind_up:.4f} arcmin from ideal"
    )

*_, (_, best_stress, best_wind_up) = found.values()
figure, axis = plt.subplots(figsize=(8, 4), layout="constrained")
walls = [found[mesh][0] for mesh in MESHES[:-1]]
for k, (label, best) in enumerate(
    (("root stress", best_stress), ("torsion", best_wind_up)), start=1
):
    error = [100.0 * abs(found[mesh][k] / best - 1.0) for mesh in MESHES[:-1]]
    axis.loglog(walls, error, "o-", label=label)
for mesh, wall in zip(MESHES[:-1], walls, strict=True):
    axis.axvline(wall, color="0.85", zorder=0)
    axis.text(wall, axis.get_ylim()[0], f" {mesh:g}", color="0.4", va="bottom")
axis.set_xlabel("time for set-up and two positions of half the drive [s]")
axis.set_ylabel(f"difference from refinement {MESHES[-1]:g} [%]")
axis.grid(alpha=0.3, which="both")
axis.legend()

# %% [markdown]
# On the mesh of the thesis (refinement 1) the torsion is within one percent, but the
# root stress is still eight percent below that of the finest mesh here and ten percent
# below that of refinement 2. A map for a joint therefore needs only a coarse mesh, a
# fatigue figure a fine one. `swgjoint bench fe` makes this comparison for all models
# from thin rings to 3D elements, with memory and Pareto front, and names the cheapest
# setting within 1, 5 and 15 %. `swgjoint bench joint` does it for levels, integrators
# and steps, and `swgjoint bench scaling` shows how the time grows. `hot-paths.py` shows
# which parts of the code take the time.
