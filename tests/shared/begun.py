"""Note in a file every unit of work that a command and its processes begin.

A process of a pool imports this module by its name, so that its folder has to be on
``PYTHONPATH``.
"""

from __future__ import annotations

import functools
import importlib
import os
from typing import Any

from swgjoint import pool

UNIT, FILE = "BEGUN_UNIT", "BEGUN_FILE"
"""Variables of the environment: the function of a unit, and where it is noted.

The function is ``module:name`` or ``module:class.name``. A call begins a unit; one of
a ``read`` does if nothing is there to be read.
"""

_in_pool = pool._numbered


@functools.cache
def watch() -> None:
    """Note the units of this process, and of those that it starts."""
    pool._numbered = numbered
    module, _, path = os.environ[UNIT].partition(":")
    *classes, name = path.split(".")
    owner: Any = importlib.import_module(module)
    for one in classes:
        owner = getattr(owner, one)
    plain = getattr(owner, name)

    @functools.wraps(plain)
    def noted(*args: Any, **options: Any) -> Any:
        if name != "read":
            _note()
        found = plain(*args, **options)
        if name == "read" and found is None:
            _note()
        return found

    setattr(owner, name, noted)


def numbered(*task: Any) -> Any:
    """A task of a pool, in one of its processes."""
    watch()
    return _in_pool(*task)


def _note() -> None:
    with open(os.environ[FILE], "a", encoding="utf-8") as file:
        file.write("begun\n")
