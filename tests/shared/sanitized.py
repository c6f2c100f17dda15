"""C++ compiled with sanitizers, every source once in a run of the tests."""

from __future__ import annotations

import os
import subprocess
from collections.abc import Sequence
from pathlib import Path

from solved import kept

CXX = os.environ.get("CXX", "g++")
SANITIZERS = "-fsanitize=address,undefined -fno-sanitize-recover=all".split()
SANITIZERS += ["-D_GLIBCXX_ASSERTIONS"]


def run_compiler(*arguments: str | Path) -> str:
    """Standard output of the compiler."""
    command = [CXX, *map(str, arguments)]
    done = subprocess.run(command, check=True, capture_output=True, text=True)
    return done.stdout.strip()


def compiled(source: Path, options: Sequence[str], headers: str) -> Path:
    """The object file of a source, beside it.

    Args:
        source: The source.
        options: Options of the compiler, sanitizers included.
        headers: Text of all own headers that the source may include.
    """
    out = source.with_suffix(".o")

    def compile_source() -> bytes:
        run_compiler(*options, "-c", source, "-o", out)
        return out.read_bytes()

    # the sources lie in a folder of the test
    stated = [option for option in options if not option.startswith("-I")]
    key = f"sanitized {CXX} {stated} {source.name} {source.read_text()} {headers}"
    out.write_bytes(kept(key, compile_source))
    return out
