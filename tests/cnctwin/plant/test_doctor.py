"""The doctor says what is not as it should be: no broker, no node, one that died, a ledger that does not add up."""

import json
import sys
import threading
import time
from collections.abc import Iterator, Mapping
from contextlib import contextmanager

import pytest

from cnctwin.cli import main
from cnctwin.plant.doctor import (
    Report,
    counted_signals,
    examine,
    of_awaited,
    of_edge_store,
    of_faults,
    of_history,
    of_lags,
    of_overload,
    of_sequence_holes,
    of_sloppy_peers,
    of_store,
)
from cnctwin.plant.finding import Finding
from cnctwin.plant.lags import behind, lag_reports
from cnctwin.plant.view import own_values
from edge.running.awaited import LATE_S, NO_HISTORIAN
from sparkplug.broker import BrokerAddress
from sparkplug.datatype import DataType
from sparkplug.edge_node import EdgeNode
from sparkplug.metric import Change, MetricSpec, NodeId, Reading
from sparkplug.quality import Quality
from sparkplug.values import Value
from tests.cnctwin.plant.pictures import Pictures, owner
from tests.cnctwin.program import until
from tests.wire.mosquitto import Mosquitto, free_port

pytestmark = pytest.mark.broker
HEALTHY = {"received": 10, "emitted": 7, "buffered": 1, "dropped": 2, "dropped/unmapped": 2}
LISTEN_S = 1.2


@contextmanager
def edge(broker: Mosquitto, ledger: Mapping[str, int], *, holes: int = 0) -> Iterator[EdgeNode]:
    """An edge that publishes this ledger again and again, as a real one does, and a machine with one signal."""
    counts = {f"ledger/{name}": count for name, count in ledger.items()} | {"health/holes": holes}
    metrics = [MetricSpec(name, DataType.INT64, value=count) for name, count in counts.items()]
    node = EdgeNode(BrokerAddress(*broker.address), NodeId("cnc", "edge-vmc"), metrics)
    node.declare_device("vmc", [MetricSpec("exec_state", DataType.STRING, value="READY")])
    node.start()
    until(lambda: node.online, "the edge to be born")
    stop = threading.Event()

    def beat() -> None:
        while not stop.wait(0.1):
            node.publish(None, [Change("health/holes", holes, time.time_ns() // 1_000_000)])

    heart = threading.Thread(target=beat)
    heart.start()
    try:
        yield node
    finally:
        stop.set()
        heart.join()
        node.stop()


def report(broker: Mosquitto) -> Report:
    return examine(BrokerAddress(*broker.address), "cnc", LISTEN_S)


def bad(seen: Report) -> list[str]:
    return [finding.text for finding in seen.findings if not finding.good]


def call(monkeypatch: pytest.MonkeyPatch, *arguments: str) -> int:
    monkeypatch.setattr(sys, "argv", ["cnctwin", "doctor", *arguments])
    with pytest.raises(SystemExit) as ended:
        main()
    return int(ended.value.code or 0)


def test_a_healthy_plant_has_no_bad_finding_and_counted_holes_are_told(mosquitto: Mosquitto) -> None:
    with edge(mosquitto, HEALTHY, holes=3):
        seen = report(mosquitto)
    assert bad(seen) == []
    assert seen.good
    told = " | ".join(finding.text for finding in seen.findings)
    assert "edge-vmc: 10 = 7 emitted + 2 dropped + 1 buffered" in told
    assert "vmc: its control is connected; 1 signal, 0 not good" in told
    assert "3 gaps in the data so far" in told
    assert [finding.mark for finding in seen.findings if "gaps" in finding.text] == ["note"]


def test_signals_that_are_not_good_are_named() -> None:
    readings = [Reading(f"s{at}", at, 1, Quality.BAD if at else Quality.GOOD, None, None, False) for at in range(11)]
    assert counted_signals({one.name: one for one in readings[:3]}) == "3 signals, 2 not good: s1, s2"
    told = "11 signals, 10 not good: s1, s2, s3, s4, s5, s6, s7, s8, …"
    assert counted_signals({one.name: one for one in readings}) == told


@pytest.mark.parametrize("wrong", [{"emitted": 6}, {"dropped/unmapped": 1}])
def test_a_ledger_that_does_not_add_up_is_bad_news(mosquitto: Mosquitto, wrong: dict[str, int]) -> None:
    with edge(mosquitto, HEALTHY | wrong):
        seen = report(mosquitto)
    assert not seen.good
    assert len(bad(seen)) == 1
    assert bad(seen)[0].startswith("edge-vmc: not 10 = ")


def test_a_broker_without_a_node_is_bad_news(mosquitto: Mosquitto) -> None:
    assert bad(report(mosquitto)) == ["no edge node was heard of; start one with `cnctwin edge run CONFIG`"]


def test_an_edge_and_a_machine_that_die_meanwhile_are_bad_news(mosquitto: Mosquitto) -> None:
    with edge(mosquitto, HEALTHY) as node:
        threading.Timer(LISTEN_S, node.stop).start()
        seen = examine(BrokerAddress(*mosquitto.address), "cnc", 2 * LISTEN_S)
    told = " | ".join(bad(seen))
    assert "edge-vmc is offline" in told
    assert "vmc: its control is not connected" in told


def test_without_a_broker_there_is_one_line_and_exit_code_1(
    monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    port = free_port()
    assert call(monkeypatch, "--broker", f"mqtt://127.0.0.1:{port}", "--seconds", "1") == 1
    out = capfd.readouterr().out
    assert len(out.splitlines()) == 1
    assert f"mqtt://127.0.0.1:{port}" in out


@pytest.mark.parametrize(("emitted", "code"), [(7, 0), (6, 1)])
def test_a_program_reads_the_whole_report(
    mosquitto: Mosquitto, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str], emitted: int, code: int
) -> None:
    url = BrokerAddress(*mosquitto.address).url
    with edge(mosquitto, HEALTHY | {"emitted": emitted}):
        assert call(monkeypatch, "--broker", url, "--seconds", "1.2", "--json") == code
    said = json.loads(capfd.readouterr().out)
    assert said["good"] is (code == 0)
    assert {"good", "text", "note"} == set(said["findings"][0])
    (ledger,) = said["ledgers"]
    assert ledger["node"] == "edge-vmc"
    assert ledger["balances"] is (code == 0)
    assert ledger["reasons"] == {"unmapped": 2}


@pytest.mark.parametrize(
    "dropped, trouble, good", [(0, "", True), (3, "", False), (0, "the disk is full; make room", False), (0, None, True)]
)
def test_a_store_that_cannot_keep_all_is_bad_news(dropped: int, trouble: str | None, good: bool) -> None:
    told = {"store_samples": 10, "store_dropped": dropped, "store_trouble": trouble}
    metrics = {name: Reading(name, value, 0, Quality.GOOD, None, None, False) for name, value in told.items()}
    (finding,) = of_store("twin-historian", metrics)
    assert finding.good is good
    assert finding.text == f"twin-historian: 10 samples stored, 0 waiting, {dropped} messages without room" + (
        f"; {trouble}" if trouble else ""
    )
    assert of_store("twin-thermal", {}) == []


def lag(lag_s: float, process: str | None, **more: float) -> dict[str, Value]:
    """The health of a processor's node."""
    values = {"lag_s": lag_s, "published_lag_s": lag_s + 0.2, "machines": 20, "busy_pct": 104.6, **more}
    return {f"health/{name}": value for name, value in values.items()} | ({"health/process": process} if process else {})


def plant(*nodes: tuple[str, dict[str, Value]], dead: tuple[str, ...] = ()) -> Pictures:
    pictures = Pictures()
    for node, values in nodes:
        pictures.add(node, owner(values, online=node not in dead))
    return pictures


def test_processors_that_are_behind_are_one_bad_finding_a_process() -> None:
    shared = [(f"twin-{name}", lag(18.2 if name == "mirror" else 17.0, "hall-3:4711")) for name in ("thermal", "mirror")]
    alone = ("twin-historian", lag(0.1, "hall-3:4712", machines=20, busy_pct=40.0))
    reports = lag_reports(own_values(plant(*shared, alone, ("edge-vmc", lag(3600.0, None)))))
    bad_one, good_one = of_lags(reports)
    sentence = "processors are 18 s behind: 20 machines, one core, 105 % busy; `cnctwin plan fleet` says what it takes"
    assert (bad_one.good, bad_one.text) == (False, f"{sentence} (mirror, thermal)")
    assert (good_one.good, good_one.text) == (
        True,
        "processors are in time: 0.3 s behind, 20 machines, one core, 40 % busy (historian)",
    )
    assert behind(reports) == bad_one.text
    assert behind(reports[1:]) is None


@pytest.mark.parametrize(
    "values", [{}, {"health/lag_s": None}, {"health/lag_s": "late"}, {"health/lag_s": float("nan")}, {"health/lag_s": True}]
)
def test_a_node_that_does_not_report_a_lag_has_none(values: dict[str, Value]) -> None:
    assert lag_reports(own_values(plant(("twin-thermal", values)))) == []


def test_what_a_dead_processor_said_last_is_no_lag() -> None:
    assert lag_reports(own_values(plant(("twin-thermal", lag(18.0, "a:1")), dead=("twin-thermal",)))) == []


def test_a_processor_of_an_older_version_is_a_process_of_its_own() -> None:
    (report,) = lag_reports(own_values(plant(("twin-thermal", {"health/lag_s": 7.0}))))
    assert report.process == "twin-thermal"
    assert not of_lags([report])[0].good


@pytest.mark.parametrize(("waiting", "age_s", "is_told"), [(0, 600.0, False), (30, 0.5, False), (30, 80.0, True)])
def test_an_edge_with_old_rows_to_send_is_behind(waiting: int, age_s: float, is_told: bool) -> None:
    told = {"store_waiting_rows": waiting, "store_age_s": age_s}
    metrics = {name: Reading(name, value, 0, Quality.GOOD, None, None, False) for name, value in told.items()}
    found = of_edge_store("edge-vmc", metrics)
    assert [finding.good for finding in found] == [False] * is_told
    assert all("edge-vmc is 80 s behind: 30 rows" in finding.text for finding in found)


def told(**values: Value) -> dict[str, Reading]:
    """The health of a node."""
    return {name: Reading(name, value, 0, Quality.GOOD, None, None, False) for name, value in values.items()}


def test_an_edge_whose_historian_is_silent_is_bad_news_with_the_way_out() -> None:
    text = "twin-historian has given no receipt for 2 min: …"
    assert of_awaited("edge-vmc", told(awaited_s=LATE_S, history=text)) == [Finding(False, f"edge-vmc: {text}")]
    assert of_awaited("edge-vmc", told(awaited_s=1.0, history="rows are held until twin-historian has them")) == []
    assert of_awaited("twin-thermal", {}) == []


def test_a_plant_without_a_historian_is_told_that_nothing_keeps_history() -> None:
    (finding,) = of_history([told(history=NO_HISTORIAN), told(history=NO_HISTORIAN), told(lag_s=0.0)])
    assert finding.good
    assert finding.text.startswith("2 edges: no historian has been heard of on this broker: nothing keeps history; start")
    assert of_history([told(history="rows are held until twin-historian has them"), told()]) == []


def test_a_peer_that_does_not_keep_a_rule_is_told_and_is_no_bad_news() -> None:
    assert of_sloppy_peers({"sloppy_aliases": 3, "sloppy_births": 0, "births": 9}) == [
        Finding(
            True,
            "3 aliases stood for a metric of a node and one of its device (as Tahu Java gives them); read all the same",
            note=True,
        )
    ]


def test_rows_that_the_historian_misses_are_bad_news() -> None:
    named = "okuma: 372–441 missing since 2026-03-02 08:00 UTC"
    (finding,) = of_sequence_holes("twin-historian", told(sequence_holes=1, sequence_hole=named))
    assert (finding.good, finding.text) == (False, f"twin-historian: rows of edges are missing: {named}")
    assert of_sequence_holes("twin-historian", told(sequence_holes=0, sequence_hole="")) == []
    assert of_sequence_holes("edge-vmc", {}) == []


def test_contained_faults_are_counted_and_the_last_one_is_told() -> None:
    text = "a beat failed; restarted after 1 s, 2 times so far: OSError: disk full"
    (finding,) = of_faults("twin-alerts", told(faults=3, restarts=2, fault=text))
    assert finding == Finding(True, f"twin-alerts: 3 faults contained, restarted 2 times; the last: {text}", note=True)
    assert of_faults("twin-alerts", told(faults=0, restarts=0, fault="")) == of_faults("edge-okuma", {}) == []


def test_who_floods_a_process_is_named_once() -> None:
    text = "cnc/edge-flood: 812 messages passed over in a second"
    every = [told(overloaded_by=text), told(overloaded_by=text), told(overloaded_by=""), told(lag_s=0.0)]
    assert of_overload(every) == [Finding(False, f"more comes than can be folded, the newest values win: {text}")]
    assert of_overload([told(overloaded_by=""), {}]) == []
