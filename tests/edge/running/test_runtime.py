"""The loop, with a scripted control and a publisher that writes down what it is told."""

import threading
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from edge.config import EdgeConfig, MachineSection
from edge.controls.mtconnect.adapter import ADAPTER
from edge.controls.mtconnect.config import MtconnectConfig
from edge.running.ledger import Ledger
from edge.running.runtime import EdgeRuntime
from sparkplug.metric import Change, MetricSpec
from tests.edge.controls.mtconnect.agent_documents import error, probe, streams, value

CONFIG = EdgeConfig(source=MtconnectConfig(), machine=MachineSection(name="vmc", lost_after_s=30.0))


class Notebook:
    """A publisher that writes everything down; offline while told so."""

    def __init__(self) -> None:
        self.online = True
        self.reconnects = self.unsent = self.session = 0
        self.births: list[dict[str, MetricSpec]] = []
        self.deaths: list[str] = []
        self.stopped = False
        self.messages: list[tuple[str | None, list[Change]]] = []
        self._declared: set[str] = set()

    def start(self) -> None:
        """Nothing to connect to."""

    def stop(self, timeout_s: float = 5.0) -> None:
        self.stopped = True

    def declare_device(self, device: str, metrics: Sequence[MetricSpec]) -> None:
        self.births.append({metric.name: metric for metric in metrics})
        self._declared = {metric.name for metric in metrics}

    def remove_device(self, device: str) -> None:
        assert self._declared, "a device that is not there cannot die"
        self.deaths.append(device)
        self._declared = set()

    def publish(self, device: str | None, changes: Sequence[Change]) -> bool:
        if device is not None:
            assert {change.name for change in changes} <= self._declared
        if self.online:
            self.messages.append((device, list(changes)))
        return self.online

    def barrier(self, token: int, session: int) -> bool:
        raise AssertionError("there is no store")

    def told(self, name: str) -> list[object]:
        return [change.value for _, changes in self.messages for change in changes if change.name == name]

    def ledgers(self) -> list[dict[str, int]]:
        return [
            {c.name: int(str(c.value)) for c in cs}
            for device, cs in self.messages
            if device is None and cs[0].name == "ledger/received"
        ]


class Script:
    """A control that sends these frames, then waits. A number is a pause in seconds."""

    def __init__(self, *frames: bytes | float | Callable[[], None]) -> None:
        self.reconnects, self.last_error = 0, ""
        self._frames, self._closed, self._heard_s = frames, threading.Event(), time.monotonic()
        self.done = threading.Event()

    def frames(self) -> Iterator[bytes]:
        for item in self._frames:
            if isinstance(item, bytes):
                self._heard_s = time.monotonic()
                yield item
            elif isinstance(item, float):
                self._closed.wait(item)
            else:
                item()
        self.done.set()
        self._closed.wait(20)

    def follow(self, cursor: Any) -> None:
        """It sends what it sends."""

    def silent_s(self) -> float:
        return time.monotonic() - self._heard_s

    def close(self) -> None:
        self._closed.set()


def played(
    *frames: bytes | float | Callable[[], None],
    notebook: Notebook | None = None,
    lost_after_s: float = 30.0,
    place_file: Path | None = None,
) -> tuple[Notebook, EdgeRuntime]:
    """The notebook after these frames and a clean stop."""
    script, notebook = Script(*frames), notebook or Notebook()
    config = replace(CONFIG, machine=MachineSection(name="vmc", lost_after_s=lost_after_s))
    runtime = EdgeRuntime(config, replace(ADAPTER, connect=lambda _: script), notebook, place_file=place_file)
    thread = threading.Thread(target=runtime.run)
    thread.start()
    assert script.done.wait(60)
    time.sleep(0.05)
    runtime.stop.set()
    thread.join(60)
    assert not thread.is_alive()
    assert notebook.stopped
    for ledger in (*notebook.ledgers(), runtime.ledger.snapshot()):
        assert Ledger.difference(ledger) == 0
    return notebook, runtime


BASELINE = streams(
    10, [value("rpm", 3, "100"), value("load", 4, "20"), value("tool", 5, "7"), value("exec", 6, "ACTIVE"), value("vars", 7, "x")]
)


def test_the_birth_comes_with_the_first_values_and_names_unit_limits_and_source() -> None:
    notebook, _ = played(probe(), BASELINE)
    (birth,) = notebook.births
    load = birth["spindle_load_pct"]
    assert (load.unit, load.low, load.high, load.value, load.properties["source"]) == ("%", 0, 200, 20.0, "load")
    assert birth["feed_mm_min"].properties["nativeUnit"] == "MILLIMETER/SECOND"
    assert {"tool_number", "tool_change_active", "tool_change_source", "tool_change_evidence", "alarm"} <= set(birth)
    first = next(changes for device, changes in notebook.messages if device == "vmc")
    assert {"spindle_rpm", "spindle_load_pct", "tool_number", "exec_state", "tool_change_active"} <= {
        change.name for change in first
    }


def test_the_ledger_of_observations_balances_in_one_message() -> None:
    notebook, runtime = played(probe(), BASELINE, streams(12, [value("rpm", 10, "100"), value("load", 11, "30")]), BASELINE)
    last = runtime.ledger.snapshot()
    assert (last["ledger/received"], last["ledger/emitted"], last["ledger/buffered"]) == (12, 5, 0)
    assert (last["ledger/dropped/unmapped"], last["ledger/dropped/unchanged"], last["ledger/dropped/duplicate"]) == (1, 1, 5)
    assert notebook.ledgers()[-1] == last
    assert notebook.told("health/ledger_difference")[-1] == 0


def test_a_hole_is_counted_and_published() -> None:
    current = streams(328, [value("rpm", 300, "9")], first=200)
    notebook, _ = played(probe(), BASELINE, error("OUT_OF_RANGE", "too old"), current)
    assert notebook.told("health/holes")[-1] == 1
    assert notebook.told("health/lost_observations")[-1] == 317
    assert notebook.told("health/last_hole")[-1] == "overrun: 10 to 327, at most 317 lost"
    assert notebook.told("health/last_error")[-1] == "the agent answers OUT_OF_RANGE: too old"
    assert notebook.told("health/refused_frames")[-1] == 1


def test_what_nobody_could_be_told_is_dropped_with_that_reason() -> None:
    notebook = Notebook()
    _, runtime = played(
        probe(),
        BASELINE,
        0.1,
        lambda: setattr(notebook, "online", False),
        streams(11, [value("rpm", 10, "5")]),
        notebook=notebook,
    )
    assert runtime.ledger.snapshot()["ledger/dropped/broker_offline"] == 1


def test_a_control_that_falls_silent_for_long_is_dead_and_born_again_when_it_speaks() -> None:
    notebook, _ = played(probe(), BASELINE, 1.2, streams(10), lost_after_s=0.5)
    assert notebook.deaths == ["vmc"]
    assert [birth["spindle_rpm"].value for birth in notebook.births] == [100.0, 100.0]
    assert notebook.told("spindle_rpm") == [100.0], "the second birth carries it"


def test_a_control_that_its_agent_has_lost_is_dead_after_a_while() -> None:
    found = streams(11, [value("avail", 10, "AVAILABLE")])
    lost = streams(14, [value("avail", 11, "UNAVAILABLE"), value("rpm", 12, "UNAVAILABLE"), value("tool", 13, "UNAVAILABLE")])
    beats = [item for _ in range(10) for item in (0.1, streams(14))]
    late = streams(15, [value("load", 14, "UNAVAILABLE")])
    back = streams(18, [value("avail", 15, "AVAILABLE"), value("rpm", 16, "7"), value("tool", 17, "7")])
    notebook, runtime = played(probe(), BASELINE, found, lost, *beats, late, 0.1, back, lost_after_s=0.5)
    assert notebook.deaths == ["vmc"]
    assert len(notebook.births) == 2
    assert notebook.told("tool_change_source") == ["controller", "stale", "controller"]
    assert True not in notebook.told("tool_change_active")
    assert runtime.ledger.snapshot()["ledger/dropped/control_lost"] == 1


def test_where_the_agent_does_not_say_it_a_control_is_lost_when_all_its_signals_are() -> None:
    some = streams(12, [value("rpm", 10, "UNAVAILABLE"), value("load", 11, "UNAVAILABLE")])
    rest = streams(14, [value("tool", 12, "UNAVAILABLE"), value("exec", 13, "UNAVAILABLE")])
    beats = [item for _ in range(10) for item in (0.1, streams(12))]
    assert played(probe(), BASELINE, some, *beats, lost_after_s=0.5)[0].deaths == []
    assert played(probe(), BASELINE, some, rest, *beats, lost_after_s=0.5)[0].deaths == ["vmc"]


def test_a_control_that_offers_no_tool_says_so() -> None:
    bare = (
        probe()
        .replace(b'type="TOOL_NUMBER"', b'type="x:T"')
        .replace(b'type="BLOCK"', b'type="x:B"')
        .replace(b'name="Tool"', b"")
        .replace(b'id="block"', b'id="b"')
    )
    notebook, _ = played(bare, streams(10, [value("rpm", 3, "100")]))
    assert notebook.told("tool_change_source") == ["none"]
    assert notebook.told("tool_change_active") == [None]


def test_a_control_that_describes_itself_anew_is_born_anew() -> None:
    again = probe(instance=2).replace(b'id="xload" type="LOAD"', b'id="xload" type="x:OTHER"')
    notebook, _ = played(probe(), BASELINE, streams(2, instance=2), again, streams(5, [value("rpm", 3, "8")], instance=2))
    first, second = notebook.births
    assert set(first) - set(second) == {"axis_x_load_pct"}
    assert notebook.deaths == ["vmc"]
    assert notebook.told("health/instance_id")[-1] == "2"


def test_an_error_of_ours_ends_the_edge_loudly() -> None:
    def broken() -> None:
        raise RuntimeError("a bug")

    script, notebook = Script(broken), Notebook()
    with pytest.raises(RuntimeError, match="a bug"):
        EdgeRuntime(CONFIG, replace(ADAPTER, connect=lambda _: script), notebook).run()
    assert notebook.stopped


def test_an_edge_that_is_started_again_goes_on_where_it_was(tmp_path: Path) -> None:
    place_file = tmp_path / "session.json.place"
    baseline = streams(10, [value("rpm", 3, "100"), value("load", 4, "5")])
    played(probe(), baseline, streams(12, [value("rpm", 11, "200")]), place_file=place_file)
    notebook, runtime = played(
        probe(),
        streams(16, [value("load", 4, "5"), value("rpm", 15, "400")]),
        streams(16, [value("rpm", 13, "300"), value("rpm", 15, "400")]),
        place_file=place_file,
    )
    assert notebook.told("spindle_load_pct")[-1:] == [5.0]
    assert notebook.told("spindle_rpm")[-2:] == [300.0, 400.0], "what came while the edge was away is not lost"
    assert runtime.health.holes == 0
    notebook, runtime = played(probe(), streams(90, [value("rpm", 80, "500")], first=40), place_file=place_file)
    assert runtime.health.holes == 1
    assert (runtime.health.lost_observations, Ledger.difference(runtime.ledger.snapshot())) == (73, 0)


def test_whatever_ends_the_loop_ends_the_node_too() -> None:
    class Fails(Notebook):
        def publish(self, device: str | None, changes: Sequence[Change]) -> bool:
            raise ValueError("a bug")

    notebook = Fails()
    runtime = EdgeRuntime(CONFIG, replace(ADAPTER, connect=lambda _: Script()), notebook)
    with pytest.raises(ValueError, match="a bug"):
        runtime.run()
    assert notebook.stopped, "else it keeps its name on the broker, and throws out the edge that is begun in its place"
