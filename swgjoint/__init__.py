"""swgjoint: a strain wave gear from tooth geometry to robot behaviour."""

import sys as _sys
import typing as _typing

__version__ = "0.2.0"

# name -> module; modules are imported on first use to keep the package import fast
_PUBLIC = {
    "ComputationError": "swgjoint.errors",
    "Design": "swgjoint.gear.design.design",
    "DesignError": "swgjoint.errors",
    "DriveMap": "swgjoint.maps.drive_map",
    "InputError": "swgjoint.errors",
    "JointDrive": "swgjoint.joint.drive",
    "LinearScene": "swgjoint.sim.linearisation",
    "MeshingRun": "swgjoint.fe.meshing_run",
    "Ratings": "swgjoint.gear.ratings",
    "Scene": "swgjoint.sim.scene.scene",
    "SceneRun": "swgjoint.view.run",
    "SolidRun": "swgjoint.fe.solid.meshing",
    "SwgError": "swgjoint.errors",
    "attach": "swgjoint.drives.attach",
    "build_map": "swgjoint.drives.build_map",
    "export_fmu": "swgjoint.drives.export_fmu",
    "export_mjcf": "swgjoint.sim.plain_mjcf",
    "linearise": "swgjoint.sim.linearisation",
    "load_controller": "swgjoint.explore.tune.controller",
    "load_drive": "swgjoint.drives.references",
    "load_plugin": "swgjoint.joint.plugin",
    "run_scene": "swgjoint.view.run",
    "simulate_meshing": "swgjoint.fe.meshing",
    "spec_sheet": "swgjoint.drives.spec_sheet",
}
__all__ = ["__version__", *sorted(_PUBLIC)]

if _typing.TYPE_CHECKING:
    # for type checkers, which do not evaluate __getattr__
    from swgjoint.drives.attach import attach as attach
    from swgjoint.drives.build_map import build_map as build_map
    from swgjoint.drives.export_fmu import export_fmu as export_fmu
    from swgjoint.drives.references import load_drive as load_drive
    from swgjoint.drives.spec_sheet import spec_sheet as spec_sheet
    from swgjoint.errors import ComputationError as ComputationError
    from swgjoint.errors import DesignError as DesignError
    from swgjoint.errors import InputError as InputError
    from swgjoint.errors import SwgError as SwgError
    from swgjoint.explore.tune.controller import load_controller as load_controller
    from swgjoint.fe.meshing import simulate_meshing as simulate_meshing
    from swgjoint.fe.meshing_run import MeshingRun as MeshingRun
    from swgjoint.fe.solid.meshing import SolidRun as SolidRun
    from swgjoint.gear.design.design import Design as Design
    from swgjoint.gear.ratings import Ratings as Ratings
    from swgjoint.joint.drive import JointDrive as JointDrive
    from swgjoint.joint.plugin import load_plugin as load_plugin
    from swgjoint.maps.drive_map import DriveMap as DriveMap
    from swgjoint.sim.linearisation import LinearScene as LinearScene
    from swgjoint.sim.linearisation import linearise as linearise
    from swgjoint.sim.plain_mjcf import export_mjcf as export_mjcf
    from swgjoint.sim.scene.scene import Scene as Scene
    from swgjoint.view.run import SceneRun as SceneRun
    from swgjoint.view.run import run_scene as run_scene
else:

    def __getattr__(name: str) -> _typing.Any:
        if name in _PUBLIC:
            from importlib import import_module

            return getattr(import_module(_PUBLIC[name]), name)
        raise AttributeError(f"module 'swgjoint' has no attribute {name!r}")


def __dir__() -> list[str]:
    return sorted(__all__)


if _sys.modules.get("mujoco") is not None:
    # MuJoCo was imported before: register now, so that saved models with drives load
    from swgjoint.engine import register as _register

    _register()

if _sys.modules.get("gymnasium") is not None:
    # gymnasium was imported before, or imports this package for an environment
    from swgjoint.environments import register_environments as _register_environments

    _register_environments()
