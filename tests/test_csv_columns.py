"""Columns of numbers from files as benches and spreadsheets write them."""

from __future__ import annotations

import numpy as np
import pytest
from messages import naming

from swgjoint.csv_columns import header_of, read_columns, read_table
from swgjoint.errors import InputError

WANTED = {"torque": {"torque_Nm": 1.0}, "torsion": {"torsion_rad": 1.0}}


def read(tmp_path, text: str):
    path = tmp_path / "a.csv"
    path.write_text(text)
    return read_columns(path, WANTED)


@pytest.mark.parametrize("separator", [",", ";", "\t"])
@pytest.mark.parametrize(
    "head",
    [
        "torque_Nm,torsion_rad,note\n",
        "# rig 3\n\n# torque, then torsion\ntorque_Nm,torsion_rad,note\n",
        '"# rig 3, cold"\n"torque_Nm", torsion_rad ,note\n',
        "# rig 3\n# torque_Nm,torsion_rad,note\n",
    ],
    ids=["plain", "comments", "quoted", "savetxt"],
)
def test_separator_and_comments_are_seen(tmp_path, separator, head):
    """The same numbers, whatever separates them and whatever stands above."""
    text = head + "1,2e-3,0\n# a pause\n-3.5, 4 ,0\n"
    found = read(tmp_path, text.replace(",", separator))
    np.testing.assert_array_equal(found["torque"], [1.0, -3.5])
    np.testing.assert_array_equal(found["torsion"], [2e-3, 4.0])
    assert header_of(tmp_path / "a.csv") == ["torque_Nm", "torsion_rad", "note"]


@pytest.mark.parametrize(
    ("text", "parts"),
    [
        ("T [Nm];angle\n1;2\n", ("torque_Nm", "';'", "'T [Nm]'", "'angle'")),
        ("torque_Nm torsion_rad\n1 2\n", ("torque_Nm", "','", "torsion_rad'")),
        ("1,2\n3,4\n", ("torque_Nm", "','", "'1'", "'2'")),
        ("torque_Nm;torsion_rad\n1,5;2\n", ("line 2", "torque_Nm", "'1,5'", "point")),
        ("torque_Nm,torsion_rad\n1_5,2\n", ("line 2", "torque_Nm", "'1_5'", "finite")),
        ("torque_Nm\ttorsion_rad\n1\n", ("line 2", "1", "2", "a tab")),
        ('torque_Nm,torsion_rad\n1,"2\n3"\n', ("CSV",)),
    ],
)
def test_what_was_read_is_said(tmp_path, text, parts):
    """Names that were found, what was taken to separate them, a decimal comma."""
    with pytest.raises(InputError, match=naming("a.csv", *parts)):
        read(tmp_path, text)


def test_a_table_with_text_keeps_empty_cells(tmp_path):
    """Numbers, texts and empty cells by column; the column of text stays text."""
    path = tmp_path / "a.csv"
    path.write_text("# prices\ndrive;mass;note\n14;0.5;\nb;;new\nc;1;2_5\n")
    assert read_table(path, "drive") == [
        {"drive": "14", "mass": 0.5, "note": None},
        {"drive": "b", "mass": None, "note": "new"},
        {"drive": "c", "mass": 1.0, "note": "2_5"},
    ]


@pytest.mark.parametrize(
    ("text", "parts"),
    [
        ("name,mass\na,1\n", ("'name'", "drive")),
        ("drive,mass,mass\na,1,2\n", ("'mass', 'mass'", "once")),
        ("drive,mass\na\n", ("line 2", "1 cells", "2")),
        ("drive,mass\n,1\n", ("line 2", "drive")),
    ],
)
def test_a_table_with_faults_is_refused(tmp_path, text, parts):
    path = tmp_path / "a.csv"
    path.write_text(text)
    with pytest.raises(InputError, match=naming("a.csv", *parts)):
        read_table(path, "drive")
