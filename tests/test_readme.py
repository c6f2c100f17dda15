"""The README is short, with its two commands and the figures of the guide."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from swgjoint.cli.main import main

ROOT = Path(__file__).parents[1]
README = (ROOT / "README.md").read_text(encoding="utf-8")
NUMBER = re.compile(r"(?<![\w./-])\d[\d,]*(?:\.\d+)?(?![\w/]|\.\d)")


def blocks(language: str) -> list[str]:
    return re.findall(rf"^```{language}\n(.*?)^```", README, re.DOTALL | re.MULTILINE)


def section(heading: str) -> str:
    return README.partition(f"\n## {heading}\n")[2].partition("\n## ")[0]


def test_the_two_commands():
    """Install and demo, install and test: verbatim, each in a line of its own."""
    lines = [line for block in blocks("sh") for line in block.splitlines()]
    assert "python3 -m pip install . && swgjoint demo" in lines
    assert "python3 -m pip install '.[test]' && pytest -n 2" in lines


def test_it_is_short():
    """A first screen and not a record: details are in the guide."""
    assert README.count("\n") <= 200
    (example,) = blocks("python")
    assert len([line for line in example.splitlines() if line]) == 10
    assert len(re.findall(r"^!\[", section("Three questions"), re.MULTILINE)) == 3


def paragraphs() -> list[str]:
    """Questions and rows that state figures."""
    questions = re.split(r"\n\n(?=\*\*)", section("Three questions"))
    texts = [re.sub(r"```.*", "", text, flags=re.DOTALL) for text in questions]
    table = section("How true it is").splitlines()
    return [*texts, *(row for row in table if row.startswith("| ") and "](" in row)]


def unsupported(text: str) -> list[str]:
    """Figures of a text that are not on a page to which it links."""
    links = re.findall(r"\]\((notebooks/guide/[\w/.-]+\.md)", text)
    pages = [(ROOT / link).read_text(encoding="utf-8") for link in links]
    known = {number for page in pages for number in NUMBER.findall(page)}
    plain = re.sub(r"\]\([^)]*\)|`[^`]*`", " ", text)
    return [number for number in NUMBER.findall(plain) if number not in known]


@pytest.mark.parametrize("text", paragraphs(), ids=lambda text: text.strip()[:40])
def test_figures_are_those_of_the_linked_page(text):
    """Every number is printed on the page, beside the command that computes it."""
    if "back_driving_torque_Nm" not in text:  # computed below
        assert unsupported(text) == []


def test_a_wrong_figure_is_noticed():
    """A number that is not on the page."""
    row = next(text for text in paragraphs() if text.startswith("| K3, ratio 100"))
    assert unsupported(row) == []
    assert unsupported(row.replace("1.14", "9.14")) == ["9.14"]


def test_back_driving_torque(capsys):
    """The cheap command of the table prints its figures."""
    row = next(text for text in paragraphs() if "back_driving_torque_Nm" in text)
    ours, stated = re.findall(r"\d\.\d\d", row)
    assert main("spec CSG-25-100 --only back_driving_torque_Nm".split()) == 0
    printed = re.search(
        r"back driving torque +([\d.]+) +([\d.]+)", capsys.readouterr().out
    )
    assert f"{float(printed[1]):.2f}" == ours and printed[2] == stated
