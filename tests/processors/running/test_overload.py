"""More than can be folded: who waits, what is passed over and counted, and what a recorder has of it."""

import pytest

from processors.config import Configuration
from processors.discovery import find
from processors.running import backlog, runner
from processors.running.ledger import DropReason
from processors.running.overload import NODES_MAX, Overload
from processors.running.runner import Runner
from processors.running.worker import Worker
from sparkplug.host_session import HostEvent
from sparkplug.metric import NodeId
from tests.processors.recorder import RECORDER
from tests.processors.running.test_runner import Kept, workers_on
from tests.processors.running.test_worker import FakeEdge, FakeHost, worked
from tests.processors.streams import birth, data

FLOOD = NodeId("cnc", "edge-flood")
QUIET = [birth(0.0, spindle_rpm=0.0), *(data(i / 10, spindle_rpm=float(i)) for i in range(1, 50))]
FLOODING = [
    birth(0.0, node=FLOOD, device="flood", spindle_rpm=0.0),
    *(data(i / 1000, node=FLOOD, device="flood", spindle_rpm=float(i), spindle_load_pct=1.0) for i in range(1, 5000)),
]


@pytest.fixture(autouse=True)
def _slow(monkeypatch: pytest.MonkeyPatch) -> None:
    """A process that can hardly fold anything, whatever this computer can."""
    monkeypatch.setattr(runner, "IN_ORDER_S_MAX", 0.0)
    monkeypatch.setattr(backlog, "WORK_S_MAX", 1e-9)
    monkeypatch.setattr(backlog, "SHARE_MIN", 150)


def mixed() -> list[HostEvent]:
    """A hundred messages of the flood for each one of the quiet machine."""
    return [event for i, quiet in enumerate(QUIET) for event in (*FLOODING[i * 100 : (i + 1) * 100], quiet)]


def test_what_is_passed_over_is_counted_by_each_and_the_newest_values_are_folded() -> None:
    host = FakeHost(*mixed())
    one, other = workers_on(host, RECORDER, find("thermal"))
    Runner(host, [one, other]).run(host.until_empty())
    for worker in (one, other):
        ledger = worker.engine.ledger
        assert (ledger.received, ledger.balance) == (len(mixed()), 0)
        assert ledger.dropped[DropReason.OVERLOAD] > 4000
        row = worker.engine._machines["flood"].live.row
        assert row["spindle_rpm"].value == 4999.0
    edge = one._edge
    assert isinstance(edge, FakeEdge)
    told = {change.name: change.value for device, changes in edge.published if device is None for change in changes}
    assert told["health/overload"] == one.engine.ledger.dropped[DropReason.OVERLOAD]
    assert str(told["health/overloaded_by"]).startswith("cnc/edge-flood: ")


def test_another_machine_is_folded_as_if_nothing_were() -> None:
    host = FakeHost(*mixed())
    (disturbed,) = workers_on(host, RECORDER)
    Runner(host, [disturbed]).run(host.until_empty())
    alone, _ = worked(RECORDER, FakeHost(*QUIET))
    assert disturbed.engine.snapshot("okuma") == alone.engine.snapshot("okuma")


def test_a_recorder_has_every_message_as_it_came() -> None:
    host, recorder, historian = FakeHost(*mixed()), Kept(), find("historian")
    worker = Worker(historian, Configuration(historian.config), host, FakeEdge(), recorder)
    Runner(host, [worker]).run(host.until_empty())
    assert recorder.events == mixed()
    assert worker.engine.ledger.dropped[DropReason.OVERLOAD] > 4000


def test_the_one_who_floods_is_named_for_a_minute() -> None:
    overload = Overload()
    for event in FLOODING[:10]:
        overload.passed_over(event.node)
    overload.passed_over(QUIET[1].node)
    assert overload.report(100.0) == "cnc/edge-flood: 10 messages passed over in a second, and 1 others with fewer"
    assert overload.report(159.0) == "cnc/edge-flood: 10 messages passed over in a second, and 1 others with fewer"
    assert overload.report(161.0) == ""
    for number in range(2 * NODES_MAX):
        overload.passed_over(NodeId("cnc", f"edge-{number}"))
    assert len(overload._counts) == NODES_MAX
