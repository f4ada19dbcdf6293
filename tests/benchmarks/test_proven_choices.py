"""What may be claimed on recorded plates: a slice of benchmarks/optimise_plates.py."""

from typing import Any

import numpy as np
import pytest

from benchmarks import proven_choices as choices
from benchmarks.programs.plates import recorded_programs
from benchmarks.programs.time_fit import ProgramTimes, identify_program_times
from tests.recordings import recording
from twin.motion.limits import Limits
from twin.motion.plan import plan
from twin.recording.recorded_program import RecordedProgram

NAMES = ("03", "04", "10", "13")


@pytest.fixture(scope="module")
def runs() -> dict[str, RecordedProgram]:
    texts = [
        (
            f"plate {name}",
            recording(f"nist/nc/NIST_MTC_CRADA_PLATE-{int(name)}.NC").read_text(),
            recording(f"nist/plate/Plate-Hurco04-{name}of20.txt").read_text(),
        )
        for name in NAMES
    ]
    return {program.name: program for program in recorded_programs(texts) if not program.refusal()}


@pytest.fixture(scope="module")
def model(runs: dict[str, RecordedProgram]) -> ProgramTimes:
    """The control as plate 13 alone shows it."""
    return identify_program_times([runs["plate 13"]])


@pytest.fixture(scope="module")
def rows(runs: dict[str, RecordedProgram], model: ProgramTimes) -> list[Any]:
    host = runs["plate 13"]
    whole_mm = {tool: choices.cut_mm(host.path, span) for tool, span in choices.spans(host.path)}
    ideal = Limits(rapid_mm_min=model.limits.rapid_mm_min, acceleration_mm_s2=np.inf)
    return [row for run in runs.values() for row in choices.sections(run, model, ideal, whole_mm)]


def of(rows: list[Any], run: str, tool: int) -> Any:
    (row,) = [row for row in rows if (row.run, row.tool) == (f"plate {run}", tool)]
    return row


def test_savings_between_plates_are_predicted_within_three_percent_and_in_the_right_order(rows: list[Any]) -> None:
    of_runs = choices.wholes(rows)
    assert list(of_runs) == ["plate 03", "plate 10", "plate 13"], "the second attempt of 04 made the rest of a part"
    said = choices.savings("whole", [choices.figures(each) for each in of_runs.values()])
    assert said.rank == pytest.approx(1.0)
    assert said.right == said.clear == 3
    assert said.worst_s < 0.03 * 1455.0
    assert said.error_s < 0.5 * said.feed_error_s, "better than length over feed"


def test_the_higher_feed_takes_longer_where_its_spindle_speed_takes_longer_to_reach(rows: list[Any]) -> None:
    fast, slow = of(rows, "10", 4), of(rows, "13", 4)
    assert max(fast.choice.feeds_mm_min) > 1.9 * max(slow.choice.feeds_mm_min)
    assert fast.predicted_s > slow.predicted_s
    assert fast.recorded_s > slow.recorded_s
    assert fast.feed_s < slow.feed_s, "what length over feed says is the wrong way round"


def test_what_was_not_run_as_programmed_proves_nothing(rows: list[Any]) -> None:
    assert not of(rows, "10", 7).proven, "the operator took the feed back for a quarter of the way"
    assert of(rows, "10", 3).proven
    assert not of(rows, "04/2", 5).proven, "only the rest of this section was cut"


def test_a_plate_with_its_own_choices_is_itself_and_with_those_of_another_takes_their_feeds_and_speeds(
    runs: dict[str, RecordedProgram],
) -> None:
    host, other = runs["plate 13"], runs["plate 03"]
    own = choices.composed(host.path, {tool: (host.path, span) for tool, span in choices.spans(host.path)})
    assert np.array_equal(own.feed_mm_min, host.path.feed_mm_min)
    assert own.events == host.path.events
    spans = dict(choices.spans(host.path))
    mixed = choices.composed(host.path, {5: (other.path, dict(choices.spans(other.path))[5])})
    assert str(choices.choice_of(mixed, spans[5])) == "S12000 F20"
    assert str(choices.choice_of(mixed, spans[3])) == str(choices.choice_of(host.path, spans[3])) == "S9000 F144"


def test_only_proven_choices_are_offered_and_the_fastest_comes_first(
    runs: dict[str, RecordedProgram], rows: list[Any], model: ProgramTimes
) -> None:
    offered = choices.proven(runs["plate 03"], [runs["plate 10"], runs["plate 13"]], rows, model)
    assert {tool: str(options[0].choice) for tool, options in offered.items() if tool in {4, 5, 7}} == {
        4: "S9000 F72",
        5: "S9000 F36",
        7: "S750 F2",
    }
    assert [run for option in offered[7] for run in option.runs] == ["plate 13"]
    assert all(options[0].predicted_s <= options[-1].predicted_s for options in offered.values())


def test_the_batch_of_the_optimiser_takes_as_long_as_the_plan(runs: dict[str, RecordedProgram], model: ProgramTimes) -> None:
    several = [runs["plate 13"], runs["plate 03"], runs["plate 10"]]
    assert choices.batch_gap_s(several[0], several, model) < 1e-9
    slow, fast = (plan(run.with_set_up(model.set_up), model.limits).total_s for run in several[1:])
    assert slow > fast + 400.0, "the programs of the batch do differ"
