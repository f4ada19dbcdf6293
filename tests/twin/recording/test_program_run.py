"""Runs of programs: where they begin and end, what is a pause, what the columns say. Made by hand, and as recorded."""

import numpy as np
import pytest

from benchmarks.programs.time import overrides_moved
from tests.recordings import recording
from twin.errors import RunLogError
from twin.recording.observations import Observation, Observations, last_values, read_observations
from twin.recording.program_run import COLUMNS, Ending, ProgramRun, program_runs


def observed(*rows: tuple[float, str, object]) -> Observations:
    return Observations(tuple(Observation(t, key, str(value)) for t, key, value in rows), 0)


def counter(start: float, first: int, last: int) -> list[tuple[float, str, object]]:
    return [(start + n - first, "Program_Runtime_Seconds", n) for n in range(first, last + 1)]


def test_a_counter_that_stands_is_a_pause_whatever_the_status_says() -> None:
    rows = [
        (0.0, "Program_Status", "ACTIVE"),
        *counter(1.0, 1, 10),
        *counter(41.0, 11, 20),
        (51.0, "Program_Status", "PROGRAM_COMPLETED"),
    ]
    (run,) = program_runs(observed(*rows))
    assert len(run.pauses) == 1
    assert run.pauses[0].duration_s == pytest.approx(30.0)
    assert run.pauses[0].reason == "counter stands"
    assert run.duration_s == 51.0
    assert run.active_s == pytest.approx(21.0)
    assert run.active(np.array([5.0, 20.0, 50.0])).tolist() == pytest.approx([5.0, 10.5, 20.0])


def test_stale_and_stray_counts_are_no_pauses() -> None:
    rows = [
        (0.0, "Program_Status", "ACTIVE"),
        (0.1, "Program_Runtime_Seconds", 1441),
        *counter(1.0, 1, 10),
        (10.2, "Program_Runtime_Seconds", 5),
        *counter(11.0, 11, 20),
        (20.5, "Program_Status", "PROGRAM_COMPLETED"),
    ]
    (run,) = program_runs(observed(*rows))
    assert run.pauses == ()


def test_a_feed_hold_is_named() -> None:
    rows = [
        (0.0, "Program_Status", "ACTIVE"),
        *counter(1.0, 1, 5),
        (5.2, "Program_Status", "FEED_HOLD"),
        (14.0, "Program_Status", "ACTIVE"),
        *counter(15.0, 6, 9),
        (18.5, "Program_Status", "PROGRAM_COMPLETED"),
    ]
    (run,) = program_runs(observed(*rows))
    assert [pause.reason for pause in run.pauses] == ["FEED_HOLD"]


def test_after_a_stop_the_counter_tells_a_new_run_from_the_same_one() -> None:
    def stopped(then: int) -> list[ProgramRun]:
        rows = [
            (0.0, "Program_Status", "ACTIVE"),
            *counter(1.0, 1, 5),
            (6.0, "Program_Status", "STOPPED"),
            (60.0, "Program_Status", "ACTIVE"),
            *counter(61.0, then, then + 5),
            (67.0, "Program_Status", "PROGRAM_COMPLETED"),
        ]
        return program_runs(observed(*rows))

    assert [run.ending for run in stopped(6)] == [Ending.COMPLETED]
    assert [run.ending for run in stopped(1)] == [Ending.ABORTED, Ending.COMPLETED]


def test_columns_are_those_of_a_run_log_in_canonical_units() -> None:
    rows = [
        (0.0, "Program_Status", "ACTIVE"),
        (1.0, "Block_Number", 12),
        (1.0, "Feed_Rate", 50.8),
        (2.0, "Current_Tool", "0.000000"),
        (3.0, "Current_Tool", "7.000000"),
        (4.0, "Rapid_Override", "52.000000"),
        (5.0, "Program_Status", "PROGRAM_COMPLETED"),
    ]
    (run,) = program_runs(observed(*rows), {"Rapid_Override": "30", "Block_Number": "4160"})
    columns = run.columns
    assert set(columns) == set(COLUMNS)
    assert columns["t_s"].tolist() == [0.0, 1.0, 2.0, 3.0, 4.0, 5.0]
    assert columns["line"].tolist() == [-1, 11, 11, 11, 11, 11]
    assert columns["feed_mm_min"][1] == pytest.approx(120 * 25.4)
    assert columns["tool_number"].tolist() == [-1, -1, 0, 7, 7, 7]
    assert columns["tool_change_active"].tolist() == [False, False, True, False, False, False]
    assert columns["rapid_override_pct"].tolist() == [30.0, 30.0, 30.0, 30.0, 52.0, 52.0]
    assert columns["exec_state"][-1] == "PROGRAM_COMPLETED"
    assert overrides_moved(run) == ("rapid",)


def test_a_recording_in_which_nothing_ran_is_refused() -> None:
    with pytest.raises(RunLogError, match="no program ran"):
        program_runs(observed((0.0, "Feed_Rate", 1.0)))


def plate(name: str) -> list[ProgramRun]:
    return program_runs(read_observations(recording(f"nist/plate/Plate-Hurco04-{name}of20.txt").read_text()))


def test_the_pause_of_plate_11_is_found_by_its_counter_alone() -> None:
    run = plate("11")[0]
    assert run.duration_s == pytest.approx(3480.5, abs=0.1)
    assert run.active_s == pytest.approx(1120.0, abs=2.0)  # where its counter ended
    assert max(pause.duration_s for pause in run.pauses) == pytest.approx(2357.0, abs=2.0)


def test_plate_04_was_aborted_and_run_again_and_every_plate_has_its_back_face_days_later() -> None:
    runs = plate("04")
    assert [run.ending for run in runs] == [Ending.ABORTED, Ending.COMPLETED, Ending.COMPLETED]
    assert runs[2].started_s - runs[0].started_s > 4 * 86400.0
    assert runs[2].active_s == pytest.approx(52.1, abs=0.1)


def test_plate_13_has_neither_pause_nor_knob_and_plate_01_has_both() -> None:
    clean, disturbed = plate("13")[0], plate("01")[0]
    assert clean.pauses == ()
    assert overrides_moved(clean) == ()
    assert sum(pause.reason == "FEED_HOLD" for pause in disturbed.pauses) >= 6
    assert set(overrides_moved(disturbed)) == {"feed", "rapid"}


def test_a_recording_hands_its_knobs_on() -> None:
    eleven = read_observations(recording("nist/plate/Plate-Hurco04-11of20.txt").read_text())
    thirteen = read_observations(recording("nist/plate/Plate-Hurco04-13of20.txt").read_text())
    run = program_runs(thirteen, last_values(eleven.rows))[0]
    assert set(np.asarray(run.columns["rapid_override_pct"]).tolist()) == {52.0}
