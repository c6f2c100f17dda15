"""Work of a joint's step: allocations, map evaluations, instructions.

A program in C steps the same models as Python does, so that nothing else is counted.
It has an ``malloc`` of its own that counts, and a plugin built with a counter tells how
often a step evaluates the map.
"""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
import tracemalloc
from pathlib import Path

import mujoco
import numpy as np
import pytest

from swgjoint.bench.scaling.joint import chain_model, chain_spec, map_with
from swgjoint.joint import plugin

ROOT = Path(__file__).parents[1]
CC, CXX = os.environ.get("CC", "gcc"), os.environ.get("CXX", "g++")
JOINTS = 6
# as counted where they were written; a change that lowers one lowers it here
NATIVE_INSTRUCTIONS = 42_936
"""Of a step of six native drives, the engine's included; each has three tendons."""
FULL_INSTRUCTIONS = 60_730
EVALUATION_TABLES = 1.57
"""Memory of an evaluation in Python over that of a table of all its cos and sin."""
PROGRAM = r"""
#include <dlfcn.h>
#include <stdio.h>
#include <stdlib.h>
#include <mujoco/mujoco.h>

static volatile long allocations = 0;
extern void* __libc_malloc(size_t);
extern void* __libc_calloc(size_t, size_t);
extern void* __libc_realloc(void*, size_t);
void* malloc(size_t n) { ++allocations; return __libc_malloc(n); }
void* calloc(size_t n, size_t m) { ++allocations; return __libc_calloc(n, m); }
void* realloc(void* p, size_t n) { ++allocations; return __libc_realloc(p, n); }

int main(int argc, char** argv) {
  char error[1000] = "";
  if (argc != 4) return 2;
  mj_loadPluginLibrary(argv[1]);
  mjModel* m = mj_loadXML(argv[2], NULL, error, sizeof(error));
  if (!m) { fprintf(stderr, "%s\n", error); return 1; }
  mjData* d = mj_makeData(m);
  mj_resetDataKeyframe(m, d, 0);
  const long steps = atol(argv[3]);
  for (int k = 0; k < 20; ++k) mj_step(m, d);
  void* self = dlopen(argv[1], RTLD_NOW | RTLD_NOLOAD);
  long* seen = self ? (long*)dlsym(self, "swgjoint_evaluations") : NULL;
  const long before = allocations, evaluated = seen ? *seen : 0;
  for (long k = 0; k < steps; ++k) mj_step(m, d);
  printf("%ld %ld %.17g\n", allocations - before, seen ? *seen - evaluated : -1,
         d->qpos[0]);
  return 0;
}
"""

pytestmark = [
    pytest.mark.skipif(sys.platform != "linux", reason="counts with the C library's"),
    pytest.mark.skipif(shutil.which(CC) is None, reason=f"no C compiler {CC}"),
]


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return tmp_path_factory.mktemp("counts")


@pytest.fixture(scope="module")
def program(folder):
    """The stepping program, linked to the engine of the Python package."""
    home = Path(mujoco.__file__).parent
    (library,) = home.glob("libmujoco.so.*")
    source, out = folder / "step.c", folder / "step"
    source.write_text(PROGRAM)
    subprocess.run(
        [
            CC,
            *("-O1", str(source), "-o", str(out), f"-I{home / 'include'}"),
            *(str(library), f"-Wl,-rpath,{home}", "-ldl", "-lm"),
        ],
        check=True,
    )
    return out


@pytest.fixture(scope="module")
def models(folder):
    """Chains of driven joints in motion by level, as files with a keyframe."""
    found = {}
    for level in ("rigid", "native", "full"):
        _, data = chain_model(JOINTS, level=level)
        spec, _ = chain_spec(JOINTS, level=level)
        spec.add_key(qpos=data.qpos, qvel=data.qvel)
        spec.compile()
        found[level] = folder / f"{level}.xml"
        found[level].write_text(spec.to_xml())
    return found


def run(program, library, model, steps, before=()):
    """Allocations, evaluations and where the first joint ends."""
    done = subprocess.run(
        [*before, str(program), str(library), str(model), str(steps)],
        capture_output=True,
        text=True,
    )
    assert done.returncode == 0, done.stderr
    counts = done.stdout.split()
    return int(counts[0]), int(counts[1]), float(counts[2])


def test_the_program_steps_as_python_does(program, models):
    """The same position after the same steps; without a counter there is none."""
    *_, counted, place = run(program, plugin.library(), models["full"], 100)
    plugin.load()
    model = mujoco.MjModel.from_xml_path(str(models["full"]))
    data = mujoco.MjData(model)
    mujoco.mj_resetDataKeyframe(model, data, 0)
    mujoco.mj_step(model, data, 120)
    assert place == data.qpos[0] != 0.0
    assert counted == -1


@pytest.mark.parametrize("level", ["rigid", "native", "full"])
def test_a_step_allocates_nothing(program, models, level):
    """Neither the engine nor the plugin asks for memory once the data is made."""
    allocations, *_ = run(program, plugin.library(), models[level], 500)
    assert allocations == 0


@pytest.mark.slow
@pytest.mark.skipif(shutil.which(CXX) is None, reason=f"no C++ compiler {CXX}")
def test_map_evaluations_of_a_step(program, models, folder):
    """As many as the scheme has passes, and one set-up, in each joint; no more."""
    home = Path(mujoco.__file__).parent
    (library,) = home.glob("libmujoco.so.*")
    sources = []
    for path in sorted((ROOT / "swgjoint" / "plugin").glob("*.[ch]*")):
        text = path.read_text()
        if path.name == "drive_map.cc":
            head = "void DriveMap::SumHarmonics("
            assert text.count(head) == 1
            name, rest = text.split(head)
            begin, body = rest.split("{", 1)
            text = f"{name}{head}{begin}{{ ++swgjoint_evaluations;{body}"
            text = re.sub(
                r"\nnamespace swgjoint \{",
                '\nextern "C" { __attribute__((visibility("default")))'
                " long swgjoint_evaluations = 0; }\nnamespace swgjoint {",
                text,
                count=1,
            )
        (folder / path.name).write_text(text)
        if path.suffix == ".cc":
            sources.append(str(folder / path.name))
    out = folder / "libcounting.so"
    subprocess.run(
        [
            *(CXX, "-std=c++17", "-O1", "-fPIC", "-shared", "-ffp-contract=off"),
            *(f"-I{home / 'include'}", *sources, str(library), "-o", str(out)),
            f"-Wl,-rpath,{home}",
        ],
        check=True,
    )
    _, evaluations, _ = run(program, out, models["full"], 200)
    assert evaluations == 200 * JOINTS * plugin.PASSES
    assert plugin.PASSES == 2


@pytest.mark.slow
@pytest.mark.skipif(shutil.which("valgrind") is None, reason="no valgrind")
def test_instructions_of_a_step(program, models, folder):
    """Of the engine with six drives and of the drives alone.

    Within 10 %: compilers of the plugin and versions of the C library differ.
    """
    per_step = {}
    for level in ("native", "full"):
        total = []
        for steps in (50, 250):
            out = folder / f"callgrind.{level}.{steps}"
            tool = ["valgrind", "--tool=callgrind", "--toggle-collect=mj_step"]
            tool += [f"--callgrind-out-file={out}"]
            run(program, plugin.library(), models[level], steps, before=tool)
            summary = re.search(r"^(?:summary|totals): (\d+)", out.read_text(), re.M)
            assert summary
            total.append(int(summary[1]))
        per_step[level] = (total[1] - total[0]) / 200
    assert per_step["native"] == pytest.approx(NATIVE_INSTRUCTIONS, rel=0.1)
    assert per_step["full"] == pytest.approx(FULL_INSTRUCTIONS, rel=0.1)


def test_arrays_of_a_map_evaluation():
    """Python's evaluation: how many times its table the memory of a call is."""
    drive, n = map_with(64), 1000
    torsion = np.linspace(*drive.torsion_knots[[0, -1]], n)
    drive.torque(torsion, torsion, torsion)
    tracemalloc.start()
    try:
        drive.torque(torsion, torsion, torsion)
        peak = tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()
    table = n * drive.orders.shape[0] * 2 * 8
    assert peak / table == pytest.approx(EVALUATION_TABLES, rel=0.1)
