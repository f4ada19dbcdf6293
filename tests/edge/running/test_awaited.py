"""An edge finds out by itself whether a historian is part of its plant, and waits for its receipts from then on."""

from pathlib import Path

import pytest

from edge.config import BrokerSection, EdgeConfig, StoreSection
from edge.running import run
from edge.running.awaited import LATE_S, NOT_AWAITED, Awaited
from edge.running.forwarder import SEQUENCE, Forwarder
from edge.running.receipts import RECEIPT, REPEAT_S, Receipts
from edge.running.ring import Ring
from edge.sample import EdgeSample
from sparkplug.actions import HostState
from sparkplug.edge_session import EdgeNodeSession
from sparkplug.metric import NodeId
from tests.edge.running.test_forwarder import Wire
from twin.vocabulary.nodes import HISTORIAN_NODE

ONLINE, OFFLINE = HostState(True, 1), HostState(False, 2)
STATE = f"spBv1.0/STATE/{HISTORIAN_NODE}"


class Surely:
    """Chance that loses nothing."""

    @staticmethod
    def random() -> float:
        return 1.0


class Edge:
    """A forwarder on a broker that loses nothing, and its clock."""

    def __init__(self, folder: Path, **settings: object) -> None:
        self.limits = StoreSection.model_validate({"free_bytes_min": 0, **settings})
        self.seconds, self.file = 0.0, folder / "edge.store"
        self.wire = Wire(Surely())  # type: ignore[arg-type]
        self.begin()

    def begin(self) -> None:
        ring = Ring(self.file, self.limits, wall_ms=lambda: 0, clock=lambda: self.seconds, free_bytes=lambda _: 10**12)
        self.forwarder = self.wire.forwarder = Forwarder(ring, self.wire, "vmc", self.limits, lambda: self.seconds)
        self.forwarder.declare(("spindle_rpm", SEQUENCE))

    def restart(self) -> None:
        self.forwarder.close()
        self.begin()

    def tell(self, rows: int = 1) -> None:
        for _ in range(rows):
            self.forwarder.put([[EdgeSample("spindle_rpm", 1.0, 1_000)]], None)

    def turns(self, seconds: float) -> None:
        for _ in range(round(seconds / 0.5)):
            self.forwarder.pump()
            self.wire.deliver(1_000)
            self.seconds += 0.5
        self.forwarder.pump()

    @property
    def told(self) -> str:
        return str(self.forwarder.health()["health/history"])


def declared(edge: Edge) -> set[str]:
    return {metric.name for metric in edge.forwarder.metrics()}


def test_where_no_historian_was_heard_of_the_brokers_word_is_enough_and_the_edge_says_that_nothing_keeps_history(
    tmp_path: Path,
) -> None:
    edge = Edge(tmp_path)
    edge.tell(3)
    edge.turns(2.0)
    assert edge.forwarder.observations == 0
    assert "nothing keeps history" in edge.told
    assert RECEIPT in declared(edge), "a historian that comes later sees that its receipts are read"


@pytest.mark.parametrize("state", [ONLINE, OFFLINE])
def test_a_historian_that_was_heard_of_is_waited_for_also_while_it_is_away(tmp_path: Path, state: HostState) -> None:
    edge = Edge(tmp_path)
    edge.forwarder.host_state(HISTORIAN_NODE, state)
    edge.tell(3)
    edge.turns(2.0)
    assert edge.forwarder.health()["health/awaited_rows"] == 3
    edge.forwarder.receipt("1-3")
    edge.turns(0.5)
    assert edge.forwarder.observations == 0
    assert HISTORIAN_NODE in edge.told


def test_a_receipt_is_word_of_a_historian_too_for_brokers_that_hide_its_state(tmp_path: Path) -> None:
    edge = Edge(tmp_path)
    edge.forwarder.receipt("")
    edge.turns(0.5)
    edge.tell(2)
    edge.turns(2.0)
    assert edge.forwarder.observations == 2
    edge.forwarder.receipt("1")
    edge.turns(REPEAT_S - 1.0)
    edge.forwarder.receipt("")
    edge.turns(2.0)
    assert [message.sequence for message in edge.wire.got] == [1, 2, 2], "what it has missed is told again"


def test_an_edge_that_is_started_again_remembers_the_historian(tmp_path: Path) -> None:
    edge = Edge(tmp_path)
    edge.forwarder.host_state(HISTORIAN_NODE, ONLINE)
    edge.turns(0.5)
    edge.restart()
    edge.tell()
    edge.turns(2.0)
    assert edge.forwarder.observations == 1


def test_a_historian_whose_retained_state_is_removed_is_waited_for_no_longer(tmp_path: Path) -> None:
    edge = Edge(tmp_path)
    edge.forwarder.host_state(HISTORIAN_NODE, ONLINE)
    edge.tell(3)
    edge.turns(2.0)
    edge.forwarder.host_state(HISTORIAN_NODE, None)
    edge.turns(1.0)
    assert edge.forwarder.observations == 0
    edge.restart()
    edge.tell()
    edge.turns(2.0)
    assert edge.forwarder.observations == 0
    assert "nothing keeps history" in edge.told


def test_a_historian_that_stays_away_is_named_with_the_way_out(tmp_path: Path) -> None:
    edge = Edge(tmp_path)
    edge.forwarder.host_state(HISTORIAN_NODE, OFFLINE)
    edge.tell(2)
    edge.turns(LATE_S + 1.0)
    assert edge.forwarder.health()["health/awaited_s"] >= LATE_S
    assert all(word in edge.told for word in (HISTORIAN_NODE, "2 rows", "await_receipt = false", STATE))


def test_rows_that_a_limit_takes_meanwhile_are_named(tmp_path: Path) -> None:
    edge = Edge(tmp_path, age_s_max=5.0)
    edge.forwarder.host_state(HISTORIAN_NODE, OFFLINE)
    edge.tell(4)
    edge.turns(10.0)
    health = edge.forwarder.health()
    assert (health["health/store_evicted_rows"], health["health/store_evicted"]) == (4, "1-4 age")
    assert health["health/awaited_rows"] == 0


def test_false_waits_for_nobody(tmp_path: Path) -> None:
    edge = Edge(tmp_path, await_receipt=False)
    edge.forwarder.host_state(HISTORIAN_NODE, ONLINE)
    edge.forwarder.receipt("")
    edge.tell(2)
    edge.turns(2.0)
    assert edge.forwarder.observations == 0
    assert edge.told == NOT_AWAITED
    assert RECEIPT not in declared(edge)


def test_true_waits_for_a_historian_that_nobody_has_heard_of() -> None:
    awaited = Awaited("vmc", True, "", 0.0)
    awaited.hear(HISTORIAN_NODE, None)
    assert not awaited.settle(-1.0)
    assert awaited.host == HISTORIAN_NODE
    assert awaited.health(Receipts(), 0.0)["health/awaited_rows"] == 0


def test_a_node_asks_for_the_state_of_the_hosts_that_it_watches_and_goes_on_without_them() -> None:
    session = EdgeNodeSession(NodeId("cnc", "edge-vmc"), watched_hosts=[HISTORIAN_NODE])
    session.connecting(0, 1)
    actions = session.connected(2)
    assert STATE in [action.topic_filter for action in actions if hasattr(action, "topic_filter")]
    assert any("NBIRTH" in action.topic for action in actions if hasattr(action, "payload"))
    for payload in (ONLINE.encode(), b"", b"ONLINE"):
        assert session.message(STATE, payload, 3) == []
    assert session.host_states == [(HISTORIAN_NODE, ONLINE), (HISTORIAN_NODE, None)]
    assert session.malformed == 1


@pytest.mark.parametrize(("primary_host", "is_awaited"), [(HISTORIAN_NODE, True), ("scada", False), ("", False)])
def test_a_historian_that_is_the_primary_host_is_waited_for_from_the_first_row_on(
    tmp_path: Path, primary_host: str, is_awaited: bool
) -> None:
    broker = BrokerSection(session_file=str(tmp_path / "session"), primary_host=primary_host)
    opened = run._opener(EdgeConfig(source=None, broker=broker))
    assert opened is not None
    forwarder = opened(Wire(Surely()))  # type: ignore[arg-type]
    forwarder.host_state(HISTORIAN_NODE, None)
    forwarder.pump()
    assert (HISTORIAN_NODE in str(forwarder.health()["health/history"])) is is_awaited
    forwarder.close()
