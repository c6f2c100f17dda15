"""Controllers of the user with named parameters, as a tuning run drives them."""

from __future__ import annotations

import inspect
import sys
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from importlib.util import module_from_spec, spec_from_file_location
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from swgjoint.envs.arguments import format_value, is_number
from swgjoint.errors import InputError
from swgjoint.explore.tune.tunable import Act, GainParameter, WithoutGains
from swgjoint.sim.controller import Controller, KnownJoints, KnownLoop, Measured, Task
from swgjoint.store import one_line
from swgjoint.typing import Array

_WANTED = "{'gain_Nm_rad': (low, high), ...} or (low, high, start), low < high"


@dataclass(frozen=True, kw_only=True, eq=False)
class OwnController(WithoutGains):
    """A class, or a function that returns a controller, with ``parameters``.

    ``make(**values)`` returns a :class:`~swgjoint.sim.controller.Controller` of one
    motion, as :func:`swgjoint.run_scene` takes it. Every episode has its own one.
    """

    name: str
    make: Callable[..., Controller]
    """Class or function."""
    bounds: tuple[GainParameter, ...]
    """Parameters, which are keyword arguments of ``make``."""
    content: str
    """Source text and bounds, as far as they are known."""
    needs: Mapping[str, Any] = field(default_factory=dict)
    untuned = "initial"

    @classmethod
    def from_object(cls, make: Any, name: str | None = None) -> OwnController:
        """Controller from a class or a function with the attribute ``parameters``.

        The attribute is a mapping from keys to (low, high) or (low, high, start). The
        start is by default the middle of the bounds, on a logarithmic scale if both are
        greater than zero.

        Args:
            make: Class or function.
            name: Name in results; None for that of the object.

        Raises:
            InputError: If the object is not such a class or function.
        """
        if not callable(make):
            raise InputError(
                f"controller {format_value(make)}; accepted: pd, pd-feedforward,"
                " pd-flexible, or a class or function with parameters"
            )
        own = getattr(make, "__qualname__", type(make).__name__)
        name = name or f"{own.rpartition('.')[2]}"
        stated = getattr(make, "parameters", None)
        if not isinstance(stated, Mapping) or not stated:
            raise InputError(
                f"controller {name!r}: parameters {format_value(stated)}; accepted:"
                f" {_WANTED}"
            )
        bounds = tuple(_parameter(name, key, value) for key, value in stated.items())
        try:
            content = inspect.getsource(make)
        except (OSError, TypeError):
            content = ""
        return cls(
            name=name, make=make, bounds=bounds, content=f"{content}{dict(stated)}"
        )

    @classmethod
    def from_file(cls, reference: str) -> OwnController:
        """Controller from ``FILE.py:NAME``, for which the file is run.

        Raises:
            InputError: If there is no such file or name, or if the file fails.
        """
        place, _, name = reference.rpartition(":")
        path = Path(place)
        if not path.is_file():
            raise InputError(
                f"controller {reference!r}: cannot read {path}; accepted: FILE.py:NAME"
            )
        spec = spec_from_file_location(f"swgjoint_own_{path.stem}", path)
        assert spec is not None and spec.loader is not None
        module = module_from_spec(spec)
        sys.modules[module.__name__] = module  # dataclasses look it up
        try:
            spec.loader.exec_module(module)
        except (Exception, SystemExit) as error:
            raise InputError(f"{path}: {_told(error)}") from error
        if not hasattr(module, name):
            known = [key for key, one in vars(module).items() if _is_own(one)]
            accepted = ", ".join(known) or "a class or function with parameters"
            raise InputError(f"{path}: no {name!r}; accepted: {accepted}")
        found = cls.from_object(getattr(module, name), f"{path.name}:{name}")
        return replace(found, content=path.read_text(encoding="utf-8"))

    def parameters(
        self, joints: KnownJoints, loop: KnownLoop | None
    ) -> tuple[GainParameter, ...]:
        """Parameters, which do not depend on the joints.

        Args:
            joints: Unused.
            loop: Unused.
        """
        return self.bounds

    def controller(self, values: Mapping[str, float]) -> Controller:
        """Controller with the given values.

        Raises:
            InputError: If it cannot be made or has no methods ``start`` and ``torque``.
        """
        try:
            made = self.make(**values)
        except (Exception, SystemExit) as error:
            raise self._fault(values, "", error) from error
        methods = (getattr(made, key, None) for key in ("start", "torque"))
        if not all(map(callable, methods)):
            raise InputError(
                f"controller {self.name!r}: {format_value(made)}; accepted: an object"
                " with the methods start(task) and torque(k, measured)"
            )
        return made

    def begin(
        self, values: Mapping[str, Array], task: Task, kept: dict[str, Any]
    ) -> Act:
        """Make and start a controller for every episode.

        Args:
            values: Values of the candidates by key. Shape (n_candidates,) each.
            task: Motions of all episodes.
            kept: Unused.

        Raises:
            InputError: If a controller fails.
        """
        episodes, joints = task.position.shape[1:]
        rows = zip(*(one.tolist() for one in values.values()), strict=True)
        each = [dict(zip(values, row, strict=True)) for row in rows]
        each = [one for one in each for _ in range(episodes // len(each))]
        controllers = [self.controller(one) for one in each]
        for k, (one, given) in enumerate(zip(controllers, each, strict=True)):
            try:
                one.start(task.select(k))
            except (Exception, SystemExit) as error:
                raise self._fault(given, "start", error) from error

        def act(instant: int, measured: Measured, alive: NDArray[np.bool_]) -> Array:
            torques = np.zeros((episodes, joints))
            for k in np.flatnonzero(alive).tolist():
                try:
                    torque = controllers[k].torque(instant, _of_one(measured, k))
                except (Exception, SystemExit) as error:
                    where = f"torque at instant {instant}"
                    raise self._fault(each[k], where, error) from error
                torques[k] = self._checked(torque, joints, instant, each[k])
            return torques

        return act

    def _checked(
        self, torque: Any, joints: int, instant: int, values: Mapping[str, float]
    ) -> Array:
        """Torques of one episode, if they are finite numbers of the right shape."""
        try:
            array = np.asarray(torque)
            # a text or a complex number would be cast without an error
            good = array.dtype.kind in "iuf" and array.shape == (joints,)
        except ValueError:
            good = False
        if good and np.isfinite(array).all():
            return array
        shape = getattr(torque, "shape", None)
        found = " ".join(format_value(torque).split())
        if shape not in (None, (joints,)):
            found = f"shape {shape}"
        raise InputError(
            f"{self._head(values)}: torque at instant {instant}: {found};"
            f" accepted: an array of shape ({joints},) of finite numbers [N·m]"
        )

    def _fault(
        self, values: Mapping[str, float], where: str, error: BaseException
    ) -> InputError:
        place = f": {where}" if where else ""
        return InputError(f"{self._head(values)}{place}: {_told(error)}")

    def _head(self, values: Mapping[str, float]) -> str:
        given = ", ".join(f"{key} = {value:.6g}" for key, value in values.items())
        return f"controller {self.name!r} with {given}"


def _parameter(name: str, key: Any, stated: Any) -> GainParameter:
    """Parameter from its stated bounds."""
    good = isinstance(stated, tuple | list) and len(stated) in (2, 3)
    good = good and isinstance(key, str) and all(map(is_number, stated))
    if good:
        low, high, *start = map(float, stated)
        good = low < high and all(low <= one <= high for one in start)
    if not good:
        raise InputError(
            f"controller {name!r}: parameter {format_value(key)}:"
            f" {format_value(stated)}; accepted: {_WANTED}"
        )
    one = GainParameter(key=key, low=low, high=high, neutral=low)
    middle = start[0] if start else float(one.value(np.array(0.5)))
    return GainParameter(key=key, low=low, high=high, neutral=middle)


def _of_one(measured: Measured, k: int) -> Measured:
    """Readings of one episode. Shapes (n_joints,)."""
    link, torque = measured.link_angle, measured.output_torque
    return Measured(
        motor_angle=measured.motor_angle[k],
        motor_speed=measured.motor_speed[k],
        link_angle=None if link is None else link[k],
        output_torque=None if torque is None else torque[k],
    )


def _is_own(thing: Any) -> bool:
    return callable(thing) and isinstance(getattr(thing, "parameters", None), Mapping)


def _told(error: BaseException) -> str:
    return f"{type(error).__name__}: {one_line(error)}"
