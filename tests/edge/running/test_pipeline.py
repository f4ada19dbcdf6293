"""From frames to rows."""

from edge.config import EdgeConfig, ReportSection, SignalSection
from edge.controls.mtconnect.config import MtconnectConfig
from edge.running.pipeline import Pipeline, rows_of
from edge.sample import Drop, EdgeSample, SampleSet


def frame(*samples: EdgeSample, backlog: int = 0, error: str | None = None) -> SampleSet:
    return SampleSet(samples, received=len(samples), backlog=backlog, error=error)


def pipeline(**signals: SignalSection) -> Pipeline:
    return Pipeline(EdgeConfig(source=MtconnectConfig(), signals=signals, report=ReportSection()))


def rows(*samples: EdgeSample) -> list[list[object]]:
    return [[sample.value for sample in row] for row in rows_of(samples)]


def test_a_row_holds_what_changed_at_one_moment() -> None:
    assert rows(EdgeSample("a", 1, 10), EdgeSample("b", 2, 10), EdgeSample("a", 3, 11)) == [[1, 2], [3]]


def test_a_signal_that_comes_twice_at_one_moment_begins_a_new_row() -> None:
    assert rows(EdgeSample("a", 1, 10), EdgeSample("a", 2, 10)) == [[1], [2]]


def test_the_state_as_found_is_one_row_whatever_its_age() -> None:
    assert rows(EdgeSample("a", 1, 10, is_baseline=True), EdgeSample("b", 2, 99, is_baseline=True), EdgeSample("c", 3, 99)) == [
        [1, 2, 3]
    ]


def test_each_observation_is_published_or_dropped_with_a_reason() -> None:
    one = pipeline(feed_mm_min=SignalSection(deadband=5))
    news = [EdgeSample("feed_mm_min", value, at) for at, value in enumerate((100.0, 103.0, 103.0, 110.0, 110.0))]
    outcome = one.take(frame(*news), arrival_s=0)
    assert [[s.value for s in row] for row in outcome.rows] == [[100.0], [110.0]]
    assert outcome.dropped == {Drop.DEADBAND: 2, Drop.UNCHANGED: 1}


def test_a_silent_agent_takes_the_clock_on_and_ends_a_change() -> None:
    one = pipeline()
    change = [EdgeSample("tool_number", 1, 0), EdgeSample("nc_block", "T2 M6", 1000), EdgeSample("tool_number", 2, 5000)]
    outcome = one.take(frame(*change), arrival_s=100)
    assert [s.value for row in outcome.rows for s in row if s.signal == "tool_change_active"] == [False, True]
    assert one.held == 1
    assert one.take(frame(), arrival_s=101.9).rows == ()
    (row,) = one.take(frame(), arrival_s=102).rows
    assert [(s.signal, s.value, s.timestamp_ms) for s in row][:2] == [
        ("tool_number", 2, 5000),
        ("tool_change_active", False, 5000),
    ]
    assert one.held == 0


def test_an_agent_that_has_more_or_fails_says_nothing_of_the_time() -> None:
    one = pipeline()
    one.take(frame(EdgeSample("tool_number", 1, 0), EdgeSample("tool_number", 2, 5000)), arrival_s=100)
    assert one.take(frame(backlog=3), arrival_s=200).rows == ()
    assert one.take(frame(error="no answer"), arrival_s=200).rows == ()
    assert one.held == 1


def test_a_cue_is_never_published_and_counts_as_evidence() -> None:
    one = pipeline()
    cues = [EdgeSample("tool_number", 1, 0), *(EdgeSample("tool_change_cue", at >= 2, at * 100, reason="M6") for at in range(4))]
    outcome = one.take(frame(*cues), arrival_s=0)
    published = [s for row in outcome.rows for s in row]
    assert "tool_change_cue" not in {s.signal for s in (*published, *one.last)}
    assert [(s.value, s.timestamp_ms) for s in published if s.signal == "tool_change_active"] == [(False, 0), (True, 200)]
    assert outcome.dropped == {Drop.EVIDENCE: 4}


def test_asking_for_the_memory_changes_nothing_and_what_is_noted_is_not_given_again() -> None:
    pipeline = Pipeline(EdgeConfig(source=MtconnectConfig()))
    pipeline.take(SampleSet((EdgeSample("tool_number", 7, 1_000),), received=1), arrival_s=0.0)
    first = pipeline.memory()
    assert first is not None
    assert pipeline.memory() == first
    pipeline.keep_memory()
    assert pipeline.memory() is None
