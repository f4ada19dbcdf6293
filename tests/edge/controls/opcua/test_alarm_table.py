"""The events of conditions become a list of alarms."""

import json

from hypothesis import given, settings
from hypothesis import strategies as st

from edge.config import EdgeConfig, SignalSection
from edge.controls.opcua.alarm_table import ALARMS_MAX, AlarmTable, Phase, fold, listed, text_of
from edge.controls.opcua.config import Config, OpcUaConfig
from edge.controls.opcua.cursor import parse, start
from edge.controls.opcua.event import EVENT, EVENTS, REFRESH, Event, Kind
from edge.reading import TEXT_LENGTH_MAX
from edge.sample import SampleSet
from edge.sweep import Fact, Sweep

LOW = Event(Kind.CONDITION, condition="a", code="700012", text="Coolant low", severity=500, retain=True, active=True)
STOP = Event(Kind.CONDITION, condition="b", code="3000", text="Emergency stop", severity=1000, retain=True, active=True)
FROM = Fact(EVENTS, "nsu=urn:x;s=Machine")


def but(event: Event, **other: object) -> Event:
    return Event(**{name: getattr(event, name) for name in Event.__slots__} | other)


def config(**signals: SignalSection) -> Config:
    return EdgeConfig(source=OpcUaConfig(map="sinumerik"), signals=signals)


def refreshed(*events: Event) -> tuple[Fact, ...]:
    said = (Event(Kind.REFRESH_START), *events, Event(Kind.REFRESH_END))
    return tuple(event.fact(5_000 + number) for number, event in enumerate(said))


def played(edge: Config, *frames: tuple[Fact, ...]) -> list[SampleSet]:
    cursor, found = start(edge), list[SampleSet]()
    for number, facts in enumerate(frames):
        cursor, one = parse(edge, cursor, Sweep("a", number, 1_000 * number + 6_000, facts).encode())
        assert one.accounted()
        found.append(one)
    return found


def shown(one: SampleSet) -> list[tuple[str, object]]:
    return [(s.signal, s.reason if s.value is None else s.value) for s in one.samples if s.signal.startswith("alarm")]


def codes(one: SampleSet) -> list[list[str]]:
    return [[row["code"] for row in json.loads(str(s.value))] for s in one.samples if s.signal == "alarms"]


def test_the_list_has_the_active_alarms_first_and_the_text_those_alone() -> None:
    (one,) = played(config(), (FROM, *refreshed(LOW, but(STOP, active=False, acknowledged=False))))
    assert [sample.is_baseline for sample in one.samples] == [True, True]
    (_, text), (_, alarms) = shown(one)
    assert text == "700012 Coolant low"
    assert json.loads(str(alarms)) == [
        {"code": "700012", "text": "Coolant low", "severity": 500, "active": True, "acknowledged": None,
         "since": "1970-01-01T00:00:05.001Z"},
        {"code": "3000", "text": "Emergency stop", "severity": 1000, "active": False, "acknowledged": False, "since": None},
    ]  # fmt: skip


def test_an_alarm_that_a_refresh_does_not_repeat_is_gone_and_nothing_is_published_before_its_end() -> None:
    begun = refreshed(LOW)[:-1]
    first, halfway, end = played(config(), (FROM, *refreshed(LOW, STOP)), (FROM, *begun), refreshed()[1:])
    assert codes(first) == [["3000", "700012"]]
    assert halfway.samples == ()
    assert halfway.dropped == {"evidence": 3}
    assert codes(end) == [["700012"]]


def test_a_branch_is_listed_as_gone_until_it_is_acknowledged() -> None:
    earlier = but(LOW, branch="7", acknowledged=False)
    _, with_branch, without = played(
        config(), (FROM, *refreshed(LOW)), (earlier.fact(7_000),), (but(earlier, retain=False).fact(8_000),)
    )
    alarms = json.loads(str(with_branch.samples[1].value))
    assert [(row["active"], row["acknowledged"]) for row in alarms] == [(True, None), (False, False)]
    assert codes(without) == [["700012"]]


def test_a_condition_that_is_disabled_or_not_retained_leaves_the_list() -> None:
    table = fold(fold(AlarmTable(Phase.WHOLE), LOW, 1), STOP, 2)
    assert [alarm.code for alarm in listed(fold(table, but(LOW, retain=False), 3))] == ["3000"]
    assert [alarm.code for alarm in listed(fold(table, but(STOP, enabled=False), 3))] == ["700012"]


def test_since_is_when_it_became_active_whatever_changes_later() -> None:
    table = fold(fold(AlarmTable(Phase.WHOLE), LOW, 1), but(LOW, acknowledged=True), 9)
    assert table.alarms[0].since_ms == 1
    again = fold(fold(table, but(LOW, active=False), 10), LOW, 20)
    assert again.alarms[0].since_ms == 20
    assert fold(table, but(LOW, since_ms=4), 9).alarms[0].since_ms == 4
    assert fold(table, but(LOW, active=False, since_ms=12), 12).alarms[0].since_ms == 1, "12 is when it went"


def test_a_server_without_events_says_so_once_and_the_variable_goes_on() -> None:
    (one,) = played(config(), (Fact("alarm", 700012), Fact(EVENTS, None, "the server offers no events (…: BadNotSupported)")))
    assert shown(one) == [("alarm", "700012"), ("alarms", "the server offers no events (…: BadNotSupported)")]
    assert {offer.signal for offer in one.offers or ()} == {"alarm", "alarms"}


def test_events_take_the_place_of_the_variable_that_has_only_a_number() -> None:
    first, later = played(config(), (Fact("alarm", 700012), FROM, *refreshed(LOW)), (Fact("alarm", 0),))
    assert shown(first)[0] == ("alarm", "700012 Coolant low")
    assert len(shown(first)) == 2
    assert shown(later) == []
    assert [offer.source for offer in first.offers or ()] == ["events of nsu=urn:x;s=Machine"] * 3


def test_where_the_alarms_of_before_are_not_told_the_variable_has_the_word_and_the_list_says_why() -> None:
    refused = Fact(REFRESH, None, "no refresh")
    joined, given_up, raised, gone = played(
        config(), (Fact("alarm", 700012), FROM), (refused,), (STOP.fact(9_000),), (but(STOP, retain=False).fact(9_500),)
    )
    assert shown(joined) == []
    assert shown(given_up) == [("alarm", "700012"), ("alarms", "no refresh")]
    assert codes(raised) == [["3000"]]
    assert shown(gone) == [("alarms", "no refresh")]


def test_a_signal_that_is_not_to_be_published_is_kept_back() -> None:
    (one,) = played(config(alarms=SignalSection(publish=False)), (FROM, *refreshed(LOW)))
    assert [name for name, _ in shown(one)] == ["alarm"]
    assert "alarms" not in {offer.signal for offer in one.offers or ()}


def test_a_message_becomes_operator_message_and_the_servers_talk_of_itself_does_not() -> None:
    talk = Event(Kind.SYSTEM, "AuditEventType", text="somebody looked").fact(7_000)
    _, one = played(config(), (FROM, *refreshed()), (Event(Kind.MESSAGE, text="Load pallet 2").fact(7_000), talk))
    assert [(s.signal, s.value, s.timestamp_ms) for s in one.samples] == [("operator_message", "Load pallet 2", 7_000)]
    assert one.dropped == {"unmapped": 1}


def test_many_alarms_are_bounded_and_what_has_no_room_is_counted() -> None:
    table = AlarmTable(Phase.WHOLE)
    for number in range(ALARMS_MAX + 5):
        table = fold(table, but(LOW, condition=str(number), text="x" * 500), number)
    assert len(table.alarms) == ALARMS_MAX
    assert len(text_of(table)) <= TEXT_LENGTH_MAX
    assert text_of(table).endswith("more")


_events = st.builds(
    Event,
    kind=st.sampled_from([Kind.CONDITION, Kind.CONDITION, Kind.REFRESH_START, Kind.REFRESH_END]),
    condition=st.sampled_from("abc"),
    retain=st.booleans(),
    active=st.none() | st.booleans(),
)


@settings(max_examples=60)
@given(st.lists(_events, max_size=20), st.sets(st.sampled_from("abc")))
def test_after_a_refresh_the_list_is_what_it_repeated_whatever_was_before(events: list[Event], there: set[str]) -> None:
    table = AlarmTable(Phase.ASKED)
    for number, event in enumerate(events):
        table = fold(table, event, number)
    repeated = [but(LOW, condition=name) for name in sorted(there)]
    for event in (Event(Kind.REFRESH_START), *repeated, Event(Kind.REFRESH_END)):
        table = fold(table, event, 99)
    assert {alarm.key for alarm in table.alarms} == there
    assert table.phase is Phase.WHOLE


@settings(max_examples=60)
@given(st.text(max_size=20) | st.recursive(st.none() | st.integers() | st.text(), st.lists, max_leaves=4).map(json.dumps))
def test_a_fact_that_is_no_event_is_counted_and_gives_nothing(junk: str) -> None:
    _, one = played(config(), (FROM, *refreshed()), (Fact(EVENT, junk), Fact(EVENT, f'{{"kind":{json.dumps(junk)}}}')))
    assert one.samples == ()
    assert one.dropped == {"unparsable": 2}
