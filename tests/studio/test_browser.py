"""The page in a browser: it follows edits, keeps sessions apart and ends its work."""

from __future__ import annotations

import importlib.util
import os
import re
import signal
import socket
import subprocess
import sys
import time
import urllib.error
import urllib.request

import numpy as np
import pytest
from browser import PROGRAM, Browser

from swgjoint.drives.spec_sheet import spec_sheet
from swgjoint.gear.design.design import Design
from swgjoint.maps.drive_map import DriveMap
from swgjoint.maps.from_catalogue import find_row
from swgjoint.models_path import models_path
from swgjoint.sim.scene.scene import Scene
from swgjoint.view.recording.viewer import free_port, wait_for

pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(
        not importlib.util.find_spec("nicegui"), reason="needs the extra studio"
    ),
    pytest.mark.skipif(
        not importlib.util.find_spec("websockets"), reason="needs websockets"
    ),
    pytest.mark.skipif(PROGRAM is None, reason="needs chromium"),
]
PROMPT_S = 5.0
"""Longest time between an edit and its figures on an idle machine [s]."""
RIM = "flexspline.rim_mm"


@pytest.fixture(scope="module")
def server(tmp_path_factory):
    """Address and process of the studio, which ends without a trace."""
    port, folder = free_port(), tmp_path_factory.mktemp("studio")
    # NiceGUI behaves differently in processes that know of a test
    known = {k: v for k, v in os.environ.items() if k != "PYTEST_CURRENT_TEST"}
    process = subprocess.Popen(
        [sys.executable, "-Pm", "swgjoint", "studio", "--no-browser", f"--port={port}"],
        stderr=subprocess.PIPE,
        text=True,
        env={**known, "TMPDIR": str(folder)},
    )
    wait_for(port, process, limit=120.0)
    yield f"http://127.0.0.1:{port}/", process
    left = children(process.pid)
    process.send_signal(signal.SIGINT)
    printed = process.communicate(timeout=60)[1]
    assert printed.splitlines() == [
        f"studio: http://127.0.0.1:{port}/ (Ctrl+C ends it)"
    ]
    assert list(folder.glob("swgjoint-*")) == []
    until = time.monotonic() + 20.0
    while left & set(processes()):
        assert time.monotonic() < until, "processes of the studio go on"
        time.sleep(0.1)


@pytest.fixture(scope="module")
def chromium():
    """The browser."""
    found = Browser()
    yield found
    found.close()


@pytest.fixture
def open_page(server, chromium):
    """Function that opens a tab and waits until it shows the first design."""
    opened = []

    def open_one():
        opened.append(chromium.open(server[0]))
        opened[-1].wait("document.querySelector('[data-key=looks] img')")
        return opened[-1]

    yield open_one
    urls = [url for page in opened for url in page.requests]
    errors = [error for page in opened for error in page.errors]
    for page in opened:
        page.close()
    hosts = {url.split("/")[2] for url in urls if url.startswith("http")}
    assert hosts == {server[0].split("/")[2]}  # nothing leaves the machine
    assert errors == []


@pytest.fixture
def page(open_page):
    """A new tab."""
    return open_page()


def read(url):
    """Content of a file of the page."""
    with urllib.request.urlopen(url) as answer:
        return answer.read()


def slowness():
    """Wall time per CPU time of a calculation: 1 on an idle machine."""
    begin, cpu = time.perf_counter(), time.process_time()
    while time.process_time() - cpu < 0.3:
        pass
    return (time.perf_counter() - begin) / (time.process_time() - cpu)


def figures(page):
    """Values of the table of figures by name."""
    rows = [line.split("\t") for line in page.text("figures").splitlines()]
    return {row[0]: row[1:] for row in rows if len(row) > 1}


def settle(page, key, text):
    """Wait until a field has a text, and the figures are those of the design."""
    field = f"document.querySelector('input[data-key=\"{key}\"]')"
    page.wait(f"{field} && {field}.value == '{text}'")
    page.wait("document.querySelector('[data-key=drive-progress]').innerText == ''")
    page.wait("document.querySelector('[data-key=figures]').style.opacity == '1'")


def edit(page, key, text):
    """Type into a field, and wait for the figures."""
    page.type(key, text)
    page.wait("document.querySelector('[data-key=drive-progress]').innerText != ''")
    settle(page, key, text)


def processes():
    """Identifiers of all processes that run, each with that of its parent."""
    listed = subprocess.run(
        ["ps", "-eo", "pid=,ppid=,stat="], capture_output=True, text=True, check=True
    )
    rows = [line.split() for line in listed.stdout.splitlines()]
    return {int(pid): int(above) for pid, above, state in rows if state[0] != "Z"}


def children(*parents):
    """Processes that other processes have started."""
    return {pid for pid, above in processes().items() if above in parents}


def workers(process):
    """Processes that compute, which a process of the studio has forked."""
    return children(*children(process.pid))


def test_an_edited_tooth_changes_picture_and_figures(page):
    """Teeth, curves and figures follow within seconds."""
    before = figures(page)
    page.value(
        "window.old = [...document.querySelectorAll('[data-key=teeth] img,"
        " [data-key=looks] img')].map(e => e.src), 1"
    )
    slow = slowness()
    page.type("flexspline.profile.addendum_radius_mm", "1.1")
    took = page.wait(
        "[...document.querySelectorAll('[data-key=teeth] img, [data-key=looks] img')]"
        ".every((e, k) => e.src != window.old[k])"
    )
    slow = max(slow, slowness())
    after = figures(page)
    assert set(after) == set(before)
    assert all(after[f"K{k} [N·m/rad]"] != before[f"K{k} [N·m/rad]"] for k in (1, 2, 3))
    assert len([name for name in before if after[name] != before[name]]) > 8
    assert took < PROMPT_S * slow


def test_an_impossible_tooth_has_its_line_beside_the_field(page):
    """The message stands below the field, and goes once the value is right again."""
    key = "flexspline.profile.tip_radius_mm"
    fault = f"document.querySelector('[data-fault=\"{key}\"]')"
    page.type(key, "1.5")
    page.wait(f"{fault}.innerText.includes('accepted: <= 0.7619 mm')")
    below = f"{fault}.getBoundingClientRect().top"
    field = f"document.querySelector('input[data-key=\"{key}\"]')"
    gap = page.value(f"{below} - {field}.getBoundingClientRect().bottom")
    assert 0 <= gap < 30
    page.type(key, "0.3")
    page.wait(f"getComputedStyle({fault}).display == 'none'")


def test_variants_stand_side_by_side(page):
    """Figures of a kept and an edited variant, which can change their places."""
    name = "K1 [N·m/rad]"
    [first] = figures(page)[name]
    page.click("keep")
    page.wait("document.querySelector('[data-key=kept-teeth] img')")
    edit(page, RIM, "0.8")
    kept, edited = figures(page)[name]
    assert kept == first != edited
    assert f"{RIM}: 1.0 → 0.8 mm" in page.value("document.body.innerText")
    page.click("swap")
    settle(page, RIM, "1.0")
    assert figures(page)[name] == [edited, first]
    assert f"{RIM}: 0.8 → 1.0 mm" in page.value("document.body.innerText")
    page.click("drop")
    page.wait("!document.querySelector('[data-key=figures]').innerText.includes('B')")
    assert figures(page)[name] == [first]


def test_a_design_file_is_opened_and_saved(page, tmp_path):
    """The saved file is the opened design; a wrong file leaves the draft unchanged."""
    text = (models_path() / "drives" / "reference-2d.toml").read_text(encoding="utf-8")
    mine = tmp_path / "mine.toml"
    mine.write_text(text.replace("rim_mm = 1.0", "rim_mm = 0.9"), encoding="utf-8")
    page.upload("input[type=file]", mine)
    settle(page, RIM, "0.9")
    wrong = tmp_path / "wrong.toml"
    wrong.write_text("[flexspline\n", encoding="utf-8")
    page.upload("input[type=file]", wrong)
    notice = "document.querySelector('.q-notification')"
    page.wait(f"{notice} && {notice}.innerText.includes('wrong.toml')")
    assert str(tmp_path) not in page.value(f"{notice}.innerText")
    folder = tmp_path / "saved"
    folder.mkdir()
    saved = Design.load(page.download("save", folder))
    assert saved == Design.load(mine) and saved.flexspline.rim_mm == 0.9


def test_map_data_sheet_and_meshing_on_request(page, server, tmp_path):
    """Each ends with a page; the map that is taken away agrees with the quick look."""
    page.click("mesh")
    edit(page, "mesh.refinement", "0.5")
    for request, title in (
        ("meshing over half a turn, 2D (seconds)", "Meshing of reference-2d"),
        ("map and data sheet, 2D (minutes)", "Data sheet of reference-2d"),
    ):
        page.choose("request", request)
        page.click("compute")
        shown = "document.querySelector('iframe')?.contentDocument.title"
        page.wait(f"{shown} == '{title}'", 300)
        page.wait("document.querySelector('iframe').contentDocument.images.length")
    link = page.value("document.querySelector('a[download$=\".swg\"]').href")
    path = tmp_path / "drive.swg"
    path.write_bytes(read(link))
    K1 = float(figures(page)["K1 [N·m/rad]"][0].replace(",", ""))
    measured = spec_sheet(DriveMap.load(path), only=("K1_Nm_rad",))["K1_Nm_rad"]
    assert measured == pytest.approx(K1, rel=0.02)


def test_two_tabs_do_not_mix_and_a_reload_keeps_the_state(open_page):
    """Another tab starts anew, and a reload shows the values of its own tab."""
    one, other = open_page(), open_page()
    edit(one, RIM, "1.3")
    edit(other, RIM, "0.9")
    shown = [figures(tab) for tab in (one, other)]
    assert shown[0] != shown[1]
    for tab, text, values in zip((one, other), ("1.3", "0.9"), shown, strict=True):
        tab.reload()
        settle(tab, RIM, text)
        assert figures(tab) == values
    other.value("[...document.querySelectorAll('.q-tab')][1].click(), 1")
    other.choose("drive-joint", "CSG-32-100")
    other.reload()
    drive = "document.querySelector('input[data-key=drive-joint]')"
    other.wait(f"{drive} && {drive}.value == 'CSG-32-100'")
    assert one.value(f"{drive} === null")


def test_own_design_drives_a_joint(page, tmp_path):
    """Figures and report of the scene; its files work together in another folder."""
    page.click("mesh")
    edit(page, "mesh.refinement", "0.5")
    page.value("[...document.querySelectorAll('.q-tab')][1].click(), 1")
    page.choose("drive-joint", "the design of this page")
    page.click("run")
    page.wait("document.querySelector('[data-key=verdict]')?.innerText == 'VALID'", 300)
    joint = page.text("joints").splitlines()[-1].split("\t")
    assert joint[0] == "joint" and joint[-1] == "yes"
    assert re.fullmatch(r"[~! >]*[\d.]+", joint[1])
    page.wait(
        "document.querySelector('iframe')?.contentDocument.title == 'Scene bench'"
    )
    links = page.value("[...document.querySelectorAll('a[download]')].map(e => e.href)")
    for link in links:
        name = link.rpartition("/")[2]
        (tmp_path / name).write_bytes(read(link))
    scene = Scene.load_file(tmp_path / "scene.toml")
    assert scene.joint_settings("joint").drive == str(tmp_path / "drive.toml")
    assert Design.load(tmp_path / "drive.toml").mesh.refinement == 0.5


def test_another_arm_runs_with_chosen_drives(page):
    """The joints of an arm are listed with drives; a run has a row for each of them."""
    page.value("[...document.querySelectorAll('.q-tab')][1].click(), 1")
    page.choose("scene", "two-link")
    page.choose("drive-elbow", "CSG-25-100")
    page.click("run")
    page.wait("document.querySelector('[data-key=verdict]')?.innerText == 'VALID'", 300)
    rows = [line.split("\t") for line in page.text("joints").splitlines()[1:]]
    peaks = {row[0]: float(row[6]) for row in rows}
    assert set(peaks) == {"shoulder", "elbow"}
    assert peaks["elbow"] == find_row("CSG-25-100").repeated_peak != peaks["shoulder"]
    page.click("play")
    until = time.monotonic() + 120.0
    while not any("/run.rrd?v=" in url for url in page.requests):
        assert time.monotonic() < until, "the viewer does not ask for the recording"
        time.sleep(0.2)
    time.sleep(3.0)  # in which the viewer would call other machines


def test_fifty_random_edits_without_an_exception(page):
    """Any text in any field, also before the last one is shown, and then a good one."""
    rng = np.random.default_rng(11)
    texts = ["", "0", "-1", "1e-9", "1e300", "nan", "abc", "[1, 2]", "{", "'", "0.7"]
    page.value(
        "[...document.querySelectorAll('.q-item[aria-expanded=false]')]"
        ".forEach(e => e.click()), 1"
    )
    fields = (
        "[...document.querySelectorAll('.value input[data-key]')]"
        ".filter(e => e.offsetParent).map(e => e.dataset.key)"
    )
    kinds = ["parabolic", "simplified", "cosine", "elliptical"]
    for k in range(50):
        key = str(rng.choice(page.value(fields)))
        before = page.value(
            f"document.querySelector('input[data-key=\"{key}\"]').value"
        )
        if k % 10 == 5:
            page.choose("wave_generator.kind", str(rng.choice(kinds)))
        elif k % 2 and re.fullmatch(r"[\d.]+", before):
            page.type(key, str(float(before) * rng.uniform(0.8, 1.2)))
        else:
            page.type(key, str(rng.choice(texts)))
        time.sleep(float(rng.choice([0.05, 0.6, 1.2])))
        shown = page.value("document.body.innerText")
        assert "internal error" not in shown and "Traceback" not in shown
    page.choose("source", "reference-2d")
    settle(page, RIM, "1.0")
    assert figures(page)["K1 [N·m/rad]"] == ["903,500"]


def test_closing_the_page_ends_its_work(server, chromium):
    """The processes that compute for a tab end soon after it is closed."""
    _, process = server
    page = chromium.open(server[0])
    page.wait("document.querySelector('[data-key=looks] img')")
    until = time.monotonic() + 60.0
    while workers(process):
        assert time.monotonic() < until, "work of another test goes on"
        time.sleep(0.2)
    page.click("mesh")
    page.type("mesh.refinement", "4")
    page.wait("document.querySelector('[data-key=teeth]').style.opacity == '1'")
    page.choose("request", "meshing over half a turn, 2D (seconds)")
    page.click("compute")
    while not workers(process):
        assert time.monotonic() < until + 60.0
        time.sleep(0.1)
    page.close()
    begin = time.monotonic()
    while workers(process):
        assert time.monotonic() - begin < 5.0 * slowness(), "work goes on"
        time.sleep(0.2)


def test_other_hosts_are_refused(server):
    """A name that another site has pointed at this machine does not open the page."""
    request = urllib.request.Request(server[0], headers={"Host": "example.org"})
    with pytest.raises(urllib.error.HTTPError) as caught:
        urllib.request.urlopen(request)
    with caught.value as answer:
        assert answer.code == 400
    port = int(server[0].rstrip("/").rpartition(":")[2])
    outside = [
        info[4][0]
        for info in socket.getaddrinfo(socket.gethostname(), None, socket.AF_INET)
        if not info[4][0].startswith("127.")
    ]
    for host in outside:
        with socket.socket() as probe:
            assert probe.connect_ex((host, port)) != 0
