"""Ten minutes of two machines, as the broker tells them to the historian, and what the runtime interface says meanwhile.

Signals are told when they change: the fast ones each two seconds, a tool number when the tool is changed.
"""

import math
from collections.abc import Iterator

from cnctwin.memory.store.contract import Message
from processors.discovery import discover
from sparkplug.host_session import EventKind, HostEvent
from sparkplug.metric import NodeId, Reading
from sparkplug.quality import Quality
from sparkplug.values import Value
from twin.vocabulary.twin_signals import TWIN_PREFIX

MACHINES = ("okuma", "mazak.01")
GOOD, BAD = (Quality.GOOD, None, None), (Quality.BAD, None, "the sensor is silent")
SECONDS = 600
STEADY: dict[str, Value] = {  # told once, a minute after the beginning
    "exec_state": "ACTIVE", "twin/severity": "medium", "program": "O1000",
    "spindle_rpm_cmd": 8000.0, "feed_override_pct": 100.0, "ambient_temp_c": 21.5,
    "twin/anomaly_threshold": 0.4, "twin/gated_share_pct": 3.0, "twin/common_mode": False, "twin/gap_growing": False,
    "twin/gap_left_out_pct": 11.0, "twin/rule_load_over_limit": False, "twin/rule_thermal_runaway": False,
    "twin/anomaly_alarm": False, "twin/rule_load_without_feed": False, "twin/rule_vibration": True,
    "twin/oee": 0.61, "twin/availability": 0.75, "twin/performance": 0.9, "twin/quality": 0.91, "twin/planned_s": 3600.0,
    "twin/production_s": 2700.0, "twin/setup_s": 300.0, "twin/delay_s": 500.0, "twin/down_s": 100.0, "twin/unknown_s": 0.0,
    "twin/parts_made": 10, "twin/parts_good": 9, "twin/parts_scrap": 1, "twin/shift_energy_kwh": 2.0, "twin/part_energy_kwh": 0.2,
}  # fmt: skip
FAST = (
    "spindle_rpm", "spindle_load_pct", "feed_mm_min", "axis_x_load_pct", "axis_z_load_pct", "spindle_temp_c",
    "twin/spindle_temp_c", "twin/spindle_temp_residual_k", "twin/spindle_temp_rise_k", "twin/cutting_force_n",
    "twin/raw_score", "twin/adjusted_score",
)  # fmt: skip
A_MINUTE = tuple(
    f"twin/gap_{name}" for name in ("spindle_temp_c", "spindle_temp_c/steady", "spindle_load_pct", "spindle_load_pct/mean")
)
TOOL_CHANGE_S = (200, 206)


def fast(second: int) -> float:
    """Return what a fast signal is at a moment."""
    return 50.0 + 20.0 * math.sin(second / 7.0)


def _told(machine: str, second: int) -> Iterator[tuple[str, Value]]:
    """What changes at a second; None: it is bad from now on. The load of the second machine is, in the last minute."""
    if second == 30:
        yield from (("tool_number", 3), ("tool_change_active", False), ("twin/tool_change_gate", False))
    if second == 60:
        yield from STEADY.items()
    if second in TOOL_CHANGE_S:
        begins = second == TOOL_CHANGE_S[0]
        yield from (("tool_change_active", begins), ("twin/tool_change_gate", begins))
        if not begins:
            yield "tool_number", 7
    if second % 60 == 0:
        yield from ((signal, 1.0 + second / 600.0) for signal in A_MINUTE)
    if second % 2 == 0:
        bad = machine == MACHINES[1] and second >= SECONDS - 60
        yield from ((signal, None if bad and signal == "spindle_load_pct" else fast(second)) for signal in FAST)


def messages(end_ms: int) -> Iterator[Message]:
    """All of it, up to `end_ms`: of each machine its edge and a processor."""
    for second in range(SECONDS):
        at_ms = end_ms - (SECONDS - second) * 1000
        for machine in MACHINES:
            told = [
                Reading(name, value, at_ms, *(GOOD if value is not None else BAD), False)
                for name, value in _told(machine, second)
            ]
            for node, is_twin in ((f"edge-{machine}", False), ("twin-x", True)):
                readings = tuple(one for one in told if one.name.startswith(TWIN_PREFIX) is is_twin)
                if readings:
                    yield Message(at_ms, HostEvent(EventKind.DATA, NodeId("cnc", node), machine, at_ms, readings))


OKUMA, EDGE, GAP = '{machine="okuma"}', '{node="edge-okuma"}', '{node="twin-gap"}'
GAUGES = {
    f"twin_source_age_seconds{OKUMA}": 0.4, f"twin_source_online{OKUMA}": 1, 'twin_source_online{machine="mazak.01"}': 0,
    f"twin_ledger_difference{EDGE}": 0, "twin_store_days_left": 61, "twin_store_bytes": 1e9, "twin_store_waiting": 12,
    'twin_model_missing{model="residual"}': 1, 'twin_alerts{state="firing"}': 2, f"twin_processor_lag_seconds{GAP}": 0.1,
    f"twin_processor_queue_depth{GAP}": 0, f"twin_state_checkpoint_age_seconds{GAP}": 1.5,
    f"twin_buffer_depth{EDGE}": 3, f"twin_clock_offset_seconds{OKUMA}": -0.2,
    f"twin_kafka_runners{GAP}": 2, f"twin_kafka_runners_silent{GAP}": 0, f"twin_kafka_partitions{GAP}": 12,
    f"twin_kafka_lag_records{GAP}": 40, f"twin_kafka_restore_seconds{GAP}": 1.5, f"twin_kafka_bridges_silent{GAP}": 0,
    f"twin_kafka_bridge_waiting{GAP}": 7, f"twin_kafka_bridge_busy_percent{GAP}": 31, f"twin_processor_busy_percent{GAP}": 55,
    f"twin_validation_nights_over_budget{OKUMA}": 1, f"twin_validation_last_run_timestamp_seconds{OKUMA}": 1.78e9,
}  # fmt: skip
NIGHT = (
    ("temperature", "mae"), ("temperature", "rmse"), ("force", "mape"), ("vibration", "r"),
    ("following_error", "rms_pct"), ("cycle_time", "error_pct"),
)  # fmt: skip
COUNTERS = (
    'twin_dropped_total{node="edge-okuma",reason="store_age"}', f"twin_emitted_total{EDGE}",
    'twin_seq_gaps_total{layer="control",node="edge-okuma"}', "twin_store_samples_total", f"twin_emitted_total{GAP}",
    *(f"twin_kafka_{name}_total{GAP}" for name in (
        "records", "transactions", "transactions_aborted", "rebalances", "lost_by_retention", "repeated",
        "bridge_events", "bridge_delivered", "bridge_dropped",
    )),
)  # fmt: skip


def exposition(end_ms: int) -> str:
    """Return what a scrape every 15 s of /metrics has brought, in Prometheus' form with times."""
    validation = {
        f'{name}{{machine="okuma",quantity="{quantity}",measure="{measure}"}}': value
        for name, value in (("twin_validation", 0.9), ("twin_validation_budget", 2.0))
        for quantity, measure in NIGHT
    }
    return "".join(
        f"{name} {value} {t_ms}\n"
        for t_ms in range(end_ms - SECONDS * 1000, end_ms + 1, 15_000)
        for name, value in (
            *GAUGES.items(),
            *validation.items(),
            *((name, (t_ms - end_ms) / 1000 + SECONDS) for name in COUNTERS),
        )
    )


def published() -> set[str]:
    """The signals that processors declare."""
    return {output.name for processor in discover().values() for output in processor.outputs}
