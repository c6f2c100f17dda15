"""Imports point one way and stay cheap."""

from __future__ import annotations

import ast
import json
import subprocess
import sys
from collections import Counter
from functools import cache
from graphlib import CycleError, TopologicalSorter
from pathlib import Path

import pytest
from messages import naming

import swgjoint

PACKAGE = Path(swgjoint.__file__).parent
LEVELS = (
    ("kernels",),
    ("gear",),
    ("maps",),
    ("fe", "joint", "identify"),
    ("drives",),
    ("sim",),
    ("view", "control"),
    ("envs",),
    ("explore", "bench", "validation"),
    ("studio",),
    ("cli",),
)
"""A part imports parts of earlier levels only, not those beside it."""
RANK = {name: rank for rank, level in enumerate(LEVELS) for name in level}


def modules() -> list[Path]:
    return sorted(PACKAGE.rglob("*.py"))


@cache
def imports(path: Path) -> list[tuple[str, bool]]:
    """Imported names of a file and whether they are imported at import time."""
    tree = ast.parse(path.read_text(encoding="utf-8"))
    found = []
    parents = {c: p for p in ast.walk(tree) for c in ast.iter_child_nodes(p)}
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            names = [alias.name for alias in node.names]
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, f"{path}: relative import"
            names = [f"{node.module}.{alias.name}" for alias in node.names]
        else:
            continue
        at_import, only_types, up = True, False, node
        while up in parents:
            up = parents[up]
            if isinstance(up, ast.FunctionDef | ast.AsyncFunctionDef):
                at_import = False
            if isinstance(up, ast.If) and "TYPE_CHECKING" in ast.unparse(up.test):
                only_types = True
        if not only_types:
            found += [(name, at_import) for name in names]
    return found


def part_of(path: Path) -> str | None:
    """Sub-package of a file; None for the base modules beside them."""
    inside = path.relative_to(PACKAGE).parts
    return inside[0] if len(inside) > 1 else None


def test_every_part_has_its_place():
    """Each sub-package with Python code is named in the chain of arrows."""
    parts = {part_of(path) for path in modules()} - {None, "plugin"}
    assert parts <= set(RANK)


def test_arrows():
    """A part imports only itself, the parts to its left and the base modules.

    Imports inside functions count; those that only types need do not.
    """
    wrong = []
    for path in modules():
        here = part_of(path)
        for name, _ in imports(path):
            words = name.split(".")
            if words[0] != "swgjoint" or len(words) < 2 or words[1] not in RANK:
                continue
            there = words[1]
            # base modules know no part; the entry point starts the command line
            backwards = here is None and path.name != "__main__.py"
            if here is not None and there != here:
                backwards = RANK[there] >= RANK[here]
            if backwards:
                wrong.append(f"{path.relative_to(PACKAGE).as_posix()} imports {name}")
    assert wrong == []


def test_no_circles():
    """No module imports itself by way of others, not even inside functions."""
    names = {module_of(path): path for path in modules()}
    graph: dict[str, set[str]] = {}
    for module, path in names.items():
        found = set()
        for name, _ in imports(path):
            while name and name not in names:
                name = name.rpartition(".")[0]
            found.add(name)
        # a package is no more than the docstring of its folder
        graph[module] = {n for n in found if names.get(n, path).name != "__init__.py"}
    order = TopologicalSorter({m: graph[m] - {m} for m in graph})
    try:
        order.prepare()
    except CycleError as error:
        pytest.fail(" -> ".join(error.args[1]))


def module_of(path: Path) -> str:
    """Dotted name of a file."""
    words = ("swgjoint", *path.relative_to(PACKAGE).with_suffix("").parts)
    return ".".join(words).removesuffix(".__init__")


@pytest.mark.parametrize("limit", [25])
def test_folders_are_small(limit):
    """No folder has more files directly in it than one can see at once."""
    sizes = Counter(path.parent for path in modules())
    assert [folder for folder, size in sizes.items() if size > limit] == []


def test_scikit_fem_lives_in_fe_only():
    """No other part imports scikit-fem, not even inside a function."""
    users = {
        part_of(path)
        for path in modules()
        for name, _ in imports(path)
        if name.split(".")[0] == "skfem"
    }
    assert users == {"fe"}


def test_heavy_parts_are_imported_when_used():
    """rerun, matplotlib and optional packages are imported inside functions only.

    The environments and the studio are the parts that are made of such a package.
    """
    heavy = {"rerun", "matplotlib", "pyvista", "pinocchio", "casadi", "jinja2", "dask"}
    heavy |= {"gymnasium", "cma", "optuna", "joblib", "distributed", "nicegui"}
    found = [
        f"{path.relative_to(PACKAGE)} imports {name}"
        for path in modules()
        for name, at_import in imports(path)
        if at_import and (package := name.split(".")[0]) in heavy
        if (part_of(path), package)
        not in {("envs", "gymnasium"), ("studio", "nicegui")}
    ]
    assert found == []


def test_mujoco_is_imported_by_the_joint_and_what_uses_it():
    """Geometry, finite elements and maps work without the engine."""
    users = {
        part_of(path)
        for path in modules()
        for name, _ in imports(path)
        if name.split(".")[0] == "mujoco"
    }
    assert users & {None, "gear", "maps", "fe"} == set()


def loaded_by(statement: str) -> set[str]:
    """Top-level packages outside the standard library that a statement loads."""
    code = (
        "import sys; before = set(sys.modules)\n"
        f"{statement}\n"
        "import json; print(json.dumps(sorted(set(sys.modules) - before)))"
    )
    done = subprocess.run(
        [sys.executable, "-I", "-c", code], capture_output=True, text=True, check=True
    )
    names = {name.split(".")[0] for name in json.loads(done.stdout)}
    return names - set(sys.stdlib_module_names)


def test_importing_the_package_is_cheap():
    """``import swgjoint`` loads nothing outside the standard library but numpy."""
    assert loaded_by("import swgjoint") <= {"swgjoint", "numpy"}


def test_help_loads_no_package():
    """The command line's own module loads nothing outside the standard library."""
    assert loaded_by("import swgjoint.cli.main") <= {"swgjoint"}


@pytest.mark.parametrize("name", swgjoint._PUBLIC)
def test_public_names_resolve(name):
    """Every public name is there and says what it is."""
    assert getattr(swgjoint, name).__doc__


def test_unknown_names_are_refused():
    """A name that is not public is an AttributeError."""
    with pytest.raises(AttributeError, match=naming("'swgjoint'", "'nothing'")):
        _ = swgjoint.nothing
