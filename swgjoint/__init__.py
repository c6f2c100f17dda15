"""swgjoint: a strain wave gear from tooth geometry to robot behaviour."""

from __future__ import annotations

from importlib import import_module
from typing import Any

__version__ = "0.1.0"

# name -> module; imported on first use, so that importing the package stays cheap
_PUBLIC = {
    "Design": "swgjoint.gear.design",
    "DriveMap": "swgjoint.maps.drive_map",
    "SwgError": "swgjoint.errors",
    "attach": "swgjoint.joint.attach",
    "build_map": "swgjoint.fe.build_map",
    "run_scene": "swgjoint.sim.run",
    "simulate_meshing": "swgjoint.fe.meshing",
}
__all__ = ["__version__", *sorted(_PUBLIC)]


def __getattr__(name: str) -> Any:
    if name in _PUBLIC:
        return getattr(import_module(_PUBLIC[name]), name)
    raise AttributeError(f"module 'swgjoint' has no attribute {name!r}")


def __dir__() -> list[str]:
    return sorted([*globals(), *_PUBLIC])
