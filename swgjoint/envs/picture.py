"""Off-screen pictures of a simulation."""

from __future__ import annotations

import importlib
import os
import sys
from typing import Any

import mujoco
import numpy as np
from numpy.typing import NDArray

from swgjoint.errors import ComputationError

SIZE = (480, 640)
"""Height and width [px], which are MuJoCo's default for off-screen buffers."""


class Picture:
    """Renderer of one model with MuJoCo's free camera.

    The environment variable ``MUJOCO_GL`` selects the OpenGL context, as elsewhere in
    MuJoCo. If it is not set, EGL is used on Linux, which needs no display.
    """

    def __init__(self, model: mujoco.MjModel) -> None:
        """Open an OpenGL context.

        Raises:
            ComputationError: If no OpenGL context is available.
        """
        height, width = SIZE
        self._model = model
        self._context = _context(height, width)
        self._scene = mujoco.MjvScene(model, maxgeom=1000)
        self._camera, self._option = mujoco.MjvCamera(), mujoco.MjvOption()
        mujoco.mjv_defaultFreeCamera(model, self._camera)
        self._drawing = mujoco.MjrContext(model, mujoco.mjtFontScale.mjFONTSCALE_100)
        off_screen = mujoco.mjtFramebuffer.mjFB_OFFSCREEN.value
        mujoco.mjr_setBuffer(off_screen, self._drawing)

    def draw(self, data: mujoco.MjData) -> NDArray[np.uint8]:
        """Draw one picture of a state. Shape (height, width, 3)."""
        mujoco.mj_kinematics(self._model, data)
        mujoco.mj_comPos(self._model, data)
        mujoco.mj_camlight(self._model, data)
        mujoco.mjv_updateScene(
            self._model,
            data,
            self._option,
            None,
            self._camera,
            mujoco.mjtCatBit.mjCAT_ALL.value,
            self._scene,
        )
        self._context.make_current()
        height, width = SIZE
        frame = mujoco.MjrRect(0, 0, width, height)
        pixels = np.zeros((height, width, 3), dtype=np.uint8)
        mujoco.mjr_render(frame, self._scene, self._drawing)
        mujoco.mjr_readPixels(pixels, None, frame, self._drawing)
        return np.ascontiguousarray(pixels[::-1])

    def close(self) -> None:
        """Release the OpenGL context."""
        self._context.make_current()
        self._drawing.free()
        self._context.free()


def _context(height: int, width: int) -> Any:
    """Current OpenGL context for off-screen rendering."""
    usual = {"linux": "egl", "darwin": "cgl"}.get(sys.platform, "glfw")
    kind = os.environ.get("MUJOCO_GL", "").lower().strip() or usual
    try:
        context = importlib.import_module(f"mujoco.{kind}").GLContext(width, height)
        context.make_current()
    except Exception as error:
        line = " ".join(str(error).split())
        raise ComputationError(
            f"render_mode 'rgb_array': no off-screen OpenGL with MUJOCO_GL={kind}"
            f" ({line[:120]}); install EGL (libegl1 and a driver, or libgl1-mesa-dri)"
            " or OSMesa (libosmesa6, MUJOCO_GL=osmesa)"
        ) from error
    return context
