"""Parts of real machines: the ticks that are read of them, parts beside parts, and parts under another program's label."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest

from benchmarks.recorded import alignment
from benchmarks.recorded.happened import happened
from benchmarks.recorded.labels import Trial, outcome
from benchmarks.recorded.parts import Part, nist_parts, operations
from benchmarks.recorded.replaying import judgement, recorded, taught
from benchmarks.recorded.study import by_text
from tests.recordings import recording, recordings_folder
from twin.anomaly.alarm import AlarmRule
from twin.anomaly.parts.model import PartsModel

RULE = AlarmRule(1.5, 2)
"""Tails that a handful of parts teach are narrow; what is found here stands ten times above them."""


@pytest.fixture(scope="module")
def covers() -> Sequence[Part]:
    recording("nist/cover/Cover-Hurco04-01of20.txt")
    return nist_parts(recordings_folder(), "cover")


@pytest.fixture(scope="module")
def plates() -> Sequence[Part]:
    recording("nist/plate/Plate-Hurco04-01of20.txt")
    return nist_parts(recordings_folder(), "plate")


@pytest.fixture(scope="module")
def model(plates: Sequence[Part]) -> PartsModel:
    return taught(by_text([part for part in plates if part.label in ("PLATE-13", "PLATE BACK FACE")]), None)


def named(parts: Sequence[Part], name: str) -> Part:
    return next(part for part in parts if part.name == name)


def test_a_part_is_told_a_row_a_second_with_line_and_tool(covers: Sequence[Part]) -> None:
    part = named(covers, "cover 02/4")
    assert part.label == "COVER OP2"
    assert part.ticks == pytest.approx(860, abs=2)
    assert part.values.shape == (part.ticks, 2)
    assert part.line.min() >= 0
    assert [name for name, ticks in operations(part) if len(ticks) > 20] == ["T15|1", "T3|1", "T1|1", "T5|1", "T23|1"]


def test_what_stands_between_two_parts_is_no_program(covers: Sequence[Part]) -> None:
    one, spans = recorded(by_text(covers[:2]), None)
    between = np.arange(spans[0].end, spans[1].begin)
    assert len(between) == 60
    assert (one.program[between] == -1).all()
    assert (one.values[between] == 0.0).all()
    assert [one.programs[one.program[span.begin]] for span in spans] == [part.text for part in covers[:2]]


def test_parts_made_alike_raise_no_alert_and_are_judged_from_the_second_on(covers: Sequence[Part], model: PartsModel) -> None:
    alike = by_text([part for part in covers if part.label in ("COVER OP2", "COVER OP3")])
    found = judgement(model, alike, RULE, None)
    assert found.alerts == []
    firsts = [span for span in found.spans if span.part.name in ("cover 01/2", "cover 01/3")]
    assert [found.judged_s(span) for span in firsts] == [0.0, 0.0]
    others = [found.judged_s(span) / span.part.ticks for span in found.spans if span not in firsts]
    assert len(others) == 6
    assert min(others) > 0.75


def test_a_part_under_another_label_is_found_and_the_facts_are_named(plates: Sequence[Part], model: PartsModel) -> None:
    history, part = named(plates, "plate 01/1"), named(plates, "plate 13/1")
    trial = Trial(part, "PLATE-1", is_right=False, history=[history])
    found = outcome(model, trial, RULE, recordings_folder())
    assert found.alert is not None
    assert found.alert.at_s < 60.0
    assert "PLATE-13" in happened(part.labelled("PLATE-1"), found.alert.at_s, history, None)


def test_a_change_that_is_planted_in_the_second_part_is_found(covers: Sequence[Part], model: PartsModel) -> None:
    first, second = (named(covers, name) for name in ("cover 01/2", "cover 02/4"))
    from_tick = 400
    values = second.values.copy()
    values[from_tick:, 0] *= 0.9  # the spindle turns a tenth slower
    found = judgement(model, [first, replace(second, values=values)], RULE, None)
    assert [alert.why.signal for alert in found.alerts][:1] == ["spindle_rpm"]
    assert 0.0 <= found.alerts[0].at_s - from_tick < 30.0


def test_programmed_seconds_tell_the_place_better_than_distance(covers: Sequence[Part], model: PartsModel) -> None:
    alike = [part for part in covers if part.label == "COVER OP3"][:2]
    row = alignment.table(model, alike)
    assert row is not None
    apart, operations_seen = row
    assert operations_seen == 2
    assert apart.by_seconds_s < 0.5 * apart.by_distance_s
    assert apart.aligned_s <= apart.by_seconds_s + 0.2
