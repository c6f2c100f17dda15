"""``swgjoint doctor``: check that the installation is complete."""

from __future__ import annotations

import argparse
import os
import platform
from collections.abc import Callable
from importlib import metadata
from importlib.util import find_spec
from pathlib import Path
from typing import Any

from swgjoint.cli.shared.text import table
from swgjoint.errors import SwgError

EXTRAS = {
    "control": ("pinocchio", "casadi"),
    "envs": ("gymnasium",),
    "life": ("rainflow",),
    "fmu": ("fmpy",),
    "report": ("pyvista",),
    "notebooks": ("jupytext", "ipykernel"),
    "cluster": ("dask", "distributed", "dask_jobqueue"),
    "tune": ("cma", "optuna"),
    "mkl": ("pypardiso",),
    "studio": ("nicegui",),
}
"""Modules that each optional extra needs, by name of the extra."""


def configure(parser: argparse.ArgumentParser) -> None:
    """Add nothing: the command has no options of its own."""


def run(args: argparse.Namespace) -> dict[str, Any]:
    """Check the installation.

    Returns:
        ``ok`` (whether all required parts are present) and ``checks``, a list of
        objects with ``name``, ``ok``, ``required`` and ``detail``.
    """
    checks = [
        _check("python", platform.python_version),
        *[_check(name, _version(name)) for name in required_packages()],
        _check("engine plugin", _plugin),
        _check("compiled loops", _kernels, required=False),
        _check("bundled models", _models),
        _check("cache", _cache),
        *[
            _check(f"extra {name}", _extra(name, modules), required=False)
            for name, modules in EXTRAS.items()
        ],
    ]
    ok = all(check["ok"] for check in checks if check["required"])
    return {"ok": ok, "checks": checks}


def report(result: dict[str, Any]) -> str:
    """Format the checks as a table, then the verdict."""
    rows = [
        (c["name"], "ok" if c["ok"] else "MISSING" if c["required"] else "absent")
        for c in result["checks"]
    ]
    lines = table(rows).splitlines()
    width = max(map(len, lines))
    body = [
        f"{line:{width}}  {check['detail']}"
        for line, check in zip(lines, result["checks"], strict=True)
    ]
    verdict = (
        "all required parts are installed"
        if result["ok"]
        else "not usable: required parts are missing"
    )
    return "\n".join([*body, verdict])


def status(result: dict[str, Any]) -> int:
    """Return 1 if a required part is missing, else 0."""
    return 0 if result["ok"] else 1


def _check(
    name: str, probe: Callable[[], str], *, required: bool = True
) -> dict[str, Any]:
    try:
        ok, detail = True, probe()
    except SwgError as exc:
        ok, detail = False, str(exc)
    return {"name": name, "ok": ok, "required": required, "detail": detail}


def required_packages() -> list[str]:
    """Distribution names of swgjoint and of its required dependencies."""
    names = ["swgjoint"]
    try:
        requirements = metadata.requires("swgjoint") or []
    except metadata.PackageNotFoundError:
        requirements = []
    for requirement in requirements:
        text, _, marker = requirement.partition(";")
        if "extra" not in marker:
            end = next((k for k, c in enumerate(text) if c in "<>=!~[ ("), len(text))
            names.append(text[:end].strip())
    return names


def _version(name: str) -> Callable[[], str]:
    def probe() -> str:
        try:
            return metadata.version(name)
        except metadata.PackageNotFoundError:
            raise SwgError(f"not installed: pip install {name}") from None

    return probe


def _plugin() -> str:
    # mujoco may be missing or damaged: report it and continue with the other checks
    try:
        from swgjoint.joint import plugin
    except ImportError as exc:
        raise SwgError(f"cannot be imported: {exc}") from None
    plugin.load()
    return (
        f"{plugin.NAME} for MuJoCo {plugin.MUJOCO_VERSION} loaded from"
        f" {plugin.library()}"
    )


def _kernels() -> str:
    from swgjoint.kernels import kernels

    native = kernels()
    if native is None:
        raise SwgError("finite elements run in numpy, which is slower")
    return f"finite elements run in {native.__file__}"


def _models() -> str:
    from swgjoint.models_path import bundled_names, models_path

    designs = bundled_names("drives", ".toml")
    return f"{len(designs)} designs in {models_path()}"


def _cache() -> str:
    from swgjoint.store import cache_folder

    folder = cache_folder()
    if folder is None:
        return "disabled (SWGJOINT_CACHE is empty)"
    existing = Path(folder)
    while not existing.exists() and existing != existing.parent:
        existing = existing.parent
    if not existing.is_dir() or not os.access(existing, os.W_OK):
        raise SwgError(
            f"{folder} is not writable; set SWGJOINT_CACHE to another folder"
        )
    return str(folder)


def _extra(name: str, modules: tuple[str, ...]) -> Callable[[], str]:
    def probe() -> str:
        missing = [module for module in modules if find_spec(module) is None]
        if missing:
            raise SwgError(
                f"not installed: {', '.join(missing)}; pip install 'swgjoint[{name}]'"
            )
        return ", ".join(modules)

    return probe
