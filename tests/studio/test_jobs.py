"""Computations of the studio in processes of their own."""

from __future__ import annotations

import os
import time

import pytest
from job_functions import add, die, err, fail, hold

from swgjoint.studio.jobs import Job
from swgjoint.studio.session import THIS_DESIGN, Session


def end(job, limit=60.0):
    until = time.monotonic() + limit
    while job.running:
        job.poll()
        assert time.monotonic() < until
        time.sleep(0.01)
    return job


def is_there(pid):
    try:
        os.kill(pid, 0)
    except ProcessLookupError:
        return False
    return True


def test_a_result_arrives():
    """The result of the function, with its progress."""
    assert end(Job(add, 1, 2)).result == 3


@pytest.mark.parametrize(
    ("function", "text"),
    [(fail, "no equilibrium"), (err, "KeyError"), (die, "without a result")],
)
def test_a_failure_is_told(function, text):
    """A failure, a bug and a killed process each leave a message and no result."""
    job = end(Job(function))
    assert text in job.fault and job.result is None


def test_a_stopped_computation_ends():
    """Its process is gone as soon as it is stopped."""
    job = Job(hold)
    assert is_there(job.pid)
    job.cancel()
    assert not is_there(job.pid) and not job.running


@pytest.fixture
def sessions():
    found = Session(), Session()
    yield found
    for one in found:
        one.close()


def test_sessions_do_not_mix(sessions):
    """Edits and folders belong to one session; closing one ends its work only."""
    one, other = sessions
    for session in sessions:
        session.pages = 1
    one.edit("flexspline.rim_mm", 1.5)
    other.edit("flexspline.rim_mm", 0.8)
    mine, others = ([job.pid for job in s.jobs.values()] for s in sessions)
    assert mine and others and one.folder != other.folder
    one.leave()
    assert not any(map(is_there, mine)) and all(map(is_there, others))
    assert one.current.draft["flexspline"]["rim_mm"] == 1.5
    assert other.current.draft["flexspline"]["rim_mm"] == 0.8


def test_a_new_edit_replaces_running_work(sessions):
    """Only the last of several edits is computed."""
    one, _ = sessions
    one.edit("flexspline.rim_mm", 1.5)
    first = [job.pid for job in one.jobs.values()]
    one.edit("flexspline.rim_mm", 1.2)
    assert not any(map(is_there, first)) and one.jobs


def test_a_reload_keeps_the_work(sessions):
    """While a page is built anew, the old one may leave without ending anything."""
    one, _ = sessions
    one.pages = 1
    one.edit("flexspline.rim_mm", 1.5)
    running = [job.pid for job in one.jobs.values()]
    one.pages += 1
    one.leave()
    assert all(map(is_there, running))


def test_another_scene_ends_the_run(sessions):
    """The figures of one arm are never shown as those of another one."""
    one, _ = sessions
    one.start("arm", one._ran, hold)
    running = one.jobs["arm"].pid
    one.choose("bench")
    assert not is_there(running) and "arm" not in one.jobs


def test_a_run_waits_for_the_joints(sessions):
    """A level is never left out because the joints are not known yet."""
    one, _ = sessions
    one.level = "rigid"
    one.start("joints", one._joints, hold)
    one.run()
    assert "arm" not in one.jobs and "joints" in one.arm_fault
    one.stop("joints")
    one.drives = {"joint": "linear"}
    one.run()
    assert "arm" in one.jobs and not one.arm_fault


def test_results_of_an_earlier_design_are_marked(sessions):
    """A data sheet is old once a key changes, and no longer after the key returns."""
    session = sessions[0]
    key, before = "drive.face_width_mm", session.current.draft["drive"]["face_width_mm"]
    session.files, session.requested = ["sheet.html"], session.current.draft
    assert not session.files_are_old
    session.edit(key, before + 1.0)
    assert session.files_are_old
    session.edit(key, before)
    assert not session.files_are_old


def test_a_run_with_other_drives_is_marked(sessions):
    """A run is old once a drive or level changes, or a design that it contains."""
    session = sessions[0]
    session.drives = {"joint1": "CSG-25-100"}
    session.metrics, session.ran = {}, session.to_run
    session.edit("drive.face_width_mm", 11.0)
    assert not session.run_is_old
    session.choose_drive("joint1", THIS_DESIGN)
    assert session.run_is_old
    session.ran = session.to_run
    session.edit("drive.face_width_mm", 12.0)
    assert session.run_is_old
    session.ran = session.to_run
    session.choose_level("rigid")
    assert session.run_is_old
