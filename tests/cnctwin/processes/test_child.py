"""Processes that are started again when they die, and that do not outlive us."""

import os
import signal
import sys
from pathlib import Path

import pytest

from cnctwin.processes import child as child_module
from cnctwin.processes.child import Child
from tests.cnctwin.program import is_alive, until


def python(tmp_path: Path, code: str) -> Child:
    return Child("part", [sys.executable, "-c", code], tmp_path / "part.log")


def test_one_that_dies_is_started_again_and_counted(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(child_module, "RESTART_S_MIN", 0.0)
    child = python(tmp_path, "import time; time.sleep(60)")
    child.start()
    try:
        assert not child.watch()
        before = child.pid
        assert before is not None
        os.kill(before, signal.SIGKILL)
        until(lambda: not child.running, "the process to die")
        assert child.watch()
        assert child.running
        assert child.pid != before
        assert child.restarts == 1
    finally:
        child.stop()
    assert not child.running


def test_one_that_dies_at_once_is_not_started_in_a_hurry(tmp_path: Path) -> None:
    now_s = 1000.0
    child = Child("part", [sys.executable, "-c", "raise SystemExit(3)"], tmp_path / "part.log", clock=lambda: now_s)
    child.start()
    until(lambda: not child.running, "the process to end")
    restarted = []
    for waited in (0.0, 0.9, 1.1):
        now_s = 1000.0 + waited * child_module.RESTART_S_MIN
        restarted.append(child.watch())
    child.stop()
    assert restarted == [False, False, True]
    assert child.restarts == 1


def test_one_that_does_not_listen_is_killed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(child_module, "STOP_S_MAX", 0.2)
    child = python(
        tmp_path, "import signal, time; signal.signal(signal.SIGTERM, signal.SIG_IGN); print('deaf', flush=True); time.sleep(60)"
    )
    child.start()
    until(lambda: child.last_words() == "deaf", "the process to be deaf")
    pid = child.pid
    child.stop()
    assert pid is not None
    assert not is_alive(pid)


def test_its_last_words_are_the_end_of_what_it_said(tmp_path: Path) -> None:
    child = python(tmp_path, "print('one\\ntwo\\nthree\\nfour')")
    assert child.last_words() == ""
    child.start()
    until(lambda: not child.running, "the process to end")
    child.stop()
    assert child.last_words() == "two / three / four"
