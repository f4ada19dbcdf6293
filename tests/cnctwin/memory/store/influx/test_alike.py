"""The embedded store and the servers give the same answers to the same stream, whatever it holds."""

from collections.abc import Iterator
from pathlib import Path
from random import Random
from uuid import uuid4

import pytest

from cnctwin.memory.store.contract import Column, Message, Query, Store
from cnctwin.memory.store.influx.opening import open_influx
from cnctwin.memory.store.influx.store import ServerStore
from cnctwin.memory.store.opening import open_store
from sparkplug.host_session import EventKind
from sparkplug.metric import NodeId, Reading
from tests.cnctwin.memory.store.influx.servers import Influxd, ServerProcess, VictoriaMetrics
from tests.cnctwin.memory.store.influx.suite import BAD, EDGE, GOOD, OTHER, STALE, T0_MS, reading, told

SPAN_MS = 40_000
SIGNALS = ("spindle_rpm", "exec_state", "coolant_on", "twin/raw_score", "tool_number")
THERMAL = NodeId("cnc", "twin-thermal")


def stream(machine: str, seed: int) -> list[Message]:
    """Data with nulls, repetitions, late history, changes of quality within a second; deaths and births."""
    chance, messages, last = Random(seed), list[Message](), dict[str, Reading]()
    values = {
        "spindle_rpm": lambda: chance.choice([0, 100.5, 8000, -3.25]),
        "exec_state": lambda: chance.choice(["ACTIVE", "READY", "STOPPED", ""]),
        "coolant_on": lambda: chance.random() < 0.5,
        "twin/raw_score": lambda: round(chance.gauss(0, 3), 3),
        "tool_number": lambda: chance.choice([None, 1, 12]),
    }
    for n in range(160):
        t_ms = n * 250 + chance.randrange(3)
        name = chance.choice(SIGNALS)
        value, quality, reason = values[name](), GOOD, None
        if value is None or chance.random() < 0.15:
            quality, reason = chance.choice([(BAD, "UNAVAILABLE"), (STALE, "not seen for 5 s"), (BAD, "outside the range")])
        late = chance.random() < 0.1
        one = reading(name, value, max(t_ms - 4000, 0) if late else t_ms, quality, reason, history=late)
        node = THERMAL if name.startswith("twin/") else EDGE if chance.random() < 0.9 else OTHER
        messages.append(told(machine, one, node=node, t_ms=t_ms))
        if node == EDGE and not late:
            last[name] = one
        if chance.random() < 0.1:  # the same again
            messages.append(messages[-1])
        if n in {60, 120}:
            held = [r._replace(timestamp_ms=T0_MS + t_ms + 1, quality=STALE, reason="edge offline") for r in last.values()]
            messages.append(told(machine, *held, kind=EventKind.DEATH, t_ms=t_ms + 1))
            messages.append(told(machine, *last.values(), kind=EventKind.BIRTH, t_ms=t_ms + 100))
    return messages


@pytest.fixture(scope="module", params=[VictoriaMetrics, Influxd], ids=lambda kind: kind.name)
def server(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Iterator[ServerProcess]:
    kind: type[ServerProcess] = request.param
    if reason := kind.missing():
        pytest.skip(reason)
    server = kind(tmp_path_factory.mktemp(kind.name))
    server.start()
    yield server
    server.stop()


def rounded(column: Column) -> dict[str, object]:
    """A column with its figures to nine digits: a mean is summed in another order elsewhere."""

    def short(given: object) -> object:
        return float(f"{given:.9g}") if isinstance(given, int | float) and not isinstance(given, bool) else given

    lists = {name: [short(v) for v in getattr(column, name)] for name in ("value", "low", "high", "count")}
    return {"signal": column.signal, "unit": column.unit, "t_us": column.t_us, **lists,
            "quality": column.quality, "reason": column.reason}  # fmt: skip


@pytest.mark.parametrize("seed", [1, 2])
def test_the_same_stream_has_the_same_answers(server: ServerProcess, tmp_path: Path, seed: int) -> None:
    machine = f"vmc-{uuid4().hex[:8]}"
    messages = stream(machine, seed)
    embedded: Store = open_store(tmp_path / "embedded", writable=True)
    remote = open_influx(server.url(), writable=True, spool=tmp_path / "ring")
    assert isinstance(remote, ServerStore)
    for store in (embedded, remote):
        for begin in range(0, len(messages), 7):
            store.append(messages[begin : begin + 7])
    assert remote.drain(60.0)
    if isinstance(server, VictoriaMetrics):
        server.flush()
    for every_ms, from_ms, to_ms in ((None, 0, SPAN_MS), (1000, 0, SPAN_MS), (3000, 1234, SPAN_MS - 777), (60_000, 0, SPAN_MS)):
        query = Query(machine, SIGNALS, T0_MS + from_ms, T0_MS + to_ms, every_ms)
        for ours, theirs in zip(embedded.query(query), remote.query(query), strict=True):
            assert rounded(theirs) == rounded(ours), (ours.signal, every_ms)
    assert sum(len(column.t_us) for column in embedded.query(Query(machine, SIGNALS, T0_MS, T0_MS + SPAN_MS))) > 150
    one, other = embedded.latest(machine), remote.latest(machine)
    assert one == other
    assert [(s.node, s.signal, s.unit, s.first_us, s.last_us) for s in embedded.series(machine)] == [
        (s.node, s.signal, s.unit, s.first_us, s.last_us) for s in remote.series(machine)
    ]
    embedded.close()
    remote.close()
