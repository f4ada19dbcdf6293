"""The detector as a processor: what it says, what it cannot know, and that a restart changes nothing."""

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from pydantic import TypeAdapter

from benchmarks import synthetic_changes as drive
from benchmarks import tool_change_detector as bench
from processors.actions import Action, DeadLetter
from processors.errors import ConfigurationError
from processors.running.snapshot import decode_state, encode_state
from processors.tool_change_detector.processor import ACTIVE, BASIS, CONFIDENCE, PHASE, PROCESSOR, SOURCE
from sparkplug.host_session import EventKind, HostEvent
from sparkplug.metric import Change
from sparkplug.quality import Quality
from tests.processors.streams import birth, data, death, engine_of, event, fed, hole, published, reading
from tests.recordings import recording
from tests.twin.transient.synthetic import small
from twin.transient.artefact import save_detector
from twin.transient.replay import replayed

CURRENT = "spindle_current_a"


@pytest.fixture(scope="module")
def model(tmp_path_factory: pytest.TempPathFactory) -> str:
    folder = tmp_path_factory.mktemp("model")
    save_detector(folder, small(), ("a.parquet",), {}, 1.0)
    return str(folder)


def told(engine: Any) -> dict[str, Change]:
    """Return what a reader knows by now."""
    latest: dict[str, Change] = engine._machines["okuma"].live.emission.latest
    return latest


def stream_of(values: Any, begin_s: float = 0.0) -> list[HostEvent]:
    """Reports by exception, of a current at 10 Hz."""
    events, last = [], None
    for n, value in enumerate(values):
        shown = round(float(value), 3)
        if shown != last:
            make = birth if not events and not begin_s else data
            events.append(make(begin_s + n * 0.1, **{CURRENT: shown}))
            last = shown
    return events


def change(quiet_s: float = 40.0) -> Any:
    quiet = np.ones(round(quiet_s / 0.1))
    return np.concatenate([quiet, drive.changed(1.1, 1.5, 3.5), quiet])


def values_of(actions: list[Action], name: str) -> list[Any]:
    """The values of one output, in the order of their publication, without the nulls."""
    return [value for _, which, value, _ in published(actions) if which == name and value is not None]


def test_without_a_model_it_says_so_and_never_no() -> None:
    engine = engine_of(PROCESSOR)
    actions = fed(engine, *stream_of(change()))
    assert values_of(actions, ACTIVE) == []
    assert "cnctwin train detector" in (told(engine)[ACTIVE].reason or "")
    assert told(engine)[SOURCE].value == "none"


def test_a_change_opens_the_gate_provisionally_is_confirmed_and_closes_it(model: str) -> None:
    engine = engine_of(PROCESSOR, model=model)
    actions = fed(engine, *stream_of(change()), data(100.0, **{CURRENT: 1.1}))
    assert values_of(actions, PHASE) == ["none", "provisional", "confirmed", "none"]
    assert values_of(actions, ACTIVE) == [False, True, False]
    assert told(engine)[SOURCE].value == "detector"
    opened_ms = next(at for at, name, value, _ in published(actions) if name == ACTIVE and value is True)
    assert 40_000 < opened_ms < 45_000, "while the spindle stops, not when all is over"
    assert max(values_of(actions, CONFIDENCE)) > 0.9


def test_a_gate_that_may_not_open_early_opens_when_the_pattern_is_whole(model: str) -> None:
    actions = fed(engine_of(PROCESSOR, model=model, opens_early=False), *stream_of(change()), data(100.0, **{CURRENT: 1.1}))
    assert values_of(actions, PHASE) == ["none", "provisional", "confirmed", "none"]
    confirmed_ms = next(at for at, name, value, _ in published(actions) if name == PHASE and value == "confirmed")
    assert next(at for at, name, value, _ in published(actions) if name == ACTIVE and value is True) == confirmed_ms


def test_a_lower_score_finds_what_is_less_alike(model: str) -> None:
    odd = change()
    odd[440:480] = 3.0
    stream = [*stream_of(odd), data(110.0, **{CURRENT: 1.1})]
    assert "confirmed" not in values_of(fed(engine_of(PROCESSOR, model=model), *stream), PHASE)
    assert "confirmed" in values_of(fed(engine_of(PROCESSOR, model=model, pattern_score=0.1), *stream), PHASE)


def test_a_stop_for_good_is_retracted(model: str) -> None:
    stop = drive.changed(1.0, 0.0, 3.0)[:22]
    engine = engine_of(PROCESSOR, model=model)
    actions = fed(engine, *stream_of(np.concatenate([np.ones(400), stop, np.full(10, stop[-1])])), data(120.0, tool_number=3))
    assert values_of(actions, PHASE) == ["none", "provisional", "retracted", "none"]
    assert values_of(actions, ACTIVE)[-1] is False


def test_before_a_whole_change_could_have_been_seen_it_does_not_say_no(model: str) -> None:
    engine = engine_of(PROCESSOR, model=model)
    fed(engine, birth(0.0, **{CURRENT: 1.0}), data(5.0, **{CURRENT: 1.1}))
    assert told(engine)[ACTIVE].value is None
    assert "of a change" in (told(engine)[ACTIVE].reason or "")
    fed(engine, data(30.0, **{CURRENT: 1.0}))
    assert told(engine)[ACTIVE].value is False, "a value that is not reported again still holds"


@pytest.mark.parametrize(
    ("bad", "source", "words"),
    [
        (reading(CURRENT, None, 35.0, quality=Quality.BAD, reason="UNAVAILABLE"), "none", "UNAVAILABLE"),
        (reading(CURRENT, 1.0, 35.0, quality=Quality.STALE, reason="edge offline"), "stale", "edge offline"),
        (reading(CURRENT, float("nan"), 35.0), "none", "nan"),
    ],
    ids=["null", "stale", "not a number"],
)
def test_a_signal_that_is_not_known_is_said_at_the_next_tick(model: str, bad: Any, source: str, words: str) -> None:
    engine = engine_of(PROCESSOR, model=model)
    fed(engine, *stream_of(np.ones(300)), data(34.0, **{CURRENT: 1.1}))
    fed(engine, event(EventKind.DATA, 35.0, bad), data(36.0, tool_number=1))
    assert told(engine)[ACTIVE].value is None and told(engine)[PHASE].value is None
    assert words in (told(engine)[ACTIVE].reason or "")
    assert told(engine)[SOURCE].value == source


def test_another_signal_than_the_models_is_not_enough(model: str) -> None:
    engine = engine_of(PROCESSOR, model=model)
    fed(engine, birth(0.0, spindle_rpm=5000.0), data(60.0, spindle_rpm=0.0))
    assert told(engine)[ACTIVE].reason == f"{CURRENT} is not offered"


def test_after_lost_messages_it_has_to_see_a_whole_change_again(model: str) -> None:
    engine = engine_of(PROCESSOR, model=model)
    fed(engine, *stream_of(np.ones(400) + 0.001 * np.arange(400)), hole(41.0), data(42.0, **{CURRENT: 1.0}))
    assert told(engine)[ACTIVE].value is None
    assert "3 messages are lost" in (told(engine)[ACTIVE].reason or "")
    fed(engine, data(70.0, **{CURRENT: 1.1}))
    assert told(engine)[ACTIVE].value is False


def test_where_the_control_reports_itself_that_is_said(model: str) -> None:
    engine = engine_of(PROCESSOR, model=model)
    fed(engine, birth(0.0, **{CURRENT: 1.0, "tool_change_active": False}), data(40.0, **{CURRENT: 1.1}))
    assert "the control itself reports tool_change_active" in told(engine)[BASIS].value  # type: ignore[operator]
    assert told(engine)[ACTIVE].value is False


@pytest.mark.parametrize("cut", [3, 90, 320, 360, 400, 440, 520])
def test_a_restart_in_the_middle_changes_nothing(model: str, cut: int) -> None:
    rng = np.random.default_rng(cut)
    stream = stream_of(change() + drive.noise(len(change()), 15.0, rng))
    whole, restarted = engine_of(PROCESSOR, model=model), engine_of(PROCESSOR, model=model)
    assert fed(whole, *stream[:cut]) == fed(restarted, *stream[:cut])
    adapter: TypeAdapter[Any] = TypeAdapter(PROCESSOR.state)
    fold = restarted.known_units["okuma"].live
    fold.state = decode_state(adapter, json.loads(json.dumps(encode_state(adapter, fold.state))))
    after, again = fed(whole, *stream[cut:]), fed(restarted, *stream[cut:])
    assert repr(after) == repr(again)
    assert not any(isinstance(action, DeadLetter) for action in after)
    assert json.loads(whole.snapshot("okuma")) == json.loads(restarted.snapshot("okuma"))


def test_another_model_begins_anew(model: str, tmp_path: Path) -> None:
    save_detector(tmp_path, small(), ("b.parquet",), {}, 1.0)
    first, second = engine_of(PROCESSOR, model=model), engine_of(PROCESSOR, model=str(tmp_path))
    fed(first, *stream_of(np.ones(300)), data(30.0, **{CURRENT: 1.1}))
    assert second.restore(first.snapshot("okuma")) == "okuma"
    fed(second, birth(30.0, **{CURRENT: 1.1}), data(31.0, **{CURRENT: 1.0}))
    assert told(second)[ACTIVE].value is None


def test_what_comes_between_the_samples_is_averaged(model: str) -> None:
    """At ticks of 20 ms, five of them are one sample of the model."""
    engine = engine_of(PROCESSOR, model=model, tick_s=0.02)
    fine = np.repeat(change(), 5) + np.tile([0.5, -0.5, 0.25, -0.25, 0.0], len(change()))
    events = [birth(0.0, **{CURRENT: 1.0})]
    events += [data(0.02 * n, **{CURRENT: round(float(value), 3)}) for n, value in enumerate(fine) if n]
    assert "confirmed" in values_of(fed(engine, *events), PHASE)


def test_a_dead_machine_is_not_told_of(model: str) -> None:
    engine = engine_of(PROCESSOR, model=model)
    fed(engine, *stream_of(np.ones(400) + 0.001 * np.arange(400)), death(50.0), birth(60.0, **{CURRENT: 1.0}))
    fed(engine, data(61.0, **{CURRENT: 1.1}))
    assert told(engine)[ACTIVE].value is None, "what went on in the meantime is not known"


@pytest.mark.parametrize(("table", "words"), [({"tick_s": 0.3}, "sample period"), ({"model": "nowhere"}, "no detector")])
def test_a_model_that_does_not_fit_is_refused_before_it_runs(model: str, table: dict[str, Any], words: str) -> None:
    with pytest.raises(ConfigurationError, match=words):
        PROCESSOR.configured({"model": model} | table)


def test_a_machine_may_have_a_model_of_its_own(model: str) -> None:
    stream = [*stream_of(change()), data(100.0, **{CURRENT: 1.1})]
    for name, confirmed in (("okuma", 1), ("mazak", 0)):
        actions = fed(engine_of(PROCESSOR, machines={name: {"model": model}}), *stream)
        assert values_of(actions, PHASE).count("confirmed") == confirmed
    odd = {"machines": {"okuma": {"opens_early": False}, "mazak": {"pattern_score": 0.99}}}
    assert values_of(fed(engine_of(PROCESSOR, model=model, **odd), *stream), ACTIVE) == [False, True, False]


def test_a_model_of_one_machine_that_does_not_fit_is_named_with_its_machine(model: str) -> None:
    with pytest.raises(ConfigurationError, match=r"^\[tool_change_detector\.machines\.okuma\] nowhere: no detector"):
        PROCESSOR.configured({"model": model, "machines": {"okuma": {"model": "nowhere"}}})
    with pytest.raises(ConfigurationError, match=r"^\[tool_change_detector\] tick_s 0\.3 does not go into"):
        PROCESSOR.configured({"model": model, "tick_s": 0.3})


def test_values_are_checked_without_reading_the_disk() -> None:
    assert str(PROCESSOR.config(model=Path("nowhere")).model) == "nowhere"


def test_a_recorded_part_gives_what_the_replay_gives(tmp_path: Path) -> None:
    """Plate 15, which was not learned from, through the engine, report by report."""
    path = recording("nist/plate/Plate-Hurco04-15of20.txt")
    done = bench.trained(bench.training_streams(), bench.TrainingSettings("spindle_rpm"), np.random.default_rng(0))
    save_detector(tmp_path, done, (), {}, 1.0)
    stream = next(iter(bench.whole_recording(path)))
    offline = replayed(done.detector, stream).confirmed
    names = {"Spindle_Speed": ("spindle_rpm", 1.0), "Feed_Rate": ("feed_mm_min", 60.0), "Block_Number": ("nc_line", 1)}
    rows = bench.read_observations(path.read_text(), path.name).rows
    begin_s = stream.begin_s
    events = [birth(0.0, spindle_rpm=0.0)]
    for row in rows:
        if row.key in names and row.t_s < begin_s + 0.1 * len(stream.values):
            name, factor = names[row.key]
            events.append(data(max(row.t_s - begin_s, 0.0), **{name: float(row.value) * factor}))
    engine = engine_of(PROCESSOR, model=str(tmp_path))
    actions = fed(engine, *events)
    live = [at / 1000.0 + begin_s for at, name, value, _ in published(actions) if name == PHASE and value == "confirmed"]
    assert len(offline) >= 6
    assert len(live) == pytest.approx(len(offline), abs=1)
    assert all(min(abs(at_s - one.at_s) for at_s in live) < 1.0 for one in offline)
    assert "feed and block weighed" in told(engine)[BASIS].value  # type: ignore[operator]
