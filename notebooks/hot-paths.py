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
# # Where the computing time goes
#
# Three programs take most of the time for which a user waits: the equilibria from which
# a 2D map is built, a 3D simulation of meshing, and the time steps of an arm. Each of
# them is profiled here on the machine that runs this notebook, and compared with an
# older commit. The two commits were measured alternately
# (`tests/benchmarks/profile_cost.py`), on two cores shared with other programs: one
# pair of measurements for the 3D run, two pairs for the other two programs. The ratios
# of two pairs differ by up to a third. Ratios close to one, or on both sides of one,
# therefore show no difference.

# %%
import cProfile
import json
import pstats
import time
from pathlib import Path

import matplotlib.pyplot as plt
import mujoco
import numpy as np

import swgjoint
from swgjoint.bench.scaling.joint import chain_model
from swgjoint.drives.build_map import build_map
from swgjoint.fe.solid.continuation import SolidContinuation
from swgjoint.fe.solid.drive3d import solid_sector_model
from swgjoint.fe.solid.stress import SolidMaxima

here = Path(__file__).parent if "__file__" in globals() else Path.cwd()
stored = json.loads((here / "hot-paths.json").read_text(encoding="utf-8"))
for task, one in stored["tasks"].items():
    print(f"{task}: commit {one['after']['commit']} against {one['before']}")


# %%
def profiled(work):
    """CPU time of each function including the functions that it calls [s]."""
    profile = cProfile.Profile(time.process_time)
    profile.runcall(work)
    return {key: row[3] for key, row in pstats.Stats(profile).stats.items()}


def seconds(times, file, *functions):
    """Total CPU time of functions of one file [s].

    The functions must not call one another. Of several functions with the same name
    the slowest counts, which contains the others.
    """
    found = dict.fromkeys(functions, 0.0)
    for (path, _, name), value in times.items():
        if path.endswith(file) and name in found:
            found[name] = max(found[name], value)
    return sum(found.values())


def bars(axis, parts, title):
    """Draw the shares of the total CPU time, the largest at the top."""
    names = sorted(parts, key=parts.get)
    whole = sum(parts.values())
    axis.barh(names, [100.0 * parts[name] / whole for name in names])
    axis.set(xlabel="share of CPU time [%]", title=f"{title}: {whole:.1f} s")


def pairs(axis, task, title):
    """Draw the time of each part divided by that of the older commit.

    A dot is one pair of measurements.
    """
    parts = stored["tasks"][task]["parts"]
    for k, one in enumerate(parts.values()):
        axis.plot([k] * len(one["ratios"]), 1.0 / np.array(one["ratios"]), "ko")
    axis.margins(x=0.2)
    axis.axhline(1.0, color="0.6", label="before")
    axis.set_xticks(range(len(parts)), parts, fontsize=8, rotation=15)
    axis.set(ylabel="time / time before", title=title, ylim=(0.0, 1.4))
    axis.legend(fontsize=8, loc="lower right")


def commit(task):
    """Hash of the older commit of a task."""
    return stored["tasks"][task]["before"].split()[0]


def page(task, shares, title):
    """Draw shares and comparison next to each other."""
    _, axes = plt.subplots(1, 2, figsize=(11, 3.8), layout="constrained")
    bars(axes[0], shares, f"{title} now")
    pairs(axes[1], task, f"{title}, against {commit(task)}")


# %% [markdown]
# ## A 2D map
#
# The map is that of `reference-2d` with two positions per pitch, all torques and no
# cache. Each Newton step condenses the ring of sectors, which is a banded
# factorisation, and searches for tooth contact, which projects points onto curved
# flanks.

# %%
design = swgjoint.Design.load("reference-2d")
times = profiled(lambda: build_map(design, model="2d", angles=2, cache=False))
whole = seconds(times, "build_map.py", "build_map")
search = seconds(times, "tooth_contact.py", "search")
plane = {
    "search of tooth contact": search,
    "ring: factorise, solve": seconds(
        times, "fe/common/cyclic.py", "__init__", "solve"
    ),
    "frames and tangents": seconds(times, "fe/plane/linearise.py", "linearise"),
    "contact forces": seconds(times, "complementarity.py", "solve_mixed"),
    "sector: mesh, condense": seconds(times, "superelement.py", "condense"),
}
plane["rest"] = whole - sum(plane.values())
page("2d map", plane, "2D map")
for name, value in plane.items():
    print(f"{name:26} {value:6.2f} s, {100 * value / whole:4.1f} %")

# %% [markdown]
# The search for contact takes the largest share. In the older commit it evaluated the
# flank piece by piece, arc after line after arc; now it evaluates all points at once
# from a table. In the two pairs, the older commit took 6 and 46 % longer. The new
# search is faster, but two pairs do not show by how much.

# %%
assert plane["search of tooth contact"] > plane["contact forces"]

# %% [markdown]
# ## A 3D run
#
# The drive is half of a small gear on the coarsest mesh. The run consists of
# condensation, deflection, load, one position and stresses.

# %%
small = swgjoint.Design.load("reference-3d-modified").with_changes(
    {
        "drive.teeth_flexspline": 40,
        "drive.teeth_circular_spline": 42,
        "cup.length_mm": 14.0,
        "cup.bore_radius_mm": 7.0,
        "mesh.refinement": 0.5,
    }
)


def run_3d():
    """Simulate one position and its stresses."""
    ring = solid_sector_model(small, half=True)
    follow = SolidContinuation(model=ring, ratio=small.ratio)
    state = follow.to_torque(follow.engage(follow.deflect()), 5.0)
    state = follow.to_angle(state, 0.5 * np.pi / 42)
    assert state.outcome.ok
    return SolidMaxima.from_state(ring, state)


times = profiled(run_3d)
whole = max(times.values())
space = {
    "condensation of sectors": seconds(times, "drive3d.py", "solid_sector_model"),
    "ring: factorise, solve": seconds(times, "solid/equilibrium.py", "_solve_sectors"),
    "frames and tangents": seconds(times, "solid/linearise.py", "linearise"),
    "search of tooth contact": seconds(times, "solid/teeth.py", "find"),
    "stresses": seconds(times, "solid/stress.py", "at"),
}
space["rest"] = whole - sum(space.values())
page("3d run", space, "3D run")
for name, value in space.items():
    print(f"{name:26} {value:6.2f} s, {100 * value / whole:4.1f} %")

# %% [markdown]
# The sectors are condensed once for any number of positions. The remaining time is
# shared by the dense blocks of the ring, the tangents of its segments and the search
# for contact. In the only pair of measurements no part is more than 14 % faster or
# slower than before, so there is no significant difference.

# %% [markdown]
# ## A step of a joint
#
# Six joints in a chain make steps of 1 ms. The levels differ in what they add to the
# rigid chain: `native` adds a rotor and a tendon, and `full` also the map, here with an
# increasing number of harmonics.


# %%
def step_time(**keys):
    """Lowest CPU time of a step in five runs [µs]."""
    model, data = chain_model(6, **keys)
    mujoco.mj_step(model, data, 200)
    least = []
    for _ in range(5):
        begin = time.process_time()
        mujoco.mj_step(model, data, 1000)
        least.append((time.process_time() - begin) * 1e3)
    return min(least)


rigid, native = step_time(level="rigid"), step_time(level="native")
harmonics = (1, 4, 16, 64)
full = {n: step_time(harmonics=n) for n in harmonics}
figure, axes = plt.subplots(1, 2, figsize=(11, 3.8), layout="constrained")
names = ["rigid", "native", *(f"full, {n}" for n in harmonics)]
axes[0].bar(names, [rigid, native, *full.values()], color="0.7")
axes[0].bar(names, [rigid] * len(names), label="share of the rigid arm")
axes[0].set(ylabel="CPU time of a step [µs]", title="six joints, harmonics of the map")
axes[0].tick_params(axis="x", labelsize=8)
axes[0].legend(fontsize=8)
pairs(axes[1], "joint step", f"step, 16 harmonics, against {commit('joint step')}")
print(f"rigid {rigid:.1f} µs, native {native:.1f} µs")
print(f"rotors and tendons {native - rigid:.1f} µs, map {full[16] - native:.1f} µs")
print({n: f"{value:.1f} µs" for n, value in full.items()})

# %% [markdown]
# The map is the most expensive part of `full`. It costs more than the rotors, which
# double the degrees of freedom, and their tendons, which `native` has as well. A few
# harmonics cost little more than one, because four are summed in parallel. `swgjoint
# bench scaling` measures how the time grows with teeth, mesh and joints;
# `tests/test_counts.py` checks the numbers of iterations, factorisations and map
# evaluations.

# %%
last = {k: v["after_s"] for k, v in stored["tasks"]["joint step"]["parts"].items()}
assert last["full"] - last["native"] > last["native"] - last["rigid"]
assert rigid < native < full[64]
