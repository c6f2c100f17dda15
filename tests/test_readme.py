"""The README is short, with its two commands and the figures that commands compute."""

from __future__ import annotations

import json
import re
import shlex
import tomllib
from pathlib import Path
from typing import Any

import pytest
from golden import FROZEN

ROOT = Path(__file__).parents[1]
README = (ROOT / "README.md").read_text(encoding="utf-8")
NUMBER = re.compile(r"(?<![\w./-])\d[\d,]*(?:\.\d+)?(?![\w/]|\.\d)")


def blocks(language: str) -> list[str]:
    return re.findall(rf"^```{language}\n(.*?)^```", README, re.DOTALL | re.MULTILINE)


def section(heading: str) -> str:
    return README.partition(f"\n## {heading}\n")[2].partition("\n## ")[0]


def test_the_two_commands():
    """Install and demo, install and test: verbatim, each in a line of its own.

    An environment comes first, because pip refuses to change the system's (PEP 668).
    """
    lines = [line for block in blocks("sh") for line in block.splitlines()]
    assert lines[0] == "python3 -m venv .venv && . .venv/bin/activate"
    assert lines[1] == "python3 -m pip install . && swgjoint demo"
    assert "python3 -m pip install '.[test]' && pytest -n 2" in lines


def test_it_is_short():
    """A first screen and not a record: details are in the guide."""
    assert README.count("\n") <= 200
    (example,) = blocks("python")
    assert len([line for line in example.splitlines() if line]) == 10
    assert len(re.findall(r"^!\[", section("Four questions"), re.MULTILINE)) == 4


def paragraphs() -> list[str]:
    """Questions and rows that state figures."""
    texts = re.split(r"\n\n(?=\*\*)", section("Four questions"))
    texts[-1] = texts[-1].partition("\nMore questions")[0]
    table = section("How true it is").splitlines()
    return [*texts, *(row for row in table if row.startswith("| ") and "](" in row)]


def numbers(text: str) -> list[str]:
    """Numbers of a text, without those of its links and commands."""
    return NUMBER.findall(re.sub(r"\]\([^)]*\)|`[^`]*`", " ", text))


def commands(text: str) -> list[list[str]]:
    """Arguments of the commands of a text."""
    lines = re.findall(r"^swgjoint .*|`swgjoint [^`]*`", text, re.MULTILINE)
    return [shlex.split(line.strip("`"))[1:] for line in lines]


def plain(command: list[str]) -> str:
    """A command without the options that leave its results as they are."""
    return re.sub(r" --(out|jobs) \w+| --report", "", shlex.join(command))


def results(text: str) -> list[dict[str, Any]]:
    """Results of the commands of a text, as ``tests/golden/golden.py`` stores them."""
    stored = [json.loads(path.read_text()) for path in sorted(FROZEN.glob("*.json"))]
    found = {plain(one["command"]): one["result"] for one in stored if "command" in one}
    return [found[plain(command)] for command in commands(text)]


def meshing(result):
    return [f"{result['steps']}", f"{result['nodes']:,}"]


def tracking(result):
    """Figures of the first three controllers."""
    rows = [row for row in result["rows"] if row["quantity"] == "tracking_rms"]
    return [f"{row['ours']:.2f}" for row in rows[:3]]


def gauges(result):
    """Errors with one and three exact bridges, and with the bridges of the scene."""
    found = result["joints"]["joint"]["gauges"]
    left = {one["bridges"]: one["ripple_rms_percent"] for one in found["compensation"]}
    return [f"{left[1]:.0f}", f"{left[3]:.2f}", f"{found['error_rms_percent']:.2f}"]


def calculix(state):
    """Finest results with CalculiX, as ``tests/peer/study.py`` writes them."""
    text = (ROOT / "notebooks" / "calculix.json").read_text(encoding="utf-8")
    finest = ("ours_refinement", 12), ("calculix_refinement", 2)
    rows = [row for row in json.loads(text)["rows"] if row["state"].startswith(state)]
    return [row for row in rows if all(row.get(key) == n for key, n in finest)]


def bore():
    return [f"{max(row['radial_max_um'] for row in calculix('')):.2f}"]


def root():
    row = calculix("elliptical, 20 N·m, 0 pitch")[-1]
    return ["20", f"{row['root_ours_MPa']:.1f}", f"{row['root_calculix_MPa']:.1f}"]


def thesis(result):
    tenth, nominal = result["shares"]["tenth"], result["shares"]["nominal"]
    within = f"{result['within_percent']:.0f}"
    shares = [[f"{one['within']}", f"{one['printed']}"] for one in (tenth, nominal)]
    return ["5.6", *shares[0], within, *shares[1]]


def stiffness(ours, catalogue):
    keys = [f"K{i}_Nm_rad" for i in (1, 2, 3)]
    return [f"{ours[key] / catalogue['stated'][key]:.2f}" for key in keys]


def cup(result):
    """Our stiffness, and the printed one in the file of the study of articles."""
    path = ROOT / "models" / "studies" / "articles.toml"
    rows = tomllib.loads(path.read_text(encoding="utf-8"))["force"]["rows"]
    (row,) = (row for row in rows if row["quantity"].startswith("theory"))
    ours = f"{result['radial_stiffness_N_mm']:.1f}"
    return [ours, f"{row['source_value']:.0f}"]


def back_driving(result):
    ours, stated = (one["back_driving_torque_Nm"] for one in (result, result["stated"]))
    return [f"{ours:.2f}", f"{stated:.2f}"]


def resonance(result):
    """Largest difference of level `linear` from the closed form."""
    rows = [row for row in result["rows"] if row["case"] == "CSG-25-100, linear"]
    off = [abs(row["ours"] / row["source_value"] - 1.0) for row in rows]
    return [f"{100.0 * max(off):.2f}"]


FIGURES = {
    "**Where are the stresses": meshing,
    "**What does the wave": lambda: [],
    "**Which controller": tracking,
    "**What do strain gauges": gauges,
    "| shape of the bore": bore,
    "| stress in the root": root,
    "| stresses with four": thesis,
    "| K1, K2, K3 of the bundled design `size-25-50`": stiffness,
    "| K1, K2, K3 of the bundled design `size-25-100`": stiffness,
    "| radial stiffness": cup,
    "| back-driving torque": back_driving,
    "| resonance": resonance,
}
"""Beginnings of the texts, and the figures of the results of their commands."""


def test_every_text_with_figures_is_compared():
    """No question and no row is left out."""
    begun = [text.strip() for text in paragraphs()]
    assert len(begun) == len(FIGURES)
    assert all(a.startswith(b) for a, b in zip(begun, FIGURES, strict=True))


@pytest.mark.parametrize("begin", FIGURES)
def test_figures_are_those_of_the_command(begin):
    """Every number is that of the stored result of the command beside it."""
    (text,) = (text for text in paragraphs() if text.strip().startswith(begin))
    stated = numbers(text.partition("\n```")[0])
    assert stated == FIGURES[begin](*(results(text) if stated else ()))


def test_a_wrong_figure_is_noticed():
    """A number that no command printed, and a command whose result is not stored."""
    (row,) = (text for text in paragraphs() if text.startswith("| back-driving"))
    assert numbers(row.replace("7.83", "7.84")) != back_driving(*results(row))
    with pytest.raises(KeyError):
        results(row.replace("CSG-25-100 --only", "CSG-25-50 --only"))


def test_other_numbers():
    """Outside of them there are versions of Python and the year of a source."""
    text = re.sub(r"^```.*?^```", "", README, flags=re.DOTALL | re.MULTILINE)
    for one in paragraphs():
        text = text.replace(one.partition("\n```")[0], "")
    assert numbers(text) == ["3.11", "3.13", "2021"]
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
    assert project["project"]["requires-python"] == ">=3.11,<3.14"
