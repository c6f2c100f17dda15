"""Tables of the validation pages are those of commands, at known commits."""

from __future__ import annotations

import json
import re
import subprocess
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
PAGE = ROOT / "notebooks" / "guide" / "validation" / "calculix.md"
RECORD = json.loads((ROOT / "notebooks" / "calculix.json").read_text(encoding="utf-8"))


def cell(now, before):
    """Stress [MPa] with its change from the coarser mesh [%]."""
    return f"{now:.1f} ({100.0 * abs(now / before - 1.0):.2f} %)"


def stated_row(state, label):
    """Row of the table on the finest meshes."""

    def entry(ours, calculix, element):
        key = ours, calculix, element
        names = "ours_refinement", "calculix_refinement", "element"
        return next(
            row
            for row in RECORD["rows"]
            if row["state"] == state and tuple(row.get(name) for name in names) == key
        )

    shape, stress = entry(12, 2, "CPE8R"), entry(12, 2, "CPE8")
    ours = cell(stress["root_ours_MPa"], entry(8, 1, "CPE8R")["root_ours_MPa"])
    coarse = entry(12, 1, "CPE8")["root_calculix_MPa"]
    cells = [f"{shape[f'{way}_max_um']:.2f}" for way in ("radial", "tangential")]
    cells += [ours, cell(stress["root_calculix_MPa"], coarse)]
    return f"| {label} | {' | '.join(cells)} |"


def test_table_of_calculix():
    """Shape and stress of all states, largest difference, date and version."""
    page = PAGE.read_text(encoding="utf-8")
    labels = {
        "elliptical": "elliptical",
        "simplified": "simplified",
        "parabolic": "parabolic",
        "elliptical, 20 N·m, 0 pitch": "elliptical, 20 N·m",
        "elliptical, 20 N·m, 0.3 pitch": "elliptical, 20 N·m, 0.3 pitch further",
    }
    rows = [stated_row(state, label) for state, label in labels.items()]
    assert [row for row in rows if row not in page.splitlines()] == []
    flat = " ".join(page.split())
    version = RECORD["versions"]["swgjoint"]
    assert f"measured on {RECORD['date']} with version {version}" in flat
    finest = [
        row["radial_max_um"]
        for row in RECORD["rows"]
        if (row["ours_refinement"], row["calculix_refinement"]) == (12, 2)
    ]
    (stated,) = re.findall(r"differs by at most ([\d.]+) µm", flat)
    assert f"{max(finest):.2f}" == stated


COMMIT = r" at commit ([0-9a-f]{12})\b"
CAPTION = re.compile(r"\*(?=.*`.+`).* on \d{4}-\d\d-\d\d\b.*" + COMMIT + r".*:\*")
"""Command, date and commit of a table."""
PAGES = [*sorted(PAGE.parent.glob("*.md")), PAGE.parents[1] / "benchmarks.md"]


@pytest.mark.parametrize("page", PAGES, ids=lambda path: path.stem)
def test_tables_have_captions(page):
    """Every table says by which command, when and at which commit it was measured."""
    lines = [line for line in page.read_text("utf-8").splitlines() if line]
    heads = [k - 1 for k, line in enumerate(lines) if re.match(r"\|[ -]*---", line)]
    above = [next(x for x in lines[k - 1 :: -1] if x[:4] != "<!--") for k in heads]
    bare = [
        lines[k] for k, x in zip(heads, above, strict=True) if not CAPTION.fullmatch(x)
    ]
    assert bare == []


def test_commits_of_captions_exist():
    """A reader finds the code with which a table was measured."""

    def git(*arguments):
        return subprocess.run(
            ["git", *arguments], cwd=ROOT, capture_output=True, text=True, timeout=20
        )

    found = git("rev-parse", "--is-shallow-repository")
    if found.stdout.strip() != "false":
        pytest.skip("no history of commits here")
    named = {c for page in PAGES for c in re.findall(COMMIT, page.read_text("utf-8"))}
    within = {c: git("merge-base", "--is-ancestor", c, "HEAD") for c in sorted(named)}
    lost = [c for c, found in within.items() if found.returncode]
    assert lost == []
