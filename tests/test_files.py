"""Outputs of a result: whole or not at all, and one that fails costs no other."""

from __future__ import annotations

import json

import mujoco
import pytest

from swgjoint.errors import InputError, OutputWarning
from swgjoint.files import Outputs, attempt_output


def broken():
    raise ZeroDivisionError("no scale\nfor the axis")


def test_one_output_that_fails_costs_no_other(tmp_path):
    """It is a warning of one line with the file and the cause; the rest is there."""
    outputs = Outputs(tmp_path / "new")
    outputs.write("a.txt", lambda: "text")
    with pytest.warns(OutputWarning) as caught:
        outputs.write("b.png", broken)
    outputs.write("none.png", lambda: None)
    outputs.hand_over("c.rrd", lambda path: path.write_bytes(b"c"))
    result = {"figure": 1.5, "files": []}
    outputs.write_json("d.json", result)
    (message,) = [str(warning.message) for warning in caught]
    assert message == (
        f"{tmp_path / 'new/b.png'} is not written: ZeroDivisionError: no scale for the"
        " axis"
    )
    names = ["d.json", "a.txt", "c.rrd"]
    assert result["files"] == [str(tmp_path / "new" / name) for name in names]
    assert json.loads((tmp_path / "new/d.json").read_text()) == result
    assert sorted(p.name for p in (tmp_path / "new").iterdir()) == sorted(names)


def test_a_folder_that_cannot_be_made_is_told_per_file(tmp_path):
    """Nothing is raised: the figures of the command are printed all the same."""
    (tmp_path / "file").write_text("")
    outputs = Outputs(tmp_path / "file" / "below")
    with pytest.warns(OutputWarning, match=r"a\.txt is not written"):
        outputs.write("a.txt", lambda: "text")
    assert outputs.files == []


def test_an_engine_without_memory_is_no_defect(tmp_path):
    """What MuJoCo raises when it cannot allocate is reported as want of memory."""

    def too_large():
        mujoco.MjModel.from_xml_string('<mujoco><size memory="1000000G"/></mujoco>')

    with pytest.warns(OutputWarning, match=r"a\.png is not written: out of memory$"):
        Outputs(tmp_path).write("a.png", too_large)


def test_a_failure_of_the_content_is_raised(tmp_path):
    """Only what concerns the file alone becomes a warning."""
    with pytest.raises(InputError), attempt_output(tmp_path / "a", unless=lambda: True):
        raise InputError("the drive is unknown")
    with pytest.raises(KeyboardInterrupt), attempt_output(tmp_path / "a"):
        raise KeyboardInterrupt
