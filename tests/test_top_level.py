"""The package as its user imports it."""

from __future__ import annotations

import json
import subprocess
import sys

import pytest

import swgjoint


def fresh(program: str) -> str:
    done = subprocess.run(
        [sys.executable, "-P", "-c", program], capture_output=True, text=True
    )
    assert done.returncode == 0, done.stderr
    return done.stdout


def test_the_top_level_shows_its_public_names_alone():
    """``dir`` and ``__all__`` agree, and every name is there."""
    program = "import json, swgjoint; print(json.dumps(dir(swgjoint)))"
    assert json.loads(fresh(program)) == sorted(swgjoint.__all__)
    assert {"attach", "load_plugin", "DriveMap"} <= set(swgjoint.__all__)
    for name in swgjoint.__all__:
        assert getattr(swgjoint, name) is not None
    for name in ("Any", "annotations", "import_module", "sys"):
        assert not hasattr(swgjoint, name)


def test_importing_is_cheap():
    """Neither the engine nor numpy comes with it, whichever module registers."""
    program = """
import sys, swgjoint, swgjoint.engine
assert not swgjoint.engine.register()
heavy = ("mujoco", "numpy", "scipy", "pydantic", "gymnasium")
print([m for m in heavy if m in sys.modules])
"""
    assert fresh(program).strip() == "[]"


def test_the_engine_knows_the_drives_when_both_are_imported():
    """In either order, and where swgjoint is installed and mujoco alone imported."""
    for imports in ("mujoco, swgjoint", "swgjoint, mujoco", "mujoco"):
        fresh(
            f"import {imports}\nmujoco.MjSpec().activate_plugin('swgjoint.drive')\n"
            "assert 'numpy' in __import__('sys').modules"
        )


@pytest.mark.parametrize(
    ("imports", "module"),
    [
        ("gymnasium", "swgjoint:"),
        ("gymnasium", "swgjoint.envs:"),
        ("gymnasium, swgjoint", ""),
        ("swgjoint, gymnasium", "swgjoint.envs:"),
    ],
)
def test_gymnasium_finds_the_environments(imports, module):
    """Without an import by the user; what it costs is little beside gymnasium."""
    pytest.importorskip("gymnasium")
    fresh(
        f"import {imports}, sys\n"
        "assert not {'mujoco', 'scipy'} & set(sys.modules)\n"
        f"env = gymnasium.make('{module}swgjoint/JointTracking-v0')\n"
        "assert env.unwrapped.core is not None"
    )


def test_another_engine_is_left_alone():
    """With another version nothing is loaded and nothing is said on import."""
    fresh(
        """
import sys, types
fake = types.ModuleType("mujoco")
fake.mj_versionString = lambda: "3.3.0"
fake.mj_loadPluginLibrary = lambda path: sys.exit("loaded")
sys.modules["mujoco"] = fake
import swgjoint
from swgjoint.engine import register
assert not register()
"""
    )
