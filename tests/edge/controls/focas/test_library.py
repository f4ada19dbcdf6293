"""The backend that uses a library, on a stub of our own in C with the same calls and structures; needs a C compiler."""

import shutil
import subprocess
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from edge.alarm_list import ListedAlarm, alarms_text
from edge.config import EdgeConfig
from edge.controls.focas import fwlib
from edge.controls.focas.calls import Call, Opened, Request
from edge.controls.focas.check import describe
from edge.controls.focas.config import Backend, FocasConfig
from edge.controls.focas.library import LibraryBackend
from edge.controls.focas.policy import CODES, NODLL, SOCKET

COMPILER = shutil.which("gcc") or shutil.which("cc")
pytestmark = pytest.mark.skipif(COMPILER is None, reason="no C compiler, so no stub of the library")
SOURCE = Path(__file__).with_name("stub_fwlib.c")
STATUS, LOAD = Request(Call.STATUS), Request(Call.SPINDLE_LOAD)
EVERY = [Request(Call.PMC, "F10:4"), Request(Call.G_CODE, "2"), Request(Call.OFFSET, "length_wear 7")]
EVERY += [Request(Call.MACRO, "500"), Request(Call.MACRO, "501"), Request(Call.COMMENT, "1701"), Request(Call.PMC, "D300:2s")]
EVERY += [Request(call) for call in Call if call not in {one.call for one in EVERY}]
Say = Callable[[str], None]


@pytest.fixture(scope="session")
def stub(tmp_path_factory: pytest.TempPathFactory) -> Path:
    assert COMPILER
    target = tmp_path_factory.mktemp("stub") / "libfwlib32.so"
    subprocess.run([COMPILER, "-shared", "-fPIC", "-Wall", "-Wextra", "-Werror", "-o", target, SOURCE], check=True)
    return target


@pytest.fixture
def say(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Say:
    """Tell the stub what its functions answer: lines of function and code."""
    told, calls = tmp_path / "told", tmp_path / "calls"
    monkeypatch.setenv("STUB_FWLIB", str(told))
    monkeypatch.setenv("STUB_FWLIB_CALLS", str(calls))
    return lambda lines: (told.write_text(lines), None)[1]


@pytest.fixture(scope="module")
def steady(stub: Path, tmp_path_factory: pytest.TempPathFactory) -> Iterator[tuple[LibraryBackend, Path, Path, Opened]]:
    """One backend for many tests, and the files that its library reads and writes."""
    folder = tmp_path_factory.mktemp("steady")
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("STUB_FWLIB", str(folder / "told"))
        patch.setenv("STUB_FWLIB_CALLS", str(folder / "calls"))
        backend = LibraryBackend(FocasConfig(backend="library", library=str(stub), timeout_s=2))
        opened = backend.open()
        yield backend, folder / "told", folder / "calls", opened
        backend.close()


Steady = tuple[LibraryBackend, Path, Path, Opened]


def opened_by(stub: Path, **options: object) -> tuple[LibraryBackend, Opened]:
    backend = LibraryBackend(FocasConfig.model_validate({"backend": "library", "library": str(stub), "timeout_s": 0.5} | options))
    return backend, backend.open()


def test_all_structures_are_those_of_the_header(steady: Steady) -> None:
    backend, told, _, opened = steady
    told.write_text("")
    assert (opened.code, opened.identity) == (0, ("31", "M", "G421", "40.1", ("X", "Y", "Z")))
    found = {one.key: one.value for answer in backend.ask(EVERY) for one in answer.found}
    assert {key: value for key, value in found.items() if not key.startswith(("status.", "clock."))} == {
        "program.number": 9001,
        "program.main": 1701,
        "sequence": 144,
        "feed": 3200.5,
        "spindle_rpm": 8500,
        "position.X": -399.311,
        "position.Y": -248.315,
        "position.Z": -386.0,
        "servo_load.X": -5,
        "servo_load.Y": 5,
        "servo_load.Z": 15,
        "spindle_load": 11.5,
        "block": "T2 M6\nG0 X1.\nM30",
        "modal.M": 6,
        "modal.S": 8500,
        "modal.T": 2,
        "modal.F": 3000,
        "modal.H": 17,
        "modal.D": 27,
        "tool": 12,
        "pmc.F10:4": 6,
        "program.name": "O9001",
        "alarms": "SV0401 SERVO ALARM",
        "alarm_list": alarms_text([ListedAlarm("SV0401", "SERVO ALARM", active=True)]),
        "alarm_history": alarms_text(
            [
                *(ListedAlarm("OT0500", "+X OVERTRAVEL", since="2026-05-13T22:04:05") for _ in range(9)),
                ListedAlarm("SV0401", "SERVO ALARM", since="2026-05-14T09:30:15"),
            ],
            newest_last=True,
        ),
        "operator_message": "CHECK COOLANT",
        "program.comment": "BASE PLATE",
        "macro.500": 80.125,
        "macro.501": None,
        "pmc.D300:2s": -2,
        "life.used": 37,
        "life.limit": 60,
        "modal.G2": "G90",
        "offset.length_wear": 101.25,
    }
    assert [found[f"status.{word}"] for word in ("aut", "run", "motion", "mstb", "emergency", "alarm", "edit")] == [
        1,
        3,
        1,
        1,
        0,
        0,
        0,
    ]
    assert [value for key, value in found.items() if key.startswith("clock.")] == [2026, 5, 14, 9, 30, 15]


@pytest.mark.parametrize("code", [code for code in CODES if code != 0])
def test_each_code_of_one_function_comes_through_and_leaves_the_others_alone(code: int, steady: Steady) -> None:
    backend, told, _, _ = steady
    told.write_text(f"cnc_rdspmeter {code}\n")
    status, load = backend.ask([STATUS, LOAD])
    assert (load.code, load.found) == (code, ())
    assert status.code == 0
    told.write_text("")
    assert backend.ask([LOAD])[0].code == 0


def test_spindle_speed_falls_back_where_rdspeed_is_missing(steady: Steady) -> None:
    backend, told, _, _ = steady
    for lines, speed in (
        ("cnc_rdspeed 1\n", 8502),
        ("cnc_rdspeed 1\ncnc_acts2 1\n", 8501),
        ("cnc_rdspeed 1\ncnc_acts2 1\ncnc_acts 1\n", 8500),
    ):
        told.write_text(lines)
        assert {one.key: one.value for one in backend.ask([Request(Call.DYNAMIC)])[0].found}["spindle_rpm"] == speed
    told.write_text("")


def test_only_functions_that_read_are_called(steady: Steady) -> None:
    backend, told, calls, _ = steady
    told.write_text("")
    backend.ask(EVERY)
    called = set(calls.read_text().split())
    assert called <= fwlib.READS
    assert called >= {"cnc_statinfo", "cnc_rddynamic2", "pmc_rdpmcrng"}
    assert not any(name.startswith(("cnc_wr", "pmc_wr", "cnc_dwn", "cnc_del", "cnc_clr", "cnc_reset")) for name in fwlib.READS)


@pytest.mark.parametrize("code", [-16, -15, -8, 1, 9])
def test_no_handle_is_a_code(code: int, stub: Path, say: Say) -> None:
    say(f"cnc_allclibhndl3 {code}\n")
    backend, opened = opened_by(stub)
    assert opened.code == code
    assert backend.ask([STATUS])[0].code == SOCKET


def test_a_library_that_cannot_be_loaded_is_said(tmp_path: Path) -> None:
    backend, opened = opened_by(tmp_path / "libfwlib32.so")
    assert (opened.code, "cannot open shared object" in opened.why) == (NODLL, True)
    backend.close()


def test_a_library_that_hangs_is_killed_when_its_time_is_over(stub: Path, say: Say) -> None:
    say("cnc_rdspmeter hang\n")
    backend, opened = opened_by(stub)
    assert opened.code == 0
    began_s = time.monotonic()
    assert {answer.code for answer in backend.ask([STATUS, LOAD])} == {SOCKET}
    assert time.monotonic() - began_s < 20.0, "it hangs for ever"
    say("")
    assert backend.open().code == 0
    assert backend.ask([LOAD])[0].code == 0
    backend.close()


def test_a_library_that_crashes_takes_only_its_own_process_with_it(stub: Path, say: Say) -> None:
    say("cnc_rdspmeter abort\n")
    backend, _ = opened_by(stub)
    assert {answer.code for answer in backend.ask([STATUS, LOAD])} == {SOCKET}
    say("cnc_sysinfo abort\n")
    assert backend.open() == Opened(SOCKET, why="the library's process ended by signal 6")


def test_the_path_of_the_control_is_chosen(stub: Path, say: Say, tmp_path: Path) -> None:
    say("")
    backend, opened = opened_by(stub, path=2)
    assert opened.code == 0
    assert "cnc_setpath" in (tmp_path / "calls").read_text()
    backend.close()
    _, opened = opened_by(stub, path=3)
    assert opened.code == 11


def test_an_edge_by_the_library_shows_the_tool_of_cnc_toolnum(stub: Path, say: Say) -> None:
    say("")
    config = EdgeConfig(source=FocasConfig(backend=Backend.LIBRARY, library=str(stub)))
    rows = {row.signal: row for row in describe(config)}
    assert (rows["tool_number"].source, rows["tool_number"].value) == ("cnc_toolnum", 12)
    assert (rows["spindle_override_pct"].value, rows["feed_override_pct"].value) == (120.0, 100.0)
    say("cnc_toolnum 6\ncnc_rdspmeter 1\n")
    refused = {row.signal: row for row in describe(config)}
    assert refused["tool_number"].source == "cnc_modal T"
    assert str(refused["spindle_load_pct"].reason).startswith("EW_FUNC (1)")
