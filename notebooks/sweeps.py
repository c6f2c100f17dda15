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
# # Many designs: a sweep, a cluster, a search, and the cost of a million designs
#
# A designer compares many drives, not just one. A sweep file defines the designs and
# the figures to be computed for each. The sweep below combines two ellipses with two
# rim thicknesses, as 2D models on a coarse mesh. Bundled sweeps are in `models/sweeps`,
# and a search in `models/optimisations`:
#
#     swgjoint sweep wave-generator --out wave-generator
#     swgjoint sweep tolerances --out tolerances
#     swgjoint optimise qca-stress --out qca-stress

# %%
import importlib.util
import io
import os
import subprocess
import sys
import tempfile
import time
import tracemalloc
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np

from swgjoint import Design
from swgjoint.explore.optimise.file import OptimisationFile
from swgjoint.explore.optimise.optimise import optimise
from swgjoint.explore.sweep.executor import dask_pool
from swgjoint.explore.sweep.file import SweepFile
from swgjoint.explore.sweep.points import points_of
from swgjoint.explore.sweep.results import place_of
from swgjoint.explore.sweep.scale import schedule, tasks_of
from swgjoint.explore.sweep.sweep import TASK_S, run_sweep
from swgjoint.pool import LocalPool
from swgjoint.view.plots.optimise import optimum_picture

SWEEP = """
description = "Rim and minor axis"
design = "coarse.toml"

[meshing]
figures = ["von_mises_MPa", "transmission_error_pp_arcsec"]
positions = 3

[plan]
kind = "grid"

[[plan.parameters]]
keys = ["wave_generator.minor_axis_coefficient"]
values = [0.985, 1.0]

[[plan.parameters]]
keys = ["flexspline.rim_mm"]
values = [1.0, 1.2]
"""
folder = Path(tempfile.mkdtemp(prefix="sweeps-"))
for name, source in (
    ("coarse", "reference-2d"),
    ("improved", "reference-2d-qca-improved"),
):
    design = Design.load(source).with_changes({"mesh.refinement": 0.5})
    (folder / f"{name}.toml").write_text(design.to_toml())
(folder / "rim.toml").write_text(SWEEP)
file = SweepFile.load(folder / "rim.toml")

# %% [markdown]
# ## On this machine
#
# This cell does the same as `swgjoint sweep rim.toml --jobs 2 --out results`. Every
# result is stored as soon as it is available, under a hash of the design, the requested
# figures and the code.

# %%
place = place_of(folder / "results")
found = run_sweep(file, executor=LocalPool(2), place=place)
print(f"{'C':>6} {'rim [mm]':>9} {'von Mises [MPa]':>16} {'error pp [arcsec]':>18}")
for row in found.rows():
    C, rim, _, stress, error, *_ = row.values()
    print(f"{C:6.3f} {rim:9.1f} {stress:16.1f} {error:18.3f}")
assert all(record.ok for record in found.records)

# %%
figure, axes = plt.subplots(1, 2, figsize=(10, 3.8), layout="constrained")
rows = found.rows()
for rim in (1.0, 1.2):
    part = [row for row in rows if row["flexspline.rim_mm"] == rim]
    C = [row["wave_generator.minor_axis_coefficient"] for row in part]
    for axis, name in zip(axes, file.figures, strict=True):
        axis.plot(C, [row[name] for row in part], "o-", label=f"rim {rim:g} mm")
axes[0].set(xlabel="minor axis coefficient C", ylabel="von Mises [MPa]")
axes[1].set(xlabel="minor axis coefficient C", ylabel="transmission error, pp [arcsec]")
for axis in axes:
    axis.grid(alpha=0.3)
    axis.legend()

# %% [markdown]
# ## Resuming an interrupted sweep
#
# An interrupted sweep resumes when it is started again, and finished designs are not
# computed again. Here nothing is left to do.

# %%
again = run_sweep(file, executor=LocalPool(2), place=place)
print(f"computed {again.computed}, reused {again.reused}, {again.wall_s:.2f} s")
assert (again.computed, again.reused) == (0, len(found.points))
assert again.rows() == found.rows()

# %% [markdown]
# ## On a cluster
#
# The workers of a [dask](https://distributed.dask.org) scheduler compute the same file.
# Here the cluster consists of three processes on this machine (`pip install
# 'swgjoint[cluster]'`):
#
#     dask scheduler --host 127.0.0.1 --port 8786
#     dask worker tcp://127.0.0.1:8786 --nworkers 2 --nthreads 1
#     swgjoint sweep wave-generator --scheduler tcp://127.0.0.1:8786 --out results
#
# If the file contains a table `[cluster]`, the sweep submits SLURM jobs as its workers:
#
#     [cluster]
#     kind = "slurm"
#     jobs = 20
#     cores = 16
#     memory_GB = 32.0
#     walltime = "02:00:00"
#
# If a worker dies, only the designs of its current task are lost, and another worker
# computes them again.


# %%
def same(one, other):
    """Whether two sweeps have the same rows, apart from their computing times."""
    rows = [[{**row, "work_s": None} for row in sweep.rows()] for sweep in (one, other)]
    return rows[0] == rows[1]


handing = None
if importlib.util.find_spec("distributed") is None:
    print("dask is not installed: this part is skipped")
else:
    told = folder / "scheduler.json"
    options = ["--scheduler-file", str(told), "--host", "127.0.0.1", "--no-dashboard"]

    def started(kind, *more):
        """Start a process of the cluster in the same way as the commands above."""
        command = [sys.executable, "-m", f"distributed.cli.dask_{kind}"]
        return subprocess.Popen(
            [*command, *options, *more],
            cwd=folder,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
        )

    processes = [started("scheduler", "--port", "0")]
    while not told.exists():
        time.sleep(0.1)
    processes.append(started("worker", "--nworkers", "2", "--nthreads", "1"))
    try:
        with dask_pool(str(told)) as pool:
            pool.client.wait_for_workers(2)
            on_cluster = run_sweep(file, executor=pool)
            begin = time.perf_counter()
            count = sum(1 for _ in pool.run(os.getenv, ["HOME"] * 200))
            handing = (time.perf_counter() - begin) / count
    finally:
        for process in reversed(processes):
            process.terminate()
            process.wait()
    print(f"identical: {same(on_cluster, found)}; dispatch {1e3 * handing:.1f} ms")
    assert same(on_cluster, found)

# %% [markdown]
# ## A search instead of a plan
#
# To find the best design, a genetic search chooses the values. A file states the
# objectives, the parameters that may change, and how the front is computed again. Each
# generation of the search is a sweep, so it runs wherever sweeps run and resumes in the
# same way. The search below is a small one on the coarse mesh; `swgjoint optimise
# qca-stress` searches on the mesh of the thesis.
#
#     swgjoint optimise search.toml --jobs 2 --out results

# %%
SEARCH = """
description = "Profile and ellipse, coarse"
design = "coarse.toml"
beside = ["improved.toml"]

[meshing]
figures = ["von_mises_MPa", "torsional_stiffness_Nm_rad"]
torque_Nm = 20.0
positions = 1

[[objectives]]
figure = "von_mises_MPa"

[[objectives]]
figure = "torsional_stiffness_Nm_rad"
goal = "maximise"

[plan]
kind = "nsga2"
designs = 8
population = 4

[[plan.parameters]]
keys = ["wave_generator.minor_axis_coefficient"]
values = [0.99, 0.995, 1.0]

[[plan.parameters]]
keys = ["flexspline.profile.tip_radius_mm", "circular_spline.profile.tip_radius_mm"]
low = 0.2
high = 0.6

[[plan.parameters]]
keys = [
  "flexspline.profile.dedendum_radius_mm",
  "circular_spline.profile.dedendum_radius_mm",
]
low = 1.0
high = 30.0

[[plan.parameters]]
keys = ["flexspline.profile.root_radius_mm", "circular_spline.profile.root_radius_mm"]
low = 0.2
high = 0.6

[confirm]
designs = 1
positions = 2
"""
(folder / "search.toml").write_text(SEARCH)
if importlib.util.find_spec("optuna") is None:
    print("optuna is not installed (swgjoint[tune]): this part is skipped")
else:
    search = OptimisationFile.load(folder / "search.toml")
    optimum = optimise(search, executor=LocalPool(2), place=place)
    told = optimum.to_json()
    print(f"{told['evaluations']} designs in {told['wall_s']:.0f} s")
    for row in (told["start"], *told["beside"], *told["front"]):
        best = row["confirmed"] or row
        name = Path(row.get("design", "front")).stem
        values = [best[figure] for figure in told["figures"]]
        print(f"{name:10} {values[0]:8.1f} MPa {values[1]:10.3g} N·m/rad")
    figure, axis = plt.subplots(figsize=(15, 5), layout="constrained")
    axis.imshow(plt.imread(io.BytesIO(optimum_picture(optimum))))
    axis.axis("off")
    assert told["front"][0]["von_mises_MPa"] < told["start"]["von_mises_MPa"]

# %% [markdown]
# ## The cost of a million designs
#
# The estimate uses six measured values:
#
# - the CPU time of a design,
# - the time to check a design and to compute the hash of its result,
# - the time to dispatch a task (from two hundred empty tasks and two workers, so rather
#   an overestimate),
# - the time in which a process starts and imports the finite elements,
# - the size of a result,
# - the memory per design in the dispatching process, which keeps only values and key of
#   a design (the worker constructs it).

# %%
work = np.array([record.work_s for record in found.records])
if handing is None:
    begin = time.perf_counter()
    count = sum(1 for _ in LocalPool(2).run(os.getenv, ["HOME"] * 200))
    handing = (time.perf_counter() - begin) / count
begin = time.perf_counter()
subprocess.run([sys.executable, "-c", "import swgjoint.fe.meshing"], check=True)
start = time.perf_counter() - begin
(folder / "many.toml").write_text(
    SWEEP.replace('"grid"', '"latin_hypercube"\ndesigns = 300')
)
many = SweepFile.load(folder / "many.toml")
begin = time.perf_counter()
points = points_of(many)
planning = (time.perf_counter() - begin) / len(points)
del points
tracemalloc.start()
points = points_of(many)
held = tracemalloc.get_traced_memory()[0] / len(points)
tracemalloc.stop()
sizes = [path.stat().st_size for path in (folder / "results").rglob("*.json")]
low, high = work.min(), work.max()
print(f"CPU time of a design   {work.mean():8.2f} s ({low:.2f} to {high:.2f})")
print(f"planning of a design   {1e3 * planning:8.2f} ms")
print(f"dispatch of a task     {1e3 * handing:8.2f} ms")
print(f"start of a process     {start:8.2f} s")
print(f"size of a result       {np.mean(sizes):8.0f} bytes")
print(f"memory per design      {held:8.0f} bytes")
assert held < 2000.0

# %% [markdown]
# The wall time follows from list scheduling: each free worker takes the next task, and
# one process dispatches all tasks. The first step compares this model with the sweep
# above, with two workers and the measured CPU times in the order of the plan.

# %%
told_wall = schedule(work, found.workers, start=start, handing=handing).wall
print(f"simulated {told_wall:.1f} s, measured {found.wall_s:.1f} s")
# the CPU times alone give a lower bound; the rest depends on the load of the machine
assert schedule(work, found.workers).wall < found.wall_s

# %% [markdown]
# The second step simulates a million designs whose CPU times are drawn from the
# measured ones. The sweep combines cheap designs until a task takes two seconds.
# Dispatching them one by one would keep fewer workers busy.

# %%
million = 1_000_000
drawn = np.random.default_rng(0).choice(work, size=million)
start += million * planning  # before the first task is handed out
tasks = tasks_of(drawn, TASK_S)
tenths = tasks_of(drawn / 10.0, TASK_S)  # coarser elements or thin rings
print(f"CPU time: {drawn.sum() / 3600:.0f} h")
print(f"memory of the dispatching process: {million * held / 1e9:.1f} GB of designs")
print(f"results: {million * np.mean(sizes) / 1e9:.1f} GB in a million files")
print(f"{'':8} {'':>9} {'':>6}    designs ten times cheaper")
header = ("workers", "wall [h]", "busy", "wall [h]", "busy", "one by one")
print("{:>8} {:>9} {:>6} {:>10} {:>8} {}".format(*header))
for workers in (16, 128, 1024):
    one = schedule(tasks, workers, start=start, handing=handing)
    together = schedule(tenths, workers, start=start, handing=handing)
    single = schedule(drawn / 10.0, workers, start=start, handing=handing)
    print(
        f"{workers:8} {one.wall / 3600:9.2f} {one.efficiency:6.0%}"
        f" {together.wall / 3600:10.2f} {together.efficiency:8.0%}"
        f" {single.efficiency:10.0%}"
    )
limit = np.mean(tasks) / handing
print(f"one scheduler keeps about {limit:.0f} workers busy with these tasks")

# %% [markdown]
# The results show:
#
# - Up to about a hundred workers, the wall time is the CPU time divided by the number
#   of workers, so more workers always help.
# - With more workers, the dispatching process is the bottleneck. The limit rises in
#   proportion to the duration of a task (`swgjoint.explore.sweep.sweep.TASK_S`).
#   Several sweeps of parts of the plan, into the same folder, raise it as well.
# - The dispatching process needs about 1 GB for a million designs with their records,
#   and about 5 GB while it writes the tables at the end. It must run on a machine with
#   that much memory.
# - A million small files take only a few gigabytes, but are slow to list on a parallel
#   file system. Use an object store (`--out s3://bucket/sweep`) or sweep in parts. The
#   table `sweep.parquet` is a single file.
# - If a worker dies, one task of two seconds is lost. If the dispatching process dies,
#   the tasks in progress are lost, and the same command resumes the sweep.

# %%
for path in sorted(folder.rglob("*"), reverse=True):
    path.rmdir() if path.is_dir() else path.unlink()
folder.rmdir()
