"""The plant for Prometheus: names that rules rely on, and text that promtool takes."""

import json
import shutil
import subprocess
from pathlib import Path

import pytest
from prometheus_client.parser import text_string_to_metric_families

from cnctwin.api.nights import Nights
from cnctwin.api.prometheus.text import NODE_COUNTERS, NODE_GAUGES, PHASES
from cnctwin.validation.history import file_of
from processors.running.health import ON_LOG
from sparkplug.datatype import DataType
from tests.cnctwin.api.small_plant import EDGE, THERMAL, birth, client_of, death, now, small_plant

EDGE_OWN = {
    "ledger/received": 10,
    "ledger/emitted": 6,
    "ledger/buffered": 1,
    "ledger/dropped": 2,
    "ledger/dropped/unknown_key": 2,
    "health/holes": 3,
    "health/store_age_s": 4.5,
    "health/last_error": "no number",
}
THERMAL_OWN = {
    "ledger/received": 5,
    "ledger/emitted": 5,
    "ledger/buffered": 0,
    "ledger/dropped": 0,
    "health/queue_depth": 7,
    "health/lag_s": 0.25,
    "health/published_lag_s": 0.5,
    "health/busy_pct": 42.0,
    "health/runners": 2,
    "health/lag_records": 40_213,
    "health/restored_s": 1.25,
    "health/transactions_aborted": 3,
    "health/bridge_waiting": 17,
    "health/bridge_dropped": 4,
    "health/silent": "bridge.hall-2",
}
NIGHT = {
    "night": "2026-05-01",
    "t": 1_777_600_000_000,
    "twin": "a",
    "verdict": "over",
    "figures": [
        {"quantity": "temperature", "measure": "mae", "on": "", "value": 2.5, "budget": 2.0, "verdict": "over"},
        {"quantity": "following_error", "measure": "rms_pct", "on": "x", "value": 3.0, "budget": 5.0, "verdict": "within"},
        {"quantity": "following_error", "measure": "rms_pct", "on": "z", "value": 4.0, "budget": 5.0, "verdict": "within"},
        {"quantity": "vibration", "measure": "r", "on": "x", "value": 0.95, "budget": 0.85, "verdict": "within"},
        {"quantity": "vibration", "measure": "r", "on": "y", "value": 0.9, "budget": 0.85, "verdict": "within"},
        {"quantity": "force", "measure": "mape", "on": "", "value": None, "budget": 20.0, "verdict": "not observable"},
    ],
}


@pytest.fixture(scope="module")
def text(tmp_path_factory: pytest.TempPathFactory) -> str:
    live = small_plant(now() - 5_000)
    live.take([birth(EDGE_OWN, now(), EDGE, None), birth(THERMAL_OWN, now(), THERMAL, None)], now())
    live.take(
        [birth({"twin/tool_change_gate": True, "twin/raw_score": 0.5, "twin/gap_growing": None}, now(), THERMAL, "vmc")], now()
    )
    live.take([birth({"spindle_rpm": 1.0}, now(), EDGE, 'a "quoted"\\machine\nname')], now())
    live.take_alerts({"alerts": [{"phase": "firing"}, {"phase": "firing"}, {"phase": "acknowledged"}]})
    folder = tmp_path_factory.mktemp("nights")
    file_of("vmc", folder).write_text(json.dumps(NIGHT) + "\n")
    with client_of(live, nights=Nights(folder)) as client:
        answer = client.get("/metrics")
        assert client.get("/validation/vmc").json()["verdict"] == "over"
    assert answer.headers["content-type"].startswith("text/plain; version=0.0.4")
    return answer.text


def value(text: str, name: str, **labels: str) -> float:
    for family in text_string_to_metric_families(text):
        for sample in family.samples:
            if sample.name == name and sample.labels == labels:
                return float(sample.value)
    raise KeyError((name, labels))


@pytest.mark.parametrize(
    ("name", "labels", "expected"),
    [
        ("twin_source_online", {"machine": "vmc"}, 1.0),
        ("twin_node_online", {"node": "edge-vmc"}, 1.0),
        ("twin_received_total", {"node": "edge-vmc"}, 10.0),
        ("twin_emitted_total", {"node": "twin-thermal"}, 5.0),
        ("twin_dropped_total", {"node": "edge-vmc", "reason": "unknown_key"}, 2.0),
        ("twin_buffer_depth", {"node": "edge-vmc"}, 1.0),
        ("twin_ledger_difference", {"node": "edge-vmc"}, 1.0),
        ("twin_ledger_difference", {"node": "twin-thermal"}, 0.0),
        ("twin_seq_gaps_total", {"layer": "control", "node": "edge-vmc"}, 3.0),
        ("twin_buffer_oldest_age_seconds", {"node": "edge-vmc"}, 4.5),
        ("twin_processor_lag_seconds", {"node": "twin-thermal"}, 0.25),
        ("twin_processor_published_lag_seconds", {"node": "twin-thermal"}, 0.5),
        ("twin_processor_busy_percent", {"node": "twin-thermal"}, 42.0),
        ("twin_processor_lag_events", {"node": "twin-thermal"}, 7.0),
        ("twin_processor_queue_depth", {"node": "twin-thermal"}, 7.0),
        ("twin_kafka_runners", {"node": "twin-thermal"}, 2.0),
        ("twin_kafka_lag_records", {"node": "twin-thermal"}, 40_213.0),
        ("twin_kafka_restore_seconds", {"node": "twin-thermal"}, 1.25),
        ("twin_kafka_transactions_aborted_total", {"node": "twin-thermal"}, 3.0),
        ("twin_kafka_bridge_waiting", {"node": "twin-thermal"}, 17.0),
        ("twin_kafka_bridge_dropped_total", {"node": "twin-thermal"}, 4.0),
        ("twin_gate_active", {"machine": "vmc"}, 1.0),
        ("twin_raw_score", {"machine": "vmc"}, 0.5),
        ("twin_alerts", {"state": "firing"}, 2.0),
        ("twin_alerts_total", {"state": "acknowledged"}, 1.0),
        ("twin_validation", {"machine": "vmc", "quantity": "temperature", "measure": "mae"}, 2.5),
        ("twin_validation", {"machine": "vmc", "quantity": "following_error", "measure": "rms_pct"}, 4.0),
        ("twin_validation", {"machine": "vmc", "quantity": "vibration", "measure": "r"}, 0.9),
        ("twin_validation_budget", {"machine": "vmc", "quantity": "temperature", "measure": "mae"}, 2.0),
        ("twin_validation_nights_over_budget", {"machine": "vmc"}, 1.0),
        ("twin_validation_last_run_timestamp_seconds", {"machine": "vmc"}, 1_777_600_000.0),
        ("twin_page_streams", {}, 0.0),
        ("twin_i3x_subscriptions", {}, 0.0),
        ("twin_i3x_updates_dropped_total", {}, 0.0),
        ("twin_model_missing", {"model": "residual"}, 0.0),
    ],
)  # fmt: skip
def test_a_metric_says_what_the_plant_says(text: str, name: str, labels: dict[str, str], expected: float) -> None:
    assert value(text, name, **labels) == expected


def test_the_age_of_a_source_is_by_event_time(text: str) -> None:
    assert 5.0 <= value(text, "twin_source_age_seconds", machine="vmc") < 60.0


def test_what_is_null_is_not_there(text: str) -> None:
    for name, labels in (
        ("twin_gap_growing", {"machine": "vmc"}),
        ("twin_validation", {"machine": "vmc", "quantity": "force", "measure": "mape"}),
    ):
        with pytest.raises(KeyError):
            value(text, name, **labels)


def test_every_phase_has_its_line(text: str) -> None:
    assert {phase: value(text, "twin_alerts", state=phase) for phase in PHASES} == {
        "pending": 0.0, "firing": 2.0, "acknowledged": 1.0, "resolved": 0.0,
    }  # fmt: skip


def test_a_machine_that_is_offline_is_said_to_be() -> None:
    live = small_plant(1_000)
    live.take([death({"spindle_load_pct": 1.0}, 2_000)], 2_000)
    with client_of(live) as client:
        assert 'twin_source_online{machine="vmc"} 0.0' in client.get("/metrics").text


def test_every_number_about_the_log_is_exported(text: str) -> None:
    numbers = {spec.name for spec in ON_LOG if spec.datatype is not DataType.STRING}
    exported = {name for table in (NODE_GAUGES, NODE_COUNTERS) for name, _ in table.values()}
    assert numbers - exported == set()


def test_a_node_that_is_folded_without_a_log_has_no_word_of_one(text: str) -> None:
    with pytest.raises(KeyError):
        value(text, "twin_kafka_runners", node="edge-vmc")


def test_promtool_takes_it(text: str, tmp_path: Path) -> None:
    promtool = shutil.which("promtool")
    if promtool is None:
        pytest.skip("no promtool on this machine; install the package prometheus")
    done = subprocess.run([promtool, "check", "metrics"], input=text, capture_output=True, text=True, check=False)
    # Of names it says what it would have otherwise; twin_alerts_total is a gauge, since the sheet of names has it so.
    complaints = [line for line in done.stderr.splitlines() if "twin_alerts_total" not in line]
    assert complaints == [], done.stderr
