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
from processors.discovery import AnyProcessor, discover, modules, sample_configuration
from processors.running.snapshot import decode_state, encode_state
from sparkplug.host_session import HostEvent
from tests.depth import examples
from tests.processors.streams import birth, data, death, engine_of, fed, unnamed, wild_streams
from twin.vocabulary.twin_signals import TWIN_PREFIX

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
    pages = re.findall(r"^# Page: (docs/[\w-]+\.md)$", opening, re.MULTILINE)
    assert len(pages) == 1, f"{path.relative_to(ROOT)}: one of its first three lines is `# Page: docs/<page>.md`"
    (page,) = pages
    links = re.findall(r"\]\(([^)]+)\)", (ROOT / page).read_text(encoding="utf-8"))
    code = f"../{modules()[processor.name].replace('.', '/')}.py"
    assert {code, f"../{path.relative_to(ROOT)}"} <= set(links)


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
    for unit in restarted._units.values():
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
    """Whose births a process has heard is of its own life."""
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


@every_processor
def test_a_dead_machine_has_no_living_twin(processor: AnyProcessor) -> None:
    actions = fed(engine_of(processor), *_day(), death(160.0))
    if processor.outputs:
        assert actions[-1] == Remove("okuma")
