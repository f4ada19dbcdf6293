"""Retained states of the wrong shape: anybody on the broker can leave one, and each command says so in one line."""

import copy
import json
import threading
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from datetime import UTC, datetime
from typing import Any

import pytest
from typer.testing import CliRunner

from cnctwin.commands.run.jobs import jobs_app
from cnctwin.commands.see.alerts import alerts_app
from cnctwin.errors import ApplicationError
from cnctwin.plant.alert_desk import ALERTS_NODE
from sparkplug.broker import BrokerAddress
from sparkplug.datatype import DataType
from sparkplug.edge_node import EdgeNode
from sparkplug.host import HostApplication
from sparkplug.metric import Change, MetricSpec, NodeId
from tests.cnctwin.program import until
from tests.wire.mosquitto import Mosquitto
from twin.vocabulary.topics import ALERT_STATE, JOBS_STATE, state_of_job

pytestmark = pytest.mark.broker
ODD: tuple[Any, ...] = (None, 7, -1e308, True, "x", [], [7], {"a": 7}, [{"a": [None]}], [None], "\x1b[31m")
ALERT = {
    **{"fingerprint": "f" * 16, "episode": 1, "phase": "firing", "severity": "high", "startsAt": "2026-11-22T06:00:00Z"},
    **{"labels": {"machine": "vmc", "alertname": "rule_vibration"}, "annotations": {"summary": "it shakes"}, "told": ["desk"]},
    **{"flapping": False, "unknown": False, "silenced_by": "", "undelivered": False, "acknowledged_by": ""},
}
ALERTS = {
    **{"alerts": [ALERT], "failures": [], "commands": []},
    "silences": [{"id": "s", "matchers": {"machine": "*"}, "ends": "2026-11-22T06:00:00Z", "by": "me", "comment": ""}],
    "receivers": {"desk": {"delivered": 1, "failed": 0, "waiting": 0, "held_back": 0, "last_error": ""}},
}
JOB = {
    **{"id": "j", "kind": "optimise", "machine": "vmc", "state": "queued", "place": 1, "progress_pct": 0.0, "attempt": 1},
    **{"doing": "", "reason": "", "sentence": "", "accepted_ms": 1_795_327_200_999, "changed_ms": 1_795_327_200_999},
}
JOBS = {"jobs": [JOB], "disk_trouble": ""}


@contextmanager
def signs_of_life(broker: BrokerAddress) -> Iterator[None]:
    """The node of the alerts processor, which publishes as if it lived."""
    node = EdgeNode(broker, NodeId("cnc", ALERTS_NODE), [MetricSpec("health/beat", DataType.INT64, value=0)])
    stop = threading.Event()

    def beat() -> None:
        while not stop.wait(0.02):
            node.publish(None, [Change("health/beat", 1, 1)])

    node.start()
    heart = threading.Thread(target=beat)
    heart.start()
    try:
        yield
    finally:
        stop.set()
        heart.join()
        node.stop()


def mutants(document: dict[str, Any]) -> Iterator[dict[str, Any]]:
    """Each place of a document with another value, the values in turn, and without one."""

    def places(node: Any, path: tuple[Any, ...] = ()) -> Iterator[tuple[Any, ...]]:
        for key, value in node.items() if isinstance(node, dict) else enumerate(node) if isinstance(node, list) else ():
            yield (*path, key)
            yield from places(value, (*path, key))

    for at, (*above, last) in enumerate(places(document)):
        for turn in range(2):
            changed = copy.deepcopy(document)
            node: Any = changed
            for key in above:
                node = node[key]
            if turn or isinstance(node, list):
                node[last] = ODD[(at + 5 * turn) % len(ODD)]
            else:
                del node[last]
            yield changed


@pytest.mark.parametrize(
    ("app", "document", "topic", "commands"),
    [
        (alerts_app, ALERTS, ALERT_STATE, (["list"], ["ack", "f", "--by", "me"])),
        (jobs_app, JOBS, JOBS_STATE, (["list"],)),
        (jobs_app, JOB, state_of_job("j"), (["show", "j"],)),
    ],
    ids=["alerts", "jobs", "a job"],
)
def test_a_state_of_another_shape_is_one_line(
    app: Any, document: dict[str, Any], topic: str, commands: tuple[list[str], ...], mosquitto: Mosquitto
) -> None:
    broker = BrokerAddress(*mosquitto.address)
    writer = HostApplication(broker, "writer", (), publish_state=False)
    heard: list[bytes] = []
    writer.subscribe_plain(topic)
    refused = 0
    with ExitStack() as stack:
        if app is alerts_app:
            stack.enter_context(signs_of_life(broker))
        writer.start()
        stack.callback(writer.stop)
        until(lambda: writer.poll(0.01) is not None and writer.online, "the writer")
        for state in (document, *mutants(document)):
            payload = json.dumps({"at": datetime.now(UTC).isoformat(), **state}).encode()
            writer.publish_plain(topic, payload, qos=1, retain=True)
            until(lambda: heard.extend(one.payload for one in writer.poll(0.01)) or payload in heard, "it to be retained")  # noqa: B023
            for command in commands:
                done = CliRunner().invoke(app, [*command, "--broker", broker.url, "--wait", "0.5"])
                if isinstance(done.exception, ApplicationError):
                    refused += 1
                    assert "\n" not in str(done.exception)
                    assert "\x1b" not in str(done.exception)
                else:
                    assert done.exception is None or isinstance(done.exception, SystemExit), (command, state, done.exception)
    assert refused > 0
