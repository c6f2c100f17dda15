"""``swgjoint sweep``: JSON contract, files, stop and go on, bad input."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest
from messages import names

from swgjoint.cli.main import main

SHEET = """
description = "torques"
design = "reference-2d"
[spec]
figures = ["rated_torque_Nm"]
[plan]
kind = "list"
[[plan.parameters]]
keys = ["ratings.rated_torque_Nm"]
values = {}
"""
MESHING = """
design = "reference-2d"
[meshing]
figures = ["von_mises_MPa"]
positions = 1
[plan]
kind = "grid"
[[plan.parameters]]
keys = ["mesh.refinement"]
values = [0.5]
[[plan.parameters]]
keys = ["flexspline.rim_mm"]
low = 1.0
high = 1.1
count = 6
"""


@pytest.fixture
def file(tmp_path):
    path = tmp_path / "some.toml"
    path.write_text(SHEET.format("[10.0, 20.0, -1.0]"))
    return path


def called(capsys, *arguments) -> tuple[int, dict, str]:
    status = main(["sweep", *map(str, arguments), "--json"])
    captured = capsys.readouterr()
    return status, json.loads(captured.out), captured.err


def test_json_and_files(file, tmp_path, capsys):
    """Counts, rows and files; the second time everything is reused."""
    out = tmp_path / "out"
    status, result, err = called(capsys, file, "--jobs", 1, "--out", out)
    assert status == 0
    assert (result["done"], result["failed"], result["reused"]) == (2, 1, 0)
    assert result["wall_s"] > 0.0
    assert [row["outcome"] for row in result["rows"]] == ["ok", "ok", "refused"]
    assert [Path(name).name for name in result["files"]] == [
        "sweep.csv",
        "sweep.parquet",
        "sweep.png",
        "sweep.json",
    ]
    assert "designs: 2/2" in err
    assert json.loads((out / "sweep.json").read_text()) == result
    assert not list(out.rglob(".*"))  # nothing half-written is left
    table = (out / "sweep.csv").read_bytes()
    status, again, _ = called(capsys, file, "--jobs", 1, "--out", out)
    assert (again["done"], again["failed"], again["reused"]) == (2, 1, 2)
    assert again["computed"] == 0
    assert (out / "sweep.csv").read_bytes() == table


def test_a_file_among_the_folders_is_bad_input(file, tmp_path, capsys):
    """Where results should lie there is a file: one line, nothing computed."""
    (tmp_path / "results").write_text("")
    status = main(["sweep", str(file), "--jobs", "1", "--out", str(tmp_path)])
    captured = capsys.readouterr()
    assert (status, captured.out) == (2, "")
    assert captured.err.count("\n") == 1
    assert names(captured.err, str(tmp_path / "results"), "Not a directory")


def test_without_a_folder_results_lie_in_the_cache(file, tmp_path, capsys, monkeypatch):
    """The cache of the user keeps them; an empty one keeps none."""
    monkeypatch.setenv("SWGJOINT_CACHE", str(tmp_path / "cache"))
    called(capsys, file, "--jobs", 1)
    assert called(capsys, file, "--jobs", 1)[1]["reused"] == 2
    monkeypatch.setenv("SWGJOINT_CACHE", "")
    _, result, _ = called(capsys, file, "--jobs", 1)
    assert (result["reused"], result["files"]) == (0, [])


def test_the_table_in_the_terminal(file, tmp_path, capsys, monkeypatch):
    """One line a design, then why some failed, then the counts."""
    monkeypatch.setenv("SWGJOINT_CACHE", "")
    assert main(["sweep", str(file), "--jobs", "1"]) == 0
    out = capsys.readouterr().out
    assert names(out, "3", "refused", "ratings.rated_torque_Nm", "-1 N·m", "> 0 N·m")
    assert "validity of spec: level ratings alone, up to the repeated peak" in out
    assert "2 designs done, 1 failed; 0 of them reused, 2 computed" in out


def test_status_where_nothing_can_be_computed(file, capsys, monkeypatch):
    """Single failures are rows; a sweep without any figure has failed."""
    monkeypatch.setenv("SWGJOINT_CACHE", "")
    file.write_text(SHEET.format("[-1.0]"))
    assert called(capsys, file, "--jobs", 1)[0] == 1


@pytest.mark.parametrize(
    ("text", "options", "told"),
    [
        ("design = 3", (), ("some.toml", "design", "3", "string")),
        (
            SHEET.format("[1.0]").replace(
                'rated_torque_Nm"]\nv', 'rated_torqe_Nm"]\nv'
            ),
            (),
            (
                "plan.parameters[0].keys[0]",
                "'ratings.rated_torqe_Nm'",
                "ratings.rated_torque_Nm",
            ),
        ),
        (
            SHEET.format("[1.0]").replace("-2d", "-9d"),
            (),
            ("'reference-9d'", "models/drives", "reference-2d"),
        ),
        (SHEET.format("[1.0]"), ("--jobs", "0"), ("--jobs", "0", "1", "1024")),
        (
            SHEET.format("[1.0]"),
            ("--jobs", "2", "--scheduler", "tcp://127.0.0.1:1"),
            ("--jobs", "--scheduler", "one"),
        ),
        (SHEET.format("[1.0]"), ("--out", "nosuch://x"), ("results", "'nosuch://x'")),
    ],
)
def test_bad_input_is_one_line(text, options, told, file, capsys, monkeypatch):
    """Exit status 2, the fault on stderr, nothing on stdout."""
    if "'nosuch://x'" in told:
        pytest.importorskip("fsspec", reason="needs swgjoint[cluster]")
    file.write_text(text)
    assert main(["sweep", str(file), *options]) == 2
    captured = capsys.readouterr()
    assert captured.out == ""
    assert names(captured.err, *told)
    assert "Traceback" not in captured.err


@pytest.mark.skipif(sys.platform == "win32", reason="needs process groups")
def test_killed_half_way_it_goes_on_where_it_was(tmp_path, capsys):
    """After SIGKILL of all processes, what was finished is not touched again."""
    file = tmp_path / "meshing.toml"
    file.write_text(MESHING)
    out = tmp_path / "out"
    command = [sys.executable, "-m", "swgjoint", "sweep", str(file), "--out", str(out)]
    sweep = subprocess.Popen(
        [*command, "--jobs", "2"],
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
        start_new_session=True,
    )

    def finished():
        return sorted(out.glob("results/*/[!.]*.json"))

    try:
        end = time.monotonic() + 300.0
        while len(finished()) < 2:
            assert time.monotonic() < end
            assert sweep.poll() is None, "the sweep was faster than this test"
            time.sleep(0.005)
    finally:
        os.killpg(sweep.pid, signal.SIGKILL)
        sweep.wait()
    kept = {path: path.stat().st_mtime_ns for path in finished()}
    assert 2 <= len(kept) < 6
    _, result, _ = called(capsys, file, "--jobs", 1, "--out", out)
    assert (result["done"], result["failed"]) == (6, 0)
    assert result["reused"] == len(kept)
    assert result["computed"] == 6 - len(kept)
    assert {path: path.stat().st_mtime_ns for path in kept} == kept
    assert len(finished()) == 6
