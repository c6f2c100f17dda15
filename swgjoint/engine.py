"""Location of the MuJoCo plugin library and its registration.

This module imports only the standard library, because it adds to every import of
MuJoCo.

The package's entry point in the group ``mujoco.plugins`` is :func:`register`: MuJoCo's
Python package calls it at the end of its own import, so that saved models with drives
load wherever swgjoint is installed, including in ``python -m mujoco.viewer``.
"""

import sys
from pathlib import Path

NAME = "swgjoint.drive"
"""Name of the engine plugin."""
MUJOCO_VERSION = "4.0.0"
"""MuJoCo version whose libmujoco the plugin is linked to (soname, struct layout)."""


def library() -> Path:
    """Path of the plugin library in the installed package."""
    return Path(__file__).parent / "plugin" / "libswgjoint_plugin.so"


def register() -> bool:
    """Register the plugin if MuJoCo is imported and has the required version.

    A failure raises no exception here; ``swgjoint.load_plugin`` and ``swgjoint doctor``
    report what is missing.

    Returns:
        Whether the plugin is registered.
    """
    mujoco = sys.modules.get("mujoco")
    # this runs while mujoco is still being imported
    load = getattr(mujoco, "mj_loadPluginLibrary", None)
    if mujoco is None or load is None or not library().exists():
        return False
    if mujoco.mj_versionString() != MUJOCO_VERSION:
        return False
    try:
        load(str(library()))
    except Exception:
        return False
    return True
