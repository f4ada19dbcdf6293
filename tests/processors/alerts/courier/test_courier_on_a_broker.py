"""The courier on a real broker, with a real receiver: order, retries, kill -9 at any moment, broker and courier started again."""

import json
import random
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

from processors.alerts.config import AlertsConfig
from processors.alerts.courier.thread import Courier
from processors.running.runtime import configured, run
from sparkplug.broker import BrokerAddress
from sparkplug.datatype import DataType
from sparkplug.edge_node import EdgeNode
from sparkplug.metric import Change, MetricSpec, NodeId
from tests.processors.alerts.courier.alert_shop import VIBRATION
from tests.processors.alerts.courier.office import CLAIM, OUTBOX, RECEIPT, ROOT, STATE, Office, until
from tests.processors.alerts.courier.receiving_server import Answer, ReceivingServer
from tests.until_stopped import until_stopped
from tests.wire.mosquitto import Mosquitto

pytestmark = pytest.mark.broker


@pytest.fixture
def server() -> Iterator[ReceivingServer]:
    with ReceivingServer() as server:
        yield server


def config(server: ReceivingServer, **receivers: dict[str, Any]) -> dict[str, Any]:
    """One webhook called desk, and these."""
    desk = {"type": "webhook", "url": f"{server.url}/desk", "timeout_s": 60.0}
    return {"receivers": {"desk": desk, **receivers}}


@pytest.fixture
def courier(broker: BrokerAddress, server: ReceivingServer) -> Iterator[Callable[..., Courier]]:
    """Makes and starts couriers; they are stopped in the end."""
    made: list[Courier] = []

    def make(**receivers: dict[str, Any]) -> Courier:
        one = Courier(broker, AlertsConfig.model_validate(config(server, **receivers)))
        one.start()
        made.append(one)
        return one

    yield make
    for one in made:
        if one.is_alive:
            one.stop()


def test_a_notification_is_claimed_then_sent_then_said_to_be_delivered(
    office: Office, server: ReceivingServer, courier: Callable[..., Courier]
) -> None:
    may_answer = threading.Event()
    server.usual = Answer(hold=may_answer)
    courier()
    office.put("a1")
    until(lambda: server.received, "the request")
    until(lambda: CLAIM + "a1" in office.topics, "the claim")  # while the receiver has not answered yet
    claim = json.loads(office.topics[CLAIM + "a1"])
    assert (claim["phase"], claim["attempt"]) == ("sending", 1)
    may_answer.set()
    until(lambda: office.outcome("a1") == "delivered", "the delivery")
    office.publish(OUTBOX + "a1", b"")
    until(lambda: CLAIM + "a1" not in office.topics, "the end of the claim")
    assert server.ids() == {"a1": 1}


def test_what_waits_when_the_courier_starts_is_sent_in_any_case_once(
    office: Office, server: ReceivingServer, courier: Callable[..., Courier]
) -> None:
    for number in range(20):
        office.put(f"a{number:02d}")
    courier()
    until(lambda: len(office.deliveries) == 20, "twenty deliveries")
    office.put("a03")  # the alerts processor says it again
    time.sleep(0.5)
    assert server.ids() == {f"a{number:02d}": 1 for number in range(20)}


def test_what_is_refused_fails_with_the_reason_and_what_is_surely_not_taken_is_tried_again(
    office: Office, server: ReceivingServer, courier: Callable[..., Courier]
) -> None:
    courier()
    server.answers.append(Answer(401))
    office.put("refused")
    until(lambda: office.outcome("refused") == "failed", "the failure")
    assert office.deliveries["refused"][-1]["reason"] == "127.0.0.1 answered 401"
    server.answers.extend([Answer(503), Answer(200)])
    office.put("again")
    until(lambda: office.outcome("again") == "delivered", "the second attempt")
    server.answers.append(Answer(drop=True))
    office.put("unsure")
    until(lambda: office.outcome("unsure") == "failed", "the failure")
    assert office.deliveries["unsure"][-1]["reason"].endswith("it may have arrived")
    assert server.ids() == {"refused": 1, "again": 2, "unsure": 1}


def test_a_slow_receiver_holds_up_no_other(office: Office, server: ReceivingServer, courier: Callable[..., Courier]) -> None:
    may_answer = threading.Event()
    server.by_path["/slow"] = Answer(hold=may_answer)
    courier(slow={"type": "webhook", "url": f"{server.url}/slow", "timeout_s": 60.0})
    office.put("s", "slow")
    until(lambda: server.received, "the slow request")
    for number in range(5):
        office.put(f"q{number}")
    until(lambda: len(office.deliveries) == 5, "the quick ones")
    assert office.outcome("s") == ""
    may_answer.set()
    until(lambda: office.outcome("s") == "delivered", "the slow one")


def test_what_nobody_is_configured_for_and_what_is_too_old_fails(office: Office, courier: Callable[..., Courier]) -> None:
    courier()
    office.put("u", "nobody")
    office.put("o", expires_s=time.time() - 1.0)
    until(lambda: office.outcome("u") == office.outcome("o") == "failed", "the failures")
    assert office.deliveries["u"][-1]["reason"] == "the sending process has no receiver nobody in its configuration"


def test_two_couriers_that_overlap_send_each_notification_once_and_leave_no_thread(
    broker: BrokerAddress, office: Office, server: ReceivingServer
) -> None:
    server.usual = Answer(wait_s=0.05)
    before = set(threading.enumerate())
    one, other = (Courier(broker, AlertsConfig.model_validate(config(server)), "cnc", name) for name in ("r0", "r1"))
    keys = [f"a{number:02d}" for number in range(20)]
    for courier in (one, other):
        courier.start()
    for key in keys:
        office.put(key)
    until(lambda: len(office.deliveries) >= 5, "some deliveries")
    one.stop()
    until(lambda: len(office.deliveries) == len(keys), "the others")
    other.stop()
    until(lambda: not [one for one in {*threading.enumerate()} - before if "courier" in one.name], "the ends of their threads")
    assert server.ids() == dict.fromkeys(keys, 1)


def test_a_courier_that_is_stopped_finishes_what_it_is_sending(
    office: Office, server: ReceivingServer, courier: Callable[..., Courier]
) -> None:
    server.usual = Answer(wait_s=1.0)
    one = courier()
    office.put("a")
    office.put("b")
    until(lambda: server.received, "the request")
    one.stop()
    assert server.ids() == {"a": 1}
    until(lambda: office.outcome("a") == "delivered", "the end of what was being sent")
    assert office.outcome("b") == ""
    server.usual = Answer()
    courier()
    until(lambda: office.outcome("b") == "delivered", "the rest")
    assert server.ids() == {"a": 1, "b": 1}


def test_what_was_surely_not_taken_goes_on_after_a_restart(
    office: Office, server: ReceivingServer, courier: Callable[..., Courier]
) -> None:
    server.usual = Answer(503)
    one = courier()
    office.put("a")
    until(lambda: json.loads(office.topics.get(CLAIM + "a", b"{}")).get("phase") == "waiting", "the backoff")
    one.stop()
    server.usual = Answer(200)
    courier()
    until(lambda: office.outcome("a") == "delivered", "the next life")


def test_a_broker_that_is_killed_and_comes_back_empty_brings_no_notification_twice(
    mosquitto: Mosquitto, office: Office, server: ReceivingServer, courier: Callable[..., Courier]
) -> None:
    courier()
    office.put("a")
    until(lambda: office.outcome("a") == "delivered", "the delivery")
    mosquitto.kill()
    until(lambda: not office.online, "the office to notice")
    office.topics.clear()
    office.deliveries.clear()
    mosquitto.start()
    office.put("a")  # the alerts processor does not know its fate and says it again
    until(lambda: office.outcome("a") == "delivered", "the fate again")
    assert server.ids() == {"a": 1}


# kill -9

CODE = """
import json, sys, threading
from processors.alerts.config import AlertsConfig
from processors.alerts.courier.thread import Courier
from sparkplug.broker import BrokerAddress
Courier(BrokerAddress(port=int(sys.argv[1])), AlertsConfig.model_validate(json.loads(sys.argv[2]))).start()
threading.Event().wait()
"""


def started(broker: BrokerAddress, server: ReceivingServer) -> "subprocess.Popen[bytes]":
    command = [sys.executable, "-c", CODE, str(broker.port), json.dumps(config(server))]
    return subprocess.Popen(command, cwd=ROOT, stdin=subprocess.DEVNULL)


@pytest.mark.parametrize("seed", [1])
def test_killed_at_any_moment_nothing_comes_twice_and_what_is_missing_is_said_to_have_failed(
    seed: int, broker: BrokerAddress, office: Office, server: ReceivingServer
) -> None:
    chance = random.Random(seed)
    keys = [f"n{number:03d}" for number in range(80)]
    for key in keys:
        office.put(key)
    kills = 0
    while len(office.deliveries) < len(keys):
        server.usual = Answer(wait_s=chance.choice([0.0, 0.05, 0.3]))
        before = len(server.received) + len(office.deliveries)
        life = started(broker, server)
        until(lambda before=before: len(server.received) + len(office.deliveries) > before, "a sign of life")
        time.sleep(chance.uniform(0.0, 0.25))
        if kills < 7:
            life.kill()
            kills += 1
        else:
            until(lambda: len(office.deliveries) == len(keys), "the last fates", seconds=180.0)
            life.kill()
        life.wait()
    arrived = server.ids()
    assert [key for key, count in arrived.items() if count > 1] == []
    outcomes = {key: {one["outcome"] for one in office.deliveries[key]} for key in keys}
    assert [key for key in keys if outcomes[key] not in ({"delivered"}, {"failed"})] == []
    assert [key for key in keys if key not in arrived and outcomes[key] != {"failed"}] == []
    assert [key for key in keys if outcomes[key] == {"delivered"} and key not in arrived] == []
    interrupted = [key for key in keys if outcomes[key] == {"failed"}]
    assert {office.deliveries[key][-1]["reason"] for key in interrupted} <= {"interrupted while sending; it may have arrived"}
    assert len(interrupted) <= kills
    print(f"{kills} kills: {len(arrived)} of {len(keys)} arrived, {len(interrupted)} reported as failed")


# Emergencies at Pushover.


def pushover(server: ReceivingServer, monkeypatch: pytest.MonkeyPatch) -> dict[str, Any]:
    monkeypatch.setenv("PUSHOVER_TOKEN", "t" * 30)
    monkeypatch.setenv("PUSHOVER_USER", "u" * 30)
    monkeypatch.setattr("processors.alerts.courier.thread.POLLS_S_MIN", 0.3)
    server.by_path["/1/messages.json"] = Answer(200, b'{"status":1,"request":"r","receipt":"rcpt1"}')
    server.by_path["/1/receipts/rcpt1.json"] = Answer(200, b'{"status":1,"acknowledged":0,"expired":0}')
    server.by_path["/1/receipts/rcpt1/cancel.json"] = Answer(200, b'{"status":1}')
    return {"type": "pushover", "url": server.url, "token": "$PUSHOVER_TOKEN", "user": "$PUSHOVER_USER"}


def test_who_acknowledges_on_the_phone_acknowledges_here(
    office: Office, server: ReceivingServer, courier: Callable[..., Courier], monkeypatch: pytest.MonkeyPatch
) -> None:
    courier(phone=pushover(server, monkeypatch))
    office.state(("fp", 1795000000000))
    office.put("p", "phone", says=["fp.1795000000000.firing.0.high"])
    until(lambda: RECEIPT + "p" in office.topics, "the receipt on the broker")
    until(lambda: any(r.path == "/1/receipts/rcpt1.json" for r in server.received), "a question")
    assert office.commands == []
    server.by_path["/1/receipts/rcpt1.json"] = Answer(
        200, b'{"status":1,"acknowledged":1,"acknowledged_by":"uuuu","acknowledged_by_device":"ada-phone"}'
    )
    topic, command = until(lambda: office.commands, "the acknowledgement")[0]
    assert topic == "cnctwin/alerts/command/ack"
    assert (command["by"], command["fingerprint"], command["episode"]) == ("pushover ada-phone", "fp", 1795000000000)
    office.state(("fp", 1795000000000), phase="acknowledged")
    until(lambda: RECEIPT + "p" not in office.topics, "the end of the receipt")
    assert not any(r.path.endswith("cancel.json") for r in server.received)


def test_an_emergency_whose_alert_is_over_is_stopped_also_by_the_next_life_of_the_courier(
    office: Office, server: ReceivingServer, courier: Callable[..., Courier], monkeypatch: pytest.MonkeyPatch
) -> None:
    receiver = pushover(server, monkeypatch)
    one = courier(phone=receiver)
    office.state(("fp", 1795000000000))
    office.put("p", "phone", says=["fp.1795000000000.firing.0.high"])
    until(lambda: RECEIPT + "p" in office.topics, "the receipt on the broker")
    one.stop()
    office.state()
    courier(phone=receiver)
    until(lambda: any(r.path.endswith("cancel.json") for r in server.received), "the cancellation")
    until(lambda: RECEIPT + "p" not in office.topics, "the end of the receipt")


def test_what_fires_is_kept_firing_at_an_alertmanager(
    office: Office, server: ReceivingServer, courier: Callable[..., Courier]
) -> None:
    courier(am={"type": "alertmanager", "url": server.url, "resend_s": 5.0})
    office.state(("fp", 1), told=("am",))
    until(lambda: len([r for r in server.received if r.path == "/api/v2/alerts"]) >= 2, "two refreshes")
    office.state()
    office.put("after")
    until(lambda: office.outcome("after") == "delivered", "what was said after the state")
    before = len(server.received)
    time.sleep(6.0)
    assert len(server.received) == before


# All of it.


def test_from_the_alarm_on_a_machine_to_the_receiver_and_back(
    broker: BrokerAddress, office: Office, server: ReceivingServer, courier: Callable[..., Courier], tmp_path: Path
) -> None:
    table = f'[alerts]\ngroup_wait_s = 0.5\n[alerts.receivers.desk]\ntype = "webhook"\nurl = "{server.url}/desk"\n'
    (tmp_path / "alerts.toml").write_text(table)
    edge = EdgeNode(broker, NodeId("cnc", "edge-okuma"), [MetricSpec("health/beat", DataType.INT64)])
    edge.declare_device("okuma", [MetricSpec(VIBRATION, DataType.BOOLEAN)])
    edge.start()
    until(lambda: edge.online, "the edge")
    try:
        with until_stopped(run, configured(["alerts"], tmp_path / "alerts.toml"), broker):
            courier()
            until(lambda: STATE in office.topics, "the state")
            edge.publish("okuma", [Change(VIBRATION, True, time.time_ns() // 1_000_000)])
            until(lambda: server.received, "the notification")
            (received,) = server.received
            (alert,) = received.json["alerts"]
            assert alert["labels"]["machine"] == "okuma"

            def shown() -> dict[str, Any]:
                return dict(json.loads(office.topics[STATE]))

            until(lambda: shown()["receivers"]["desk"]["delivered"] == 1, "the fate in the state")
            command = {"id": "c1", "by": "ada", "fingerprint": alert["fingerprint"]}
            office.publish("cnctwin/alerts/command/ack", json.dumps(command).encode(), retain=False)
            until(lambda: shown()["alerts"][0]["acknowledged_by"] == "ada", "the acknowledgement")
    finally:
        edge.stop()
    assert len(server.received) == 1
