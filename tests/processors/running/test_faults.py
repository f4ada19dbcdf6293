"""Faults where they come up: in one message, one machine, one processor, the recorder. All else goes on as if nothing were."""

from collections.abc import Sequence
from threading import Event
from typing import Any

import pytest

from processors.config import Configuration
from processors.discovery import AnyProcessor, find
from processors.errors import ProcessorsFailedError
from processors.running.lane import Lane
from processors.running.ledger import DropReason
from processors.running.runner import Runner
from processors.running.worker import Worker
from sparkplug.host_session import HostEvent
from sparkplug.metric import Change, NodeId
from tests.processors.recorder import RECORDER
from tests.processors.running.test_runner import Kept, workers_on
from tests.processors.running.test_worker import FakeEdge, FakeHost, snapshots, worked
from tests.processors.streams import birth, data, death
from tests.processors.streams import engine_of as engine

MAZAK = NodeId("cnc", "edge-mazak")
POISON = 13.0


class FragileEdge(FakeEdge):
    """An edge node that cannot be given a certain figure, as a stamp of 2^64 - 1 once could not be written."""

    def publish(self, device: str | None, changes: Sequence[Change]) -> bool:
        if any(change.name == "twin/level" and change.value == POISON for change in changes):
            raise OverflowError("value out of range")
        return super().publish(device, changes)

    def declare_device(self, device: str, metrics: Any) -> None:
        metrics = tuple(metrics)
        if any(spec.value == POISON for spec in metrics):
            raise OverflowError("value out of range")
        super().declare_device(device, metrics)


def fragile(host: FakeHost, processor: AnyProcessor = RECORDER, recorder: Kept | None = None) -> tuple[Worker, FragileEdge]:
    edge = FragileEdge()
    return Worker(processor, Configuration(processor.config), host, edge, recorder), edge


def log_of(worker: Worker, machine: str = "okuma") -> Any:
    return worker.engine._machines[machine].live.state.log


def stream_of(machine: str, node: NodeId, *speeds: float) -> list[HostEvent]:
    began = birth(0.0, node=node, device=machine, spindle_rpm=0.0)
    return [began, *(data(1.0 + i / 4, node=node, device=machine, spindle_rpm=rpm) for i, rpm in enumerate(speeds))]


# A message.


def test_a_message_that_cannot_be_handled_is_dropped_alone() -> None:
    host = FakeHost(*stream_of("okuma", NodeId("cnc", "edge-okuma"), 100.0, POISON, 200.0))
    worker, edge = fragile(host)
    Runner(host, [worker]).run(host.until_empty())
    ledger = worker.engine.ledger
    assert (ledger.dropped[DropReason.FAULT], ledger.emitted, ledger.received, ledger.balance) == (1, 3, 4, 0)
    assert [change.value for _, changes in edge.published for change in changes if change.name == "twin/level"] == [
        0.0,
        100.0,
        200.0,
    ]
    (health,) = [v for v in healths(edge) if v["health/faults"] == 1][-1:]
    assert health["health/fault"] == "a message of okuma failed: OverflowError: value out of range"


def test_a_fault_before_the_fold_is_counted_too_and_tells_the_message() -> None:
    host = FakeHost(*stream_of("okuma", NodeId("cnc", "edge-okuma"), 100.0, 150.0, 200.0))
    (worker,) = workers_on(host, RECORDER)
    feed = worker.engine.feed

    def failing(event: HostEvent, wall_s: float) -> Any:
        if event.readings and event.readings[0].value == 100.0:
            raise RuntimeError("our own bug")
        return feed(event, wall_s)

    worker.engine.feed = failing  # type: ignore[method-assign]
    Runner(host, [worker]).run(host.until_empty())
    assert (worker.engine.ledger.dropped[DropReason.FAULT], worker.engine.ledger.received) == (1, 4)
    assert worker.engine.ledger.balance == 0
    (letter,) = [payload for topic, payload, _ in host.plain if topic == "cnctwin/deadletter/recorder/okuma"]
    assert b'"error": "RuntimeError: our own bug"' in letter
    assert b'"changed": {"spindle_rpm": 100.0}' in letter


def test_what_fails_in_the_shortest_way_is_contained_as_well(monkeypatch: pytest.MonkeyPatch) -> None:
    host = FakeHost(*stream_of("okuma", NodeId("cnc", "edge-okuma"), 1.0, 2.0))
    broken, sound = workers_on(host, RECORDER, find("thermal"))
    runner = Runner(host, [broken, sound])
    runner.turn()
    lane = broken.engine._machines["okuma"].live
    passed = Lane._pass_silence
    monkeypatch.setattr(Lane, "_pass_silence", lambda one, to_ms: 1 / 0 if one is lane else passed(one, to_ms))
    host.give(data(5.0, spindle_rpm=3.0), data(6.0, spindle_rpm=3.0))
    for worker in (broken, sound):
        assert None not in [way for _, way in runner._ways["okuma"][NodeId("cnc", "edge-okuma")]], worker.name
    runner.turn()
    assert broken.engine.ledger.dropped[DropReason.FAULT] == 2
    assert (broken.engine.ledger.balance, sound.engine.ledger.emitted) == (0, 5)


# A machine.


def healths(edge: FakeEdge) -> list[dict[str, Any]]:
    messages = [{c.name: c.value for c in changes} for device, changes in edge.published if device is None]
    return [message for message in messages if "health/faults" in message]


def test_a_machine_that_goes_on_failing_is_set_aside_and_another_one_is_as_if_nothing_were() -> None:
    mazak = stream_of("mazak", MAZAK, *(float(i) for i in range(40)))
    okuma = stream_of("okuma", NodeId("cnc", "edge-okuma"), *[POISON, 50.0] * 20)
    host = FakeHost(*(event for pair in zip(okuma, mazak, strict=False) for event in pair))
    worker, edge = fragile(host)
    Runner(host, [worker]).run(host.until_empty())
    assert edge.removed == ["okuma"]
    assert "okuma" not in worker.engine._machines
    ledger = worker.engine.ledger
    assert (ledger.received, ledger.balance) == (82, 0)
    assert ledger.dropped[DropReason.FAULT] == 41 - 3  # the birth and two messages were folded before the third fault
    alone, _ = worked(RECORDER, FakeHost(*mazak))
    assert worker.engine.snapshot("mazak") == alone.engine.snapshot("mazak")


def test_a_machine_comes_back_after_its_pause_with_a_fresh_state_from_the_birth_that_the_session_remembers() -> None:
    okuma = stream_of("okuma", NodeId("cnc", "edge-okuma"), *[POISON, 50.0] * 3)
    host = FakeHost(*okuma)
    worker, edge = fragile(host)
    runner = Runner(host, [worker])
    runner.turn()
    (until_s,) = worker._faults.aside.values()
    worker.turn(until_s - 0.01)
    assert edge.devices == {}
    worker.turn(until_s)
    assert list(edge.devices) == ["okuma"]
    assert [kind for kind, *_ in log_of(worker)] == ["birth"]
    host.give(data(9.0, spindle_rpm=70.0))
    runner.turn()
    assert log_of(worker)[-1][3] == 70.0
    assert worker.engine.ledger.balance == 0


# A processor.


def test_a_processor_that_fails_goes_down_alone_and_comes_back_with_its_snapshots() -> None:
    mazak, okuma = stream_of("mazak", MAZAK, 1.0, 2.0), stream_of("okuma", NodeId("cnc", "edge-okuma"), 3.0, 4.0)
    host = FakeHost(*mazak, *okuma)
    broken, sound = workers_on(host, RECORDER, find("thermal"))
    runner = Runner(host, [broken, sound])
    runner.turn()
    broken._note_changed(0.0)
    broken._save(broken._saves.all())
    saved = snapshots(host)
    broken.engine.beat = lambda _: 1 / 0  # type: ignore[method-assign, assignment]
    broken.beat(100.0, {})
    down = broken._down
    assert down is not None
    down.stopper.join()
    edge, other = broken._edge, sound._edge
    assert isinstance(edge, FakeEdge)
    assert isinstance(other, FakeEdge)
    assert (edge.stopped, other.stopped) == (True, False)

    host.give(data(3.0, node=MAZAK, device="mazak", spindle_rpm=5.0), data(3.0, spindle_rpm=6.0))
    runner.turn()
    assert broken.engine.ledger.dropped[DropReason.FAULT] == 2
    assert (broken.engine.ledger.balance, sound.engine.ledger.emitted) == (0, 8)

    broken.turn(101.0)
    assert broken._down is None
    assert (edge.starts, set(edge.devices)) == (1, {"mazak", "okuma"})
    restarted = FakeHost(mazak[0], okuma[0], retained=saved)
    again, _ = worked(RECORDER, restarted)
    for machine in ("mazak", "okuma"):
        assert log_of(broken, machine) == log_of(again, machine)[:-1], "the last one is the goodbye"
    host.give(data(4.0, spindle_rpm=7.0))
    runner.turn()
    assert log_of(broken)[-1][3] == 7.0
    assert broken.engine.ledger.balance == 0
    broken.beat(102.0, {})
    assert healths(edge)[-1]["health/restarts"] == 1
    assert (
        healths(edge)[-1]["health/fault"]
        == "a beat failed; restarted after 1 s, 1 times so far: ZeroDivisionError: division by zero"
    )


def test_a_snapshot_that_cannot_be_taken_by_a_fault_of_ours_costs_that_state_only() -> None:
    before = engine(RECORDER)
    before.feed(birth(0.0, spindle_rpm=1.0), 0.0)
    retained = {f"cnctwin/snapshot/recorder/{name}": before.snapshot("okuma") for name in ("okuma", "mazak")}
    host = FakeHost(birth(0.5, spindle_rpm=2.0), retained=retained)
    (worker,) = workers_on(host, RECORDER)
    worker.engine.restore = lambda _: {}["our own bug"]  # type: ignore[method-assign, assignment]
    Runner(host, [worker]).run(host.until_empty())
    assert [kind for kind, *_ in log_of(worker)] == ["birth", "death"]
    assert worker._faults.faults == 2


def test_it_waits_for_its_node_to_be_born_and_for_the_old_one_to_be_gone() -> None:
    host = FakeHost(birth(0.0, spindle_rpm=1.0))
    (worker,) = workers_on(host, RECORDER)
    Runner(host, [worker]).turn()
    leaving = Event()
    edge = worker._edge
    assert isinstance(edge, FakeEdge)
    edge.stop = lambda timeout_s=5.0: leaving.wait(5.0)  # type: ignore[method-assign, assignment]
    edge.online = False
    worker._go_down("a beat", ZeroDivisionError(), 0.0)
    worker.turn(2.0)
    assert edge.starts == 0
    leaving.set()
    assert worker._down is not None
    worker._down.stopper.join()
    worker.turn(2.0)
    assert (edge.starts, edge.devices) == (1, {})
    edge.online = True
    worker.turn(2.1)
    assert list(edge.devices) == ["okuma"]


def test_a_recorder_that_fails_ends_no_alerts() -> None:
    class Full(Kept):
        begun = 0

        def keep(self, event: HostEvent, received_ms: int) -> None:
            if not self.begun:
                raise OSError("disk full")
            super().keep(event, received_ms)

        def begin_again(self) -> None:
            self.begun += 1

    stream = stream_of("okuma", NodeId("cnc", "edge-okuma"), 1.0, 2.0)
    recorder, host = Full(), FakeHost(*stream)
    historian = find("historian")
    worker = Worker(historian, Configuration(historian.config), host, FakeEdge(), recorder)
    (alerts,) = workers_on(host, find("alerts"))
    runner = Runner(host, [worker, alerts])
    runner.turn()
    assert (alerts.engine.ledger.emitted, worker.engine.ledger.dropped[DropReason.FAULT]) == (3, 3)
    assert worker._down is not None
    assert worker.fault.startswith("the recorder failed; restarted after 1 s, 1 times so far: OSError: disk full")
    worker._down.stopper.join()
    worker.turn(worker._down.until_s)
    host.give(data(9.0, spindle_rpm=9.0))
    runner.turn()
    assert [event.timestamp_ms for event in recorder.events] == [data(9.0).timestamp_ms]
    assert worker.engine.ledger.balance == alerts.engine.ledger.balance == 0


def test_the_process_ends_only_when_all_of_its_processors_go_on_failing() -> None:
    host = FakeHost(birth(0.0, spindle_rpm=1.0), death(1.0))
    hopeless, sound = workers_on(host, RECORDER, find("thermal"))
    runner = Runner(host, [hopeless, sound])
    for worker in (hopeless, sound):
        runner._report_due(0.0)
        now_s = 0.0
        while not worker.is_hopeless:
            if worker._down is not None:
                worker._down.stopper.join()
                now_s = worker._down.until_s
                worker.turn(now_s)
            worker._go_down("a beat", RuntimeError("our own bug"), now_s)
    with pytest.raises(ProcessorsFailedError, match=r"all processors of this process go on failing.*recorder: a beat failed"):
        runner._report_due(0.0)


@pytest.mark.parametrize("failure", [KeyboardInterrupt, SystemExit])
def test_who_wants_the_process_to_end_is_obeyed(failure: type[BaseException]) -> None:
    host = FakeHost(birth(0.0, spindle_rpm=1.0))
    (worker,) = workers_on(host, RECORDER)

    def ending(*_: object, **__: object) -> Any:
        raise failure

    worker.engine.feed = ending  # type: ignore[method-assign]
    with pytest.raises(failure):
        Runner(host, [worker]).run(Event())
    assert host.stopped


def test_a_unit_that_was_abandoned_leaves_the_ledger_in_balance() -> None:
    one = engine(RECORDER)
    one.feed(birth(100.0, spindle_rpm=1.0), 0.0)
    one.feed(data(1.0, spindle_rpm=2.0), 0.0)
    assert one.ledger.buffered == 1
    one.abandon("okuma", 0)
    assert (one.ledger.buffered, one.ledger.balance) == (0, 0)
    assert one.abandon("okuma", 0) == []
