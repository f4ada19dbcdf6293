"""The night on the broker: twin metrics of node `twin-validation`, and a retained plain JSON for whoever speaks no Sparkplug."""

import json
import time
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any
from uuid import uuid4

from cnctwin.errors import UsageError
from cnctwin.validation.figure import Verdict
from cnctwin.validation.night import QUANTITIES, by_quantity
from processors.contract import Provenance
from sparkplug.broker import BrokerAddress
from sparkplug.datatype import DataType
from sparkplug.edge_node import EdgeNode
from sparkplug.errors import AnotherRunsError
from sparkplug.host import HostApplication
from sparkplug.metric import Change, MetricSpec, NodeId
from sparkplug.quality import Quality
from twin.vocabulary.nodes import VALIDATION_NODE
from twin.vocabulary.topics import VALIDATION, VALIDATION_BARRIER
from twin.vocabulary.twin_signals import TWIN_PREFIX

PREFIX = f"{TWIN_PREFIX}validation/"
PLAIN_NIGHTS = 7
WAIT_S_MAX = 10.0
TURN_S_MAX = 60.0
TICK_S = 0.2
NAMES = (
    *("temperature_mae", "temperature_rmse", "temperature_mae_worst_hour", "temperature_rmse_worst_hour"),
    *("force_mape", "vibration_r", "following_error_rms_pct", "cycle_time_error_pct"),
)
"""The published names: of several axes or programs the worst one is published; all are in the plain JSON."""


def metrics(told: Mapping[str, Any]) -> tuple[list[MetricSpec], list[Change]]:
    """Return what is declared and what is published of `validation_of`'s answer."""
    stamp_ms, figures = int(told["t"]), told["figures"]
    inferred = {"provenance": Provenance.INFERRED.value}
    specs: list[MetricSpec] = []
    changes: list[Change] = []

    def tell(name: str, kind: DataType, value: Any, unit: str | None = None, reason: str | None = None) -> None:
        quality = Quality.BAD if value is None else Quality.GOOD
        specs.append(MetricSpec(PREFIX + name, kind, unit or None, properties=inferred))
        changes.append(Change(PREFIX + name, value, stamp_ms, quality, reason))

    for name in NAMES:
        own = [one for one in figures if f"{one['quantity']}_{one['measure']}" == name]
        known = [one for one in own if one["value"] is not None]
        worst = max(known, key=lambda one: abs(one["value"]), default=None)
        reason = None if worst else str(own[0]["reason"]) if own else "not judged"
        tell(name, DataType.DOUBLE, worst and worst["value"], own[0]["unit"] if own else None, reason)
        tell(f"{name}_budget", DataType.DOUBLE, own[0]["budget"] if own else None, own[0]["unit"] if own else None, reason)
    verdicts = by_quantity(figures)
    for quantity in QUANTITIES:
        tell(f"{quantity}_verdict", DataType.STRING, str(verdicts.get(quantity, Verdict.UNSEEN)))
    tell("verdict", DataType.STRING, str(told["verdict"]))
    tell("retrain", DataType.BOOLEAN, bool(told["retrain"]))
    tell("retrain_reason", DataType.STRING, told["retrain_reason"] or "none")
    tell("nights_over_budget", DataType.INT64, max(told["over_in_a_row"].values(), default=0))
    return specs, changes


def publish(told: Mapping[str, Any], broker: BrokerAddress, group: str, session_file: Path | None) -> None:
    """Publish the answer of `validation_of`, and wait until the broker has taken it. Raises UsageError where it does not."""
    specs, changes = metrics(told)
    confirmed: list[int] = []
    node = _own_turn(
        lambda: EdgeNode(
            *(broker, NodeId(group, VALIDATION_NODE)),
            session_file=session_file,
            barrier_topic=VALIDATION_BARRIER,
            on_confirmed=confirmed.append,
        )
    )
    machine = str(told["machine"])
    node.declare_device(machine, specs)
    node.start()
    try:
        if not _until(lambda: node.online):
            raise UsageError(node.last_error or f"{broker.url} cannot be reached within {WAIT_S_MAX:g} s")
        node.publish(machine, changes)
        node.barrier(1, node.session)
        if not _until(lambda: bool(confirmed)):
            raise UsageError(f"{broker.url} has not confirmed the figures within {WAIT_S_MAX:g} s; the history file has them")
    finally:
        node.stop()
    _publish_plain({**told, "nights": told["nights"][-PLAIN_NIGHTS:]}, broker)


def _own_turn(node: Callable[[], EdgeNode]) -> EdgeNode:
    """Return the node when no other night is being published: timers start the validations of several machines at once."""
    until_s = time.monotonic() + TURN_S_MAX
    while True:
        try:
            return node()
        except AnotherRunsError:
            if time.monotonic() > until_s:
                raise
            time.sleep(TICK_S)


def _publish_plain(told: Mapping[str, Any], broker: BrokerAddress) -> None:
    host = HostApplication(broker, f"validation-{uuid4().hex[:12]}", (), publish_state=False)
    topic = VALIDATION + str(told["machine"]).translate({ord(letter): "_" for letter in "/+#"})
    payload = json.dumps(told, ensure_ascii=False, allow_nan=False).encode()
    heard: list[bytes] = []
    host.subscribe_plain(topic)
    host.start()

    def arrived() -> bool:
        heard.extend(event.payload for event in host.poll(0.05) if event.topic == topic)
        return payload in heard

    try:
        if not _until(lambda: host.poll(0.05) is not None and host.online):
            raise UsageError(host.last_error or f"{broker.url} cannot be reached within {WAIT_S_MAX:g} s")
        host.publish_plain(topic, payload, qos=1, retain=True)
        if not _until(arrived):
            raise UsageError(f"{broker.url} has not taken {topic} within {WAIT_S_MAX:g} s; may this user write there?")
    finally:
        host.stop()


def _until(true: Callable[[], bool]) -> bool:
    deadline_s = time.monotonic() + WAIT_S_MAX
    while not (so := true()) and time.monotonic() < deadline_s:
        time.sleep(0.02)
    return so
