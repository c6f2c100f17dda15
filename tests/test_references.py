"""What documents and strings name of the package is there."""

from __future__ import annotations

import re
from functools import cache
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path

import swgjoint

ROOT = Path(__file__).parents[1]
NAME = re.compile(r"(?<![\w/@'-])swgjoint(?:\.[A-Za-z_]\w*)+")
NO_MODULES = {"drive", "toml", "swg", "nothing", "no_such_name", "envs"}
"""Plugin, files, names that tests make up, and an environment's optional part."""
FILES = [
    *(ROOT / "README.md", *sorted((ROOT / "swgjoint").rglob("*.py"))),
    *sorted((ROOT / "notebooks").rglob("*.md")),
    *sorted((ROOT / "tests").rglob("*.py")),
    *sorted((ROOT / "notebooks").rglob("*.py")),
]


@cache
def exists(name: str) -> bool:
    """Whether a dotted name is a module, or something in one."""
    words = name.split(".")
    for k in range(len(words), 0, -1):
        try:
            if find_spec(".".join(words[:k])) is None:
                continue
        except ModuleNotFoundError:
            continue
        except ImportError:  # the parent package is optional
            return True
        try:
            found = import_module(".".join(words[:k]))
        except ImportError:  # of an optional package
            return True
        for attribute in words[k:]:
            if not hasattr(found, attribute):
                # fields of data classes that have no default
                return attribute in getattr(found, "__annotations__", {})
            found = getattr(found, attribute)
        return True
    return False


def test_names_of_the_package_exist():
    """Modules, functions and classes that a text refers to by their dotted name."""
    gone = {}
    for path in FILES:
        names = set(NAME.findall(path.read_text(encoding="utf-8")))
        names = {n.rstrip(".") for n in names if n.split(".")[1] not in NO_MODULES}
        names = {n.removesuffix(".py") for n in names}
        if missing := [name for name in sorted(names) if not exists(name)]:
            gone[path.relative_to(ROOT).as_posix()] = missing
    assert gone == {}


def test_the_check_finds_what_is_not_there():
    """A module, a function and a method that do not exist."""
    assert exists("swgjoint.maps.drive_map.DriveMap.load") and swgjoint.__all__
    for name in ("no_part", "maps.drive_map.none", "sim.no.x"):
        assert not exists(f"swgjoint.{name}")
