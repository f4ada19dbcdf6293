"""The ledger's law: received = emitted + dropped(reason) + buffered, after every single event."""

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from processors.running.ledger import DropReason, Ledger
from sparkplug.admission.refusal import Refusal
from sparkplug.host_session import EventKind, HostEvent
from sparkplug.topics import NodeId
from tests.processors.recorder import RECORDER
from tests.processors.streams import engine_of, wild_streams


@given(stream=wild_streams(), silences=st.booleans())
@settings(max_examples=100, deadline=None, suppress_health_check=[HealthCheck.too_slow, HealthCheck.data_too_large])
def test_every_message_is_accounted_for_after_every_event(stream: list[HostEvent], silences: bool) -> None:
    engine = engine_of(RECORDER, fail_at=1.0, gap_s_max=60.0)
    for number, event in enumerate(stream):
        before = engine.ledger.received
        engine.feed(event, float(number))
        if silences:
            engine.silence(float(100 * number))
        ledger = engine.ledger
        assert ledger.balance == 0
        assert ledger.buffered == sum(
            len(lane.held)
            for machine in engine._machines.values()
            for lane in (machine.live, machine.history)
            if lane is not None
        )
        counted = event.device is not None and event.kind is not EventKind.HOLE and RECORDER.listens_to(event.node.node)
        assert ledger.received - before in ((1, 2) if counted else (0,))


def test_every_reason_is_published_also_at_zero() -> None:
    metrics = Ledger().metrics()
    assert {f"ledger/dropped/{reason.value}" for reason in DropReason} <= set(metrics)
    assert set(metrics.values()) == {0}


def test_what_could_not_be_sent_is_no_longer_emitted() -> None:
    ledger = Ledger()
    ledger.received = ledger.emitted = 1
    ledger.unsent()
    assert (ledger.emitted, ledger.dropped[DropReason.BROKER_OFFLINE], ledger.balance) == (0, 1, 0)


@pytest.mark.parametrize("refusal", list(Refusal))
def test_what_is_refused_is_received_and_dropped_under_its_reason(refusal: Refusal) -> None:
    engine = engine_of(RECORDER)
    event = HostEvent(EventKind.REFUSED, NodeId("cnc", "edge"), "vmc", 0, detail="why", refused=3, refusal=refusal)
    assert engine.feed(event, 0.0) == []
    engine.lost(event._replace(refused=2), DropReason.OVERLOAD)  # the reason for which they were refused came first
    engine.feed(event._replace(device=None, refused=0), 0.0)
    assert (engine.ledger.received, engine.ledger.dropped_total, engine.ledger.balance) == (5, 5, 0)
    (reason,) = [reason for reason, count in engine.ledger.dropped.items() if count]
    assert reason.value.startswith("refused_")
    assert engine.machines == ()
