"""swgjoint: a strain wave gear from tooth geometry to robot behaviour."""

import sys as _sys
import typing as _typing

__version__ = "0.1.0"

# name -> module; imported on first use, so that importing the package stays cheap
_PUBLIC = {
    "Design": "swgjoint.gear.design.design",
    "DriveMap": "swgjoint.maps.drive_map",
    "SwgError": "swgjoint.errors",
    "attach": "swgjoint.drives.attach",
    "build_map": "swgjoint.drives.build_map",
    "load_plugin": "swgjoint.joint.plugin",
    "run_scene": "swgjoint.view.run",
    "simulate_meshing": "swgjoint.fe.meshing",
    "spec_sheet": "swgjoint.drives.spec_sheet",
}
__all__ = ["__version__", *sorted(_PUBLIC)]


def __getattr__(name: str) -> _typing.Any:
    if name in _PUBLIC:
        from importlib import import_module

        return getattr(import_module(_PUBLIC[name]), name)
    raise AttributeError(f"module 'swgjoint' has no attribute {name!r}")


def __dir__() -> list[str]:
    return sorted(__all__)


if _sys.modules.get("mujoco") is not None:
    # MuJoCo was imported first: models that were saved with drives load from here on
    from swgjoint.engine import register as _register

    _register()
