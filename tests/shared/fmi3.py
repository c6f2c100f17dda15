"""An FMU of FMI 3.0 through its C functions, with nothing but the standard library."""

from __future__ import annotations

import ctypes
import tempfile
import xml.etree.ElementTree as ElementTree
import zipfile
from collections.abc import Iterable
from pathlib import Path

from numpy import frombuffer

LOG = ctypes.CFUNCTYPE(
    None, ctypes.c_void_p, ctypes.c_int, ctypes.c_char_p, ctypes.c_char_p
)
UINT, DOUBLE, FLAG = ctypes.c_uint32, ctypes.c_double, ctypes.c_bool


class Fmu:
    """One instance; variables are read and written by name."""

    def __init__(self, path: Path, *, by_steps: bool, token: str = ""):
        # a folder of its own, because a loaded library must not be overwritten
        folder = Path(tempfile.mkdtemp(dir=path.parent))
        with zipfile.ZipFile(path) as archive:
            archive.extractall(folder)
        self.root = ElementTree.parse(folder / "modelDescription.xml").getroot()
        self.said: list[str] = []
        self._log = LOG(lambda _, __, ___, text: self.said.append(text.decode()))
        (library,) = (folder / "binaries").glob("*/*")
        self._library = ctypes.CDLL(str(library))
        self.references = {
            one.get("name"): int(one.get("valueReference"))
            for one in self.root.find("ModelVariables")
        }
        token = token or self.root.get("instantiationToken")
        kind = "CoSimulation" if by_steps else "ModelExchange"
        make = getattr(self._library, f"fmi3Instantiate{kind}")
        make.restype = ctypes.c_void_p
        text = [b"one", token.encode(), f"{folder / 'resources'}/".encode()]
        more = [FLAG(False), FLAG(False), None, ctypes.c_size_t(0)] if by_steps else []
        last = [None, self._log, None] if by_steps else [None, self._log]
        self.instance = make(*text, FLAG(False), FLAG(True), *more, *last)

    def call(self, name: str, *arguments: object) -> bool:
        """Whether a function succeeds."""
        function = getattr(self._library, f"fmi3{name}")
        return function(ctypes.c_void_p(self.instance), *arguments) == 0

    def start(self, **values: float) -> bool:
        """Set start values, dots in names as two underscores, and initialise."""
        done = self.call(
            "EnterInitializationMode",
            *(FLAG(False), DOUBLE(0), DOUBLE(0), FLAG(False), DOUBLE(0)),
        )
        done &= self.set(**values)
        return done and self.call("ExitInitializationMode")

    def set(self, **values: float) -> bool:
        """Set variables; dots in their names are two underscores."""
        names = [name.replace("__", ".") for name in values]
        return self.put(dict(zip(names, values.values(), strict=True)))

    def put(self, values: dict[str, float]) -> bool:
        """Set variables by their names."""
        n = len(values)
        references = (UINT * n)(*(self.references[name] for name in values))
        size = ctypes.c_size_t(n)
        numbers = (DOUBLE * n)(*values.values())
        return self.call("SetFloat64", references, size, numbers, size)

    def get(self, *names: str) -> list[float]:
        """Values of variables."""
        n = len(names)
        references = (UINT * n)(*(self.references[name] for name in names))
        numbers, size = (DOUBLE * n)(), ctypes.c_size_t(n)
        assert self.call("GetFloat64", references, size, numbers, size), self.said
        return list(numbers)

    def step(self, time: float, size: float) -> bool:
        """A communication step."""
        flags = [ctypes.byref(FLAG()) for _ in range(3)]
        last = ctypes.byref(DOUBLE())
        return self.call("DoStep", DOUBLE(time), DOUBLE(size), FLAG(True), *flags, last)

    def rates(self, states: Iterable[float]) -> list[float]:
        """Derivatives of the continuous states at given states."""
        values, four = (DOUBLE * 4)(*states), ctypes.c_size_t(4)
        assert self.call("SetContinuousStates", values, four)
        out = (DOUBLE * 4)()
        assert self.call("GetContinuousStateDerivatives", out, four)
        return frombuffer(out).tolist()

    def complete(self) -> None:
        """End an integrator step at the states that were set last."""
        flags = [ctypes.byref(FLAG()) for _ in range(2)]
        assert self.call("CompletedIntegratorStep", FLAG(True), *flags)
