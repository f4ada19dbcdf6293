"""The benchmark of a fleet: the load says what an edge says, the reader reads, and a slice runs through the real process."""

import doctest
from array import array
from pathlib import Path
from random import Random

import pytest

from benchmarks import fleet
from benchmarks.hall import curves, holds, machine, packets, soak, stages, trial
from benchmarks.hall import page as page_of_fleet
from benchmarks.hall.load import Load, Order
from benchmarks.hall.machine import ALIAS, CHANGING, ROOM, Bodies, Machine, body, flags
from benchmarks.hall.packets import Stream, publish
from benchmarks.hall.reader import Seen
from benchmarks.hall.trial import OWN, Setup
from benchmarks.hall.usage import Usage
from sparkplug.host_session import EventKind, HostSession
from sparkplug.layouts.varint import written

NOW_MS = 1_790_000_000_000


@pytest.mark.parametrize("module", [packets, machine, holds, soak, stages, curves], ids=lambda module: module.__name__)
def test_its_examples_hold(module: object) -> None:
    done = doctest.testmod(module)  # type: ignore[arg-type]
    assert done.attempted > 0 and done.failed == 0


def test_a_stream_is_taken_apart_wherever_it_is_cut() -> None:
    sent = [("a/b", b"x" * 5), ("c", b"y" * 300), ("d", b"")]
    data = b"\xd0\x00" + b"".join(publish(*one) for one in sent) + b"\x90\x03\x00\x01\x00"
    for cut in range(len(data)):
        stream = Stream()
        assert stream.published(data[:cut]) + stream.published(data[cut:]) == sent


def test_a_host_takes_what_a_machine_of_the_load_says() -> None:
    session = HostSession("bench", chance=Random(0))
    session.connected(NOW_MS)
    one, stream = Machine(3, NOW_MS), Stream()
    assert one.hello(NOW_MS).startswith(b"\x10")
    data = one.births(NOW_MS)
    bodies = Bodies.made()
    for number in range(300):  # over the turn of the sequence number
        extra = flags(tool_change_active=True, tool_number=7) if number == 150 else b""
        data += one.data(bodies.cut[number % 256] + extra, written(NOW_MS + 100 * (number + 1)))
    events = [event for topic, payload in stream.published(data) for event in session.message(topic, payload, NOW_MS)]
    told = [event for event in events if event.device == "m0003"]
    assert told[0].kind is EventKind.BIRTH and {reading.name for reading in told[0].readings} == set(ALIAS)
    assert len(told) == 301 and all(event.kind is EventKind.DATA for event in told[1:])
    for number, event in enumerate(told[1:]):
        values = {reading.name: reading for reading in event.readings}
        assert set(CHANGING) <= set(values)
        assert {reading.timestamp_ms for reading in values.values()} == {NOW_MS + 100 * (number + 1)}
    assert {reading.name: reading.value for reading in told[151].readings}["tool_number"] == 7


def test_each_changing_value_of_the_load_does_change() -> None:
    pool = [machine.cutting(number, Random(number)) for number in range(64)]
    assert all(len({values[name] for values in pool}) > 5 for name in CHANGING)
    assert body({"ambient_temp_c": 21.5}).count(ROOM) == 2


def test_machines_change_their_tools_and_stand_still(monkeypatch: pytest.MonkeyPatch) -> None:
    load = Load(Order(port=0, machines=(0,), hz=10.0))
    sent: list[bytes] = []

    class Wire:
        def sendall(self, data: bytes) -> None:
            sent.append(data)

    one = load.machines[0]
    one.sock = Wire()  # type: ignore[assignment]
    for tick in range(1200):
        load._turn(one, written(NOW_MS + 100 * tick), NOW_MS + 100 * tick, True)
    assert load.tally.sent == len(sent) == 1200 - 60 + 6, "six seconds of standing, a message a second"
    assert load.tally.whole == {"m0000": 1200 - 60}
    assert one.machine.tool == 2


def of(machines: int, cores: float, in_time_pct: float = 100.0) -> dict[str, object]:
    return {"machines": machines, "used": {"processors": {"cores": cores}}, "in_time_pct": in_time_pct}


@pytest.mark.parametrize(
    ("trials", "machines", "largest"),
    [
        ([of(10, 0.2)], 50, 10),
        ([of(10, 0.2), of(20, 0.3)], 90, 20),
        ([of(10, 0.2), of(50, 0.6), of(200, 1.4), of(500, 1.0, 20.0)], 125, 200),
        ([of(20, 0.9, 80.0)], None, None),
    ],
)
def test_what_a_core_holds(trials: list[dict[str, object]], machines: int | None, largest: int | None) -> None:
    by_time = holds.by_time(trials)
    assert (None if by_time is None else round(by_time)) == machines and holds.in_time(trials) == largest


def test_a_load_that_was_late_is_told() -> None:
    setup = Setup(OWN, (("thermal",),), 1, 10.0, 1.0)
    tally = trial.Tally(sent=10, late_ms=[1.0] * 90 + [80.0] * 10)
    idle = dict.fromkeys(("processors", "broker", "load", "reader"), Usage(0.0, 1.0, 1, 0))
    told = trial.figures(setup, idle, idle, 1.0, 0.0, 1.0, Seen(mirror_s=array("d", [0.1])), [tally], {})
    assert told["complaints"] == ["the load was late: 80 ms at 99 %"] and told["age_ms"]["p99"] == 100.0


def test_the_page_is_filled_between_its_markers(tmp_path: Path) -> None:
    text = "a\n<!-- fleet one_against_twelve -->\nold\n<!-- end -->\nb\n<!-- fleet soak -->\n<!-- end -->\n"
    used = [{"processors": {"us_a_message": us}} for us in (50.0, 120.0)]
    names = [[["thermal"]], [["thermal", "mirror"]]]
    trials = [{"tree": "new", "machines": 8, "processors": n, "used": u} for n, u in zip(names, used, strict=True)]
    filled = page_of_fleet.filled(text, {"one_against_twelve": trials})
    assert "| now | 8 | 50 | 120 | 2.4 |" in filled and "old" not in filled and "Not measured yet." in filled
    assert filled.startswith("a\n") and "\nb\n" in filled


def test_the_curves_are_drawn(tmp_path: Path) -> None:
    trials = [of(n, n / 100) | {"tree": tree, "age_ms": {"p99": 10.0 * n}} for n in (4, 40) for tree in ("old", "new")]
    curves.draw(trials, tmp_path / "fleet.svg")
    drawn = (tmp_path / "fleet.svg").read_text()
    assert drawn.count('class="curve"') == 4 and "now" in drawn and "before" in drawn


@pytest.mark.broker
def test_a_slice_of_it_through_the_real_process() -> None:
    setup = Setup(OWN, fleet.names_of("all"), 3, 10.0, 3.0, 0.0, outage_every_s=0.0)
    result = fleet.tried(setup)
    assert result["all_live"] and result["messages"] > 70
    assert result["in_time_pct"] > 50.0, "most values are in the mirror within a second, on a busy computer too"
    assert result["age_ms"]["count"] > 50 and 0.0 < result["age_ms"]["p50"] < 2_000.0
    assert result["used"]["processors"]["cores"] > 0.0
    assert len(result["nodes"]) == 16
    assert {node: told["missing"] for node, told in result["nodes"].items()} == dict.fromkeys(result["nodes"], 0)
    assert result["nodes"]["twin-historian"]["store_samples"] > 500
    assert "twin-mirror" in result["nodes"] and result["nodes"]["twin-mirror"]["received"] > 70
