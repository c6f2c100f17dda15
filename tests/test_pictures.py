"""Pictures and files of names that come from elsewhere."""

from __future__ import annotations

import io
from dataclasses import replace

import pytest

from swgjoint.files import check_output_file, file_name, output_folder
from swgjoint.maps.sheet.spec_sheet import measure_spec
from swgjoint.pictures import plain_text, save_png
from swgjoint.view.plots.spec import spec_picture

HOSTILE = ("$\\frac{$", "$x^$", "$$", "\\$", "a\x1b[31m", "half \udc80", "n" * 5000)


@pytest.mark.parametrize("name", HOSTILE)
def test_a_picture_shows_a_name_as_it_is(synthetic_map, name):
    """No mathematics, control characters, half characters or endless words."""
    drive = replace(synthetic_map, name=name, orders=synthetic_map.orders)
    sheet = measure_spec(drive, only=("rated_torque_Nm", "hysteresis_loss_arcmin"))
    assert spec_picture(drive.name, sheet).startswith(b"\x89PNG")


def test_names_of_ticks_are_drawn_as_they_are():
    """Labels that a formatter sets when the axis is drawn are escaped as well."""
    from matplotlib.figure import Figure

    figure = Figure()
    axes = figure.subplots()
    axes.set_xticks([0, 1], ["$\\frac{$", "b"])
    axes.set_yscale("log")  # whose own ticks are mathematics
    out = io.BytesIO()
    save_png(figure, out, dpi=50)
    assert out.getvalue().startswith(b"\x89PNG")
    assert "mathdefault" in axes.get_yticklabels()[-1].get_text()


def test_drawn_texts():
    """What is plain stays, a second pass changes nothing, length is bounded."""
    assert plain_text("torque [N·m]\nof CSG-25-100") == "torque [N·m]\nof CSG-25-100"
    for name in HOSTILE:
        assert plain_text(plain_text(name)) == plain_text(name)
        assert len(plain_text(name)) <= 81 + name.count("$")


@pytest.mark.parametrize(
    ("name", "file"),
    [
        ("CSG-25-100", "CSG-25-100"),
        ("drive_2.1", "drive_2.1"),
        ("a/b", "a-b"),
        ("../../up", "-..-up"),
        ("a\0b\n", "a-b-"),
        ("", "-"),
        ("..", "-"),
        ("n" * 5000, "n" * 60),
    ],
)
def test_a_name_of_a_drive_is_one_part_of_a_path(name, file):
    """A slash leads nowhere and a long name fits."""
    assert file_name(name) == file


@pytest.mark.parametrize(
    ("name", "says"),
    [("n" * 300, "too long"), ("n" * 5000, "too long"), ("d/" * 1000 + "d", "folders")],
)
def test_an_output_of_an_endless_name_is_bad_input(name, says):
    """One short line, before any work."""
    for check in (output_folder, lambda name: check_output_file(name + ".swg", ".swg")):
        with pytest.raises(ValueError, match=says) as caught:
            check(name)
        assert len(str(caught.value)) < 150
