"""The contract suite: every processor that discovery finds, the ones of tomorrow included."""

import json
import re
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import pytest
from hypothesis import HealthCheck, example, given, settings
from hypothesis import strategies as st
from pydantic import TypeAdapter

from processors.actions import Action, DeadLetter, PlainOutput, Publish, Remove
from processors.config import Configuration, read_tables
from processors.contract import Output
from processors.description import Description, Role
from processors.discovery import AnyProcessor, discover, modules, sample_configuration
from processors.running.engine import Engine
from processors.running.snapshot import decode_state, encode_state
from sparkplug.host_session import HostEvent
from sparkplug.metric import Change
from tests.depth import examples
from tests.processors.describing import DESCRIBING, whole
from tests.processors.streams import EDGE, UNITS, birth, data, death, engine_of, fed, unnamed, wild_streams
from twin.vocabulary.twin_signals import TWIN_PREFIX, live_name

ROOT = Path(__file__).parents[2]
every_processor = pytest.mark.parametrize("processor", discover().values(), ids=discover().keys())
quickly = settings(
    max_examples=examples(40, 25), deadline=None, suppress_health_check=[HealthCheck.too_slow, HealthCheck.data_too_large]
)


def _day() -> list[HostEvent]:
    """A shift in short: warm-up, a cut, a null, a death and a rebirth."""
    start = birth(0.0, spindle_rpm=0.0, spindle_load_pct=0.0, ambient_temp_c=21.5, spindle_temp_c=24.0, tool_number=1)
    cuts = [data(1.0 + 0.7 * i, spindle_rpm=4000.0 + 10 * i, spindle_load_pct=20.0 + i % 7) for i in range(120)]
    unknown = [data(90.0, spindle_load_pct=None), data(95.0, spindle_load_pct=31.0), data(97.0, tool_number=2)]
    again = [death(100.0), birth(130.0, spindle_rpm=0.0, spindle_load_pct=0.0, ambient_temp_c=21.6, tool_number=2)]
    return [start, *cuts, *unknown, *again, data(150.3, spindle_rpm=100.0)]


def test_nulls_of_many_names_say_the_same_reason_in_order() -> None:
    one, other = Output.nulls(("twin/b", "twin/a"), "the feed is unknown")
    assert (one, other) == (Output.null("twin/b", "the feed is unknown"), Output.null("twin/a", "the feed is unknown"))


def test_the_processors_of_the_first_release_are_found() -> None:
    assert {"cutting_force", "mirror", "thermal"} <= set(discover())


@every_processor
def test_the_sample_configuration_loads_and_equals_the_defaults(processor: AnyProcessor) -> None:
    tables = read_tables(sample_configuration(processor))
    assert list(tables) == [processor.name]
    configuration = Configuration(processor.config, tables[processor.name])
    assert configuration.default.model_dump() == processor.config().model_dump()


@every_processor
def test_every_section_of_the_sample_configuration_holds_every_key_at_its_default(processor: AnyProcessor) -> None:
    """A value that TOML has no word for (none at all) stands in the sample as a comment, and so may a whole section."""
    path = sample_configuration(processor)
    given = read_tables(path)[processor.name]
    defaults = processor.config().model_dump(mode="json")
    assert list(_drifted(given, defaults, path.read_text(encoding="utf-8"))) == []


def _drifted(given: Mapping[str, Any], defaults: Mapping[str, Any], text: str, where: str = "") -> Iterator[str]:
    for key in defaults.keys() | given.keys():
        place = f"{where}{key}"
        if key not in defaults:
            yield f"{place} is in the sample only"
        elif key not in given:
            if not re.search(rf"^#.*\b{re.escape(key)}\b", text, re.MULTILINE):
                yield f"{place} is not in the sample"
        elif isinstance(given[key], dict) and isinstance(defaults[key], dict):
            yield from _drifted(given[key], defaults[key], text, f"{place}.")
        elif json.loads(json.dumps(given[key], default=str)) != defaults[key]:
            yield f"{place} is {given[key]!r} in the sample, {defaults[key]!r} by default"


@every_processor
def test_sample_page_and_code_lead_to_each_other(processor: AnyProcessor) -> None:
    path = sample_configuration(processor)
    opening = "\n".join(path.read_text(encoding="utf-8").splitlines()[:3])
    pages = re.findall(r"^# Page: (docs/[\w/-]+\.md)$", opening, re.MULTILINE)
    assert len(pages) == 1, f"{path.relative_to(ROOT)}: one of its first three lines is `# Page: docs/<kind>/<page>.md`"
    (page,) = pages
    links = re.findall(r"\]\(([^)]+)\)", (ROOT / page).read_text(encoding="utf-8"))
    code = f"../../{modules()[processor.name].replace('.', '/')}.py"
    assert {code, f"../../{path.relative_to(ROOT)}"} <= set(links)


@every_processor
def test_the_same_stream_gives_the_same_answer(processor: AnyProcessor) -> None:
    assert fed(engine_of(processor), *_day()) == fed(engine_of(processor), *_day())


@every_processor
@given(stream=wild_streams())
@quickly
def test_nothing_that_comes_crashes_it(processor: AnyProcessor, stream: list[HostEvent]) -> None:
    engine = engine_of(processor)
    actions = fed(engine, *stream)
    assert [action for action in actions if isinstance(action, DeadLetter)] == []
    assert engine.ledger.balance == 0


@every_processor
@given(stream=wild_streams())
@example(stream=_day())
@quickly
def test_given_names_are_a_shorter_way_to_the_same(processor: AnyProcessor, stream: list[HostEvent]) -> None:
    """A host session hands out a message with the names and stamps of its readings; a replay may not have them."""
    short, long = engine_of(processor), engine_of(processor)
    for number, event in enumerate(stream):
        assert repr(short.feed(event, number / 3)) == repr(long.feed(unnamed(event), number / 3))  # NaN equals itself here
        assert repr(short.silence(number / 3)) == repr(long.silence(number / 3))
    assert short.ledger.metrics() == long.ledger.metrics()
    assert short.counts == long.counts
    assert [short.snapshot(unit) for unit in short.take_changed()] == [long.snapshot(unit) for unit in long.take_changed()]


@every_processor
@given(stream=wild_streams())
@quickly
def test_it_emits_only_what_it_declares_and_every_null_says_why(processor: AnyProcessor, stream: list[HostEvent]) -> None:
    names = {spec.name for spec in processor.outputs}
    for action in fed(engine_of(processor), *stream):
        if isinstance(action, Publish):
            assert {change.name for change in action.changes} <= names
            assert all(change.reason for change in action.changes if change.value is None)
        elif isinstance(action, PlainOutput):
            assert action.topic.startswith(tuple(spec.prefix for spec in processor.plain))
            json.loads(action.payload, parse_constant=_no_constant)
    assert all(name.startswith(TWIN_PREFIX) for name in names)


def _no_constant(text: str) -> Any:
    raise AssertionError(f"{text} is not JSON")


@every_processor
@given(stream=wild_streams(), cut=st.integers(0, 30))
@example(stream=_day(), cut=60)
@quickly
def test_a_restart_in_the_middle_changes_nothing(processor: AnyProcessor, stream: list[HostEvent], cut: int) -> None:
    """The state goes to JSON and back after `cut` events; everything after that is the same, to the last bit."""
    whole, restarted = engine_of(processor), engine_of(processor)
    expected = fed(whole, *stream[:cut])
    assert _same(fed(restarted, *stream[:cut]), expected)
    adapter: TypeAdapter[Any] = TypeAdapter(processor.state)
    for unit in restarted.known_units.values():
        for fold in (unit.live, unit.history):
            if fold is not None:
                fold.state = decode_state(adapter, json.loads(json.dumps(encode_state(adapter, fold.state))))
    assert _same(fed(restarted, *stream[cut:]), fed(whole, *stream[cut:]))


def _same(left: list[Action], right: list[Action]) -> bool:
    return repr(left) == repr(right)  # NaN equals itself here


@every_processor
def test_a_snapshot_carries_a_machine_over_to_a_new_process(processor: AnyProcessor) -> None:
    """The edge lives on: the new process is given its birth, with the values that it has by then, and goes on."""
    first, whole, second = engine_of(processor), engine_of(processor), engine_of(processor)
    values = {"spindle_rpm": 5000.0, "spindle_load_pct": 40.0, "tool_number": 3, "ambient_temp_c": 20.0}
    opening = [birth(0.0, **values), data(10.4, spindle_load_pct=50.0)]
    cut_short = data(45.0, spindle_rpm=0.0, spindle_load_pct=0.0)
    rest = [data(20.2, spindle_rpm=5100.0), cut_short, data(90.0, tool_number=4, ambient_temp_c=20.5)]
    fed(first, *opening)
    fed(whole, *opening, *rest)
    (unit,) = first.units
    assert second.restore(first.snapshot(unit)) == unit
    fed(second, birth(10.4, **values | {"spindle_load_pct": 50.0}), *rest)
    assert _without_births(second.snapshot(unit)) == _without_births(whole.snapshot(unit))
    assert second.counts.holes == 0


def _without_births(snapshot: bytes) -> Any:
    """Return whose births a process has heard is of its own life."""
    document = json.loads(snapshot)
    for lane in document["live"]["machines"].values():
        del lane["births"]
    return document


@every_processor
@given(stream=wild_streams())
@quickly
def test_every_snapshot_can_be_restored(processor: AnyProcessor, stream: list[HostEvent]) -> None:
    engine = engine_of(processor)
    fed(engine, *stream)
    for unit in engine.take_changed():
        snapshot = engine.snapshot(unit)
        again = engine_of(processor)
        assert again.restore(snapshot) == unit
        assert again.snapshot(unit) == snapshot


described = pytest.mark.parametrize(
    "processor",
    heeding := [one for one in (*discover().values(), DESCRIBING) if one.described],
    ids=[one.name for one in heeding],
)
challenged = pytest.mark.parametrize(
    "processor",
    shadowed := [one for one in heeding if any(spec.of_challenger for spec in one.outputs)],
    ids=[one.name for one in shadowed],
)


def _engine(processor: AnyProcessor, live: Description | None, challenger: Description | None = None) -> Engine:
    engine = engine_of(processor)
    for machine in ("okuma", "mazak"):
        engine.describe(machine, Role.LIVE, live)
        engine.describe(machine, Role.CHALLENGER, challenger)
    return engine


def _news(actions: list[Action], processor: AnyProcessor, *, of_challenger: bool) -> list[tuple[str, Change]]:
    """Return the live values of the metrics that a challenger has too; or what the challenger published, under those names."""
    changes = [(one.machine, change) for one in actions if isinstance(one, Publish) for change in one.changes]
    if of_challenger:
        return [(machine, one._replace(name=name)) for machine, one in changes if (name := live_name(one.name))]
    names = {spec.name for spec in processor.outputs if spec.of_challenger}
    return [(machine, one) for machine, one in changes if one.name in names and not one.is_historical]


@described
@given(stream=wild_streams())
@example(stream=_day())
@quickly
def test_a_challenger_that_is_identical_says_the_same(processor: AnyProcessor, stream: list[HostEvent]) -> None:
    engine = _engine(processor, whole(), whole())
    for number, event in enumerate(stream):
        actions = engine.feed(event, number / 3) + engine.silence(number / 3)
        live, challenger = (_news(actions, processor, of_challenger=which) for which in (False, True))
        assert repr(challenger) == repr(live)  # NaN equals itself here
    assert engine.ledger.balance == 0


@described
@given(stream=wild_streams())
@example(stream=_day())
@quickly
def test_a_challenger_changes_nothing_of_what_is_live(processor: AnyProcessor, stream: list[HostEvent]) -> None:
    alone, challenged = _engine(processor, whole()), _engine(processor, whole(), whole(22.0, resistance_k_per_w=0.5))
    for number, event in enumerate(stream):
        expected, actions = alone.feed(event, number / 3), challenged.feed(event, number / 3)
        told = [one for one in actions if isinstance(one, Publish) and not live_name(one.changes[0].name)]
        assert repr(told) == repr([one for one in expected if isinstance(one, Publish)])
    assert alone.ledger.metrics() == challenged.ledger.metrics()


@described
@pytest.mark.parametrize("cut", [1, 40, 121, 123, 124])
def test_a_change_in_mid_stream_is_a_restart_with_the_new_one_and_that_state(processor: AnyProcessor, cut: int) -> None:
    stream, machine = _day(), {"okuma": {EDGE: list(UNITS)}}
    changed, restarted = _engine(processor, whole()), _engine(processor, whole(22.0, resistance_k_per_w=0.5))
    fed(changed, *stream[:cut])
    changed.describe("okuma", Role.LIVE, whole(22.0, resistance_k_per_w=0.5))
    fed(changed, stream[cut])  # behind this one it holds
    restarted.resume(changed.snapshot("okuma"), machine)
    assert _same(fed(restarted, *stream[cut + 1 :]), fed(changed, *stream[cut + 1 :]))


@challenged
@pytest.mark.parametrize("is_restarted", [False, True])
def test_a_challenger_that_is_promoted_goes_on_as_the_live_one(processor: AnyProcessor, *, is_restarted: bool) -> None:
    stream, cut, new = _day(), 60, whole(22.0, resistance_k_per_w=0.5)
    shadow, promoted = _engine(processor, whole(), new), _engine(processor, whole(), new)
    for engine in (shadow, promoted):
        fed(engine, *stream[:cut])
    if is_restarted:
        snapshot, promoted = promoted.snapshot("okuma"), _engine(processor, new)
        promoted.resume(snapshot, {"okuma": {EDGE: list(UNITS)}})
    else:
        promoted.describe("okuma", Role.LIVE, new)
        promoted.describe("okuma", Role.CHALLENGER, None)
    for event in stream[cut:]:
        fed(shadow, event)
        fed(promoted, event)
        challenger = shadow.known_units["okuma"].live.challenger
        assert challenger is not None
        assert repr(promoted.known_units["okuma"].live.state) == repr(challenger.state)


@described
@given(stream=wild_streams())
@quickly
def test_every_snapshot_with_a_challenger_can_be_restored(processor: AnyProcessor, stream: list[HostEvent]) -> None:
    engine = _engine(processor, whole(), whole(22.0, resistance_k_per_w=0.5))
    fed(engine, *stream)
    for unit in engine.take_changed():
        snapshot, again = engine.snapshot(unit), _engine(processor, whole(), whole(22.0, resistance_k_per_w=0.5))
        assert again.restore(snapshot) == unit
        assert again.snapshot(unit) == snapshot


@every_processor
def test_a_dead_machine_has_no_living_twin(processor: AnyProcessor) -> None:
    actions = fed(engine_of(processor), *_day(), death(160.0))
    if processor.outputs:
        assert actions[-1] == Remove("okuma")
