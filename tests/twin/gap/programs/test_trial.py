"""A recorded run beside its program: pauses, runs that were broken off, runs of other programs."""

from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from tests.recordings import recording
from tests.twin.gap.programs.written import PERIOD_S, case_of, made, plate_runs, shop_program, whole_program
from twin.gap.programs.trial import Refused, Trial, section_feed_ratios, trial_of
from twin.programs import Settings
from twin.recording.observations import read_observations
from twin.recording.program_run import program_runs
from twin.runlog import run_log

TOOLS = (1, 2, 3)
CHANGE = {"tool_change_time": {"change_s": 4.0}}
Columns = dict[str, NDArray[np.generic]]


def columns(feed: float = 2000.0, tools: tuple[int, ...] = TOOLS) -> Columns:
    return made(shop_program(feed, tools), CHANGE)


def read(folder: Path, recorded: Columns, program: str = shop_program(2000.0, TOOLS)) -> Trial | Refused:
    (run,) = case_of(folder, {"run": ("fit", run_log(recorded), program)}).runs
    return trial_of(run, Settings())


def standing(recorded: Columns, row: int, seconds: float, state: str = "ACTIVE") -> Columns:
    """The run with its axes at rest for so long from a row on."""
    rows = round(seconds / PERIOD_S)
    longer = {name: np.insert(values, [row] * rows, values[row]) for name, values in recorded.items()}
    longer["t_s"] = np.arange(len(longer["line"])) * PERIOD_S
    feed = np.asarray(longer["feed_mm_min"], dtype=np.float64)
    feed[row : row + rows] = 0.0
    longer["exec_state"] = np.array(longer["exec_state"], dtype=object)
    longer["exec_state"][row : row + rows] = state
    return longer


def test_an_undisturbed_run_is_compared_whole(tmp_path: Path) -> None:
    trial = read(tmp_path, columns())
    assert isinstance(trial, Trial)
    assert trial.recorded.run.pauses == () and trial.remarks == ()
    assert [name for _, name in trial.sections] == ["section T1", "section T2", "section T3"]
    assert trial.resolution_s == pytest.approx(PERIOD_S)
    assert section_feed_ratios(trial.recorded) == pytest.approx({1: 1.0, 2: 1.0, 3: 1.0})


@pytest.mark.parametrize(("state", "seconds"), [("FEED_HOLD", 6.0), ("ACTIVE", 30.0)], ids=["held", "at rest"])
def test_a_pause_is_taken_out_and_said(tmp_path: Path, state: str, seconds: float) -> None:
    plain = columns()
    line = np.asarray(plain["line"])
    cut = int(np.bincount(line[np.isclose(np.asarray(plain["feed_mm_min"], dtype=np.float64), 2000.0)]).argmax())
    row = int(np.flatnonzero(line == cut)[3])
    trial = read(tmp_path, standing(plain, row, seconds, state))
    assert isinstance(trial, Trial)
    assert trial.recorded.run.active_s == pytest.approx(float(plain["t_s"][-1]), abs=2 * PERIOD_S)
    (remark,) = trial.remarks
    assert remark.startswith(f"was interrupted once, {seconds:.0f} s ") and f"at line {cut + 1} " in remark


def test_a_tool_change_is_no_pause_and_an_operator_in_it_is(tmp_path: Path) -> None:
    plain = columns()
    row = int(np.flatnonzero(np.asarray(plain["tool_change_active"]))[2])
    trial = read(tmp_path, standing(plain, row, 60.0))
    assert isinstance(trial, Trial)
    assert trial.recorded.run.active_s == pytest.approx(float(plain["t_s"][-1]), abs=1.0)


def test_a_run_that_was_broken_off_is_said_with_the_line_it_came_to(tmp_path: Path) -> None:
    plain = columns()
    half = len(plain["line"]) // 2
    refused = read(tmp_path, {name: values[:half] for name, values in plain.items()})
    assert isinstance(refused, Refused)
    assert refused.why.startswith(f"was interrupted and not finished: it came to line {int(plain['line'][half - 1]) + 1} ")


def test_a_run_of_another_program_is_said_by_its_lines_its_tools_or_its_feeds(tmp_path: Path) -> None:
    longer = read(tmp_path, columns(tools=(1, 2, 3, 4)))
    assert isinstance(longer, Refused) and "ran another program than the one given: it ended at line" in longer.why
    other_tools = read(tmp_path, columns(tools=(1, 6, 5)))
    assert isinstance(other_tools, Refused) and "the program has 2" in other_tools.why
    text = shop_program(2000.0, TOOLS)
    second = text.index("T2 M6")
    mixed = text[:second] + text[second:].replace("F2000", "F1400")
    other_feeds = read(tmp_path, made(mixed, CHANGE))
    assert isinstance(other_feeds, Refused)
    assert "its feeds are T1 100 %, T2 70 %, T3 70 % of the programmed ones, and no override was recorded" in other_feeds.why


def test_a_knob_that_stood_elsewhere_all_the_time_is_no_other_program(tmp_path: Path) -> None:
    trial = read(tmp_path, made(shop_program(2000.0, TOOLS), CHANGE | {"feed_override": {"ratio": 0.7}}))
    assert isinstance(trial, Trial)
    assert section_feed_ratios(trial.recorded) == pytest.approx({1: 0.7, 2: 0.7, 3: 0.7})


def test_lines_may_be_told_by_their_n_words(tmp_path: Path) -> None:
    text = shop_program(2000.0, TOOLS)
    numbered = "\n".join(f"N{10 * n} {line}" if line[:1].isalpha() else line for n, line in enumerate(text.splitlines())) + "\n"
    recorded = columns() | {"line": np.asarray(columns()["line"]) * 10}
    trial = read(tmp_path, recorded, numbered)
    assert isinstance(trial, Trial)
    np.testing.assert_array_equal(trial.recorded.run.columns["line"], columns()["line"])


@pytest.mark.parametrize(
    ("drop", "program", "why"),
    [
        ("line", None, "no column line"),
        ("", "G1 X10\n", "program given is refused, line 1"),
        ("", "(nothing)\n", "moves nothing"),
    ],
)
def test_what_cannot_be_compared_says_why(tmp_path: Path, drop: str, program: str | None, why: str) -> None:
    recorded = {name: values for name, values in columns().items() if name != drop}
    refused = read(tmp_path, recorded, program or shop_program(2000.0, TOOLS))
    assert isinstance(refused, Refused) and why in refused.why


def test_pauses_of_recorded_plates_come_close_to_the_running_time_that_the_control_counted(tmp_path: Path) -> None:
    counted = program_runs(read_observations(recording("nist/plate/Plate-Hurco04-11of20.txt").read_text()))[0].active_s
    trial = read(tmp_path, plate_runs("11")[0], whole_program("11"))
    assert isinstance(trial, Trial)
    assert trial.recorded.run.active_s == pytest.approx(counted, rel=0.01)
    assert trial.recorded.run.duration_s > 3.0 * counted
    assert "(N2590M01); taken out" in trial.remarks[0]


def test_a_recorded_plate_beside_the_program_of_another_is_said_to_be_so(tmp_path: Path) -> None:
    for other in ("03", "14", "19", "04"):
        refused = read(tmp_path, plate_runs("13")[0], whole_program(other))
        assert isinstance(refused, Refused) and "ran another program than the one given" in refused.why


def with_subprogram(shift_mm: float = 0.0) -> str:
    """The program of the shop with a pocket that stands after M30, called once for each tool."""
    called = shop_program(2000.0, TOOLS).replace("M5\n", "M98 P9\nM5\n").removesuffix("%\n")
    return f"{called}O9\nG91 F1200\n" + f"G1 X{12 + shift_mm} Y3\nG1 X-{12 + shift_mm} Y-3\n" * 4 + "G90\nM99\n%\n"


def test_a_subprogram_after_m30_is_compared_where_it_is_called(tmp_path: Path) -> None:
    text = with_subprogram()
    trial = read(tmp_path, made(text, CHANGE), text)
    assert isinstance(trial, Trial)
    _, line = trial.recorded.run.line_changes()
    highest = int(trial.recorded.path.line.max())
    assert highest > text.splitlines().index("M30") and line[-1] > highest - 5
    assert [name for _, name in trial.sections] == ["section T1", "section T2", "section T3"]


def test_a_line_beyond_a_subprogram_is_another_program(tmp_path: Path) -> None:
    text = with_subprogram()
    recorded = made(text, CHANGE)
    line = np.array(recorded["line"])
    line[-20:] = len(text.splitlines()) + 40
    refused = read(tmp_path, recorded | {"line": line}, text)
    assert isinstance(refused, Refused) and "another program" in refused.why


KLARTEXT = """0 BEGIN PGM SHOP MM
1 TOOL CALL 1 Z S3000
2 CYCL DEF 200 DRILLING ~
    Q200=+2 ~
    Q201=-5 ~
    Q206=+500 ~
    Q202=+5 ~
    Q210=+0 ~
    Q203=+0 ~
    Q204=+20 ~
    Q211=+0
3 L X+10 Y+10 R0 FMAX M3
4 CYCL CALL
5 L X+80 F1000
6 L Y+60
7 L X+10
8 L Y+10
9 M30
10 END PGM SHOP MM
"""


@pytest.mark.parametrize(
    "numbers", [None, {1: 1, 11: 3, 12: 4, 13: 5, 14: 6, 15: 7, 16: 8, 17: 9}], ids=["lines", "block numbers"]
)
def test_a_control_that_numbers_its_blocks_may_tell_these_numbers(tmp_path: Path, numbers: dict[int, int] | None) -> None:
    recorded = made(KLARTEXT, {})
    if numbers is not None:
        recorded["line"] = np.array([numbers[int(line)] for line in np.asarray(recorded["line"])], dtype=np.float64)
    trial = read(tmp_path, recorded, KLARTEXT)
    assert isinstance(trial, Trial)
    assert set(trial.recorded.run.columns["line"].tolist()) == set(made(KLARTEXT, {})["line"].tolist())
