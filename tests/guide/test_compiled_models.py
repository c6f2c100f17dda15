"""The page on models in C, C++ and worker processes: its programs run and agree."""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

PAGE = Path(__file__).parents[2] / "notebooks/guide/how-to/compiled-models.md"


def blocks(language):
    """Blocks of the page in a language."""
    text = PAGE.read_text(encoding="utf-8")
    return re.findall(rf"^```{language}\n(.*?)^```", text, re.DOTALL | re.MULTILINE)


def run(command, folder):
    """Output of a command in a folder, with this Python first on the path."""
    first = str(Path(sys.executable).parent)
    environment = os.environ | {"PATH": os.pathsep.join([first, os.environ["PATH"]])}
    environment["PYTHONPATH"] = os.pathsep.join(path for path in sys.path if path)
    ended = subprocess.run(
        command, cwd=folder, env=environment, capture_output=True, text=True
    )
    assert ended.returncode == 0, ended.stderr
    return ended.stdout


@pytest.mark.skipif(sys.platform != "linux", reason="the commands are those of Linux")
@pytest.mark.skipif(
    not (shutil.which("gcc") and shutil.which("g++")), reason="needs gcc and g++"
)
def test_all_programs_print_the_same_angle(tmp_path):
    """In C, C++ and two spawned processes; the arm falls, but not freely."""
    save, work = blocks("python")
    (tmp_path / "save.py").write_text(save, encoding="utf-8")
    (tmp_path / "work.py").write_text(work, encoding="utf-8")
    (tmp_path / "swing.c").write_text(*blocks("c"), encoding="utf-8")
    run([sys.executable, "save.py"], tmp_path)
    compiled = run(["sh", "-e", "-c", *blocks("sh")], tmp_path).splitlines()
    spawned = run([sys.executable, "work.py"], tmp_path).splitlines()
    assert len(compiled) == len(spawned) == 2
    assert len({*compiled, *spawned}) == 1
    angle = float(compiled[0].removesuffix(" rad"))
    # free fall would be 0.5 * 1.5 g / 0.5 m * t^2 = 3.7 rad at first order
    assert 0.01 < angle < 3.0
