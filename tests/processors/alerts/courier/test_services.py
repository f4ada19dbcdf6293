"""What each receiver is sent, and what each way to answer is taken for."""

import json
import logging
import os
import quopri
import socket
from collections.abc import Iterator
from pathlib import Path
from typing import Any
from unittest.mock import patch

import pytest
from pydantic import TypeAdapter

from processors.alerts.courier.alertmanager import alerts_for
from processors.alerts.courier.outcome import Verdict
from processors.alerts.courier.pushover import Pushover, ReceiptState
from processors.alerts.courier.secret import read_secret
from processors.alerts.courier.service import Service, service_of
from processors.alerts.messages import OUTBOX
from processors.alerts.notification import Notification
from processors.alerts.receivers import AnyReceiver
from processors.errors import ConfigurationError
from tests.processors.alerts.courier.alert_shop import Shop
from tests.processors.alerts.courier.receiving_server import Answer, ReceivingServer

TOKEN, USER = "azGDORePK8gMaC0QOYAMyEEuzJnyUi", "uQiRzpo4DXghDmr9QzzfQu27cmVRsG"
ENVIRONMENT = {"TOKEN": TOKEN, "USER": USER, "BEARER": "b34r3r-s3cr3t"}
RECEIVER: TypeAdapter[Any] = TypeAdapter(AnyReceiver)


@pytest.fixture
def server() -> Iterator[ReceivingServer]:
    with ReceivingServer() as server:
        yield server


def service(server: ReceivingServer, kind: str = "webhook", **fields: Any) -> Service:
    """A service that talks to the test's server."""
    secrets = {"token": "$TOKEN", "user": "$USER"} if kind == "pushover" else {"bearer": "$BEARER"}
    url = {"url": server.url + ("/hook" if kind == "webhook" else "")}
    return service_of("x", RECEIVER.validate_python({"type": kind, "timeout_s": 60.0} | secrets | url | fields), ENVIRONMENT)


def message(severity: str = "high", **values: Any) -> Notification:
    """A notification as the fold makes it."""
    shop = Shop()
    if severity == "resolved":
        shop.set(vibration=True)
        shop.wait(20)
        shop.set(vibration=False)
        while len(shop.told) < 2:
            shop.wait(1)
    else:
        shop.set(**({"vibration": True} if severity == "high" else {"score": True} if severity == "medium" else {"drift": True}))
        shop.wait(20)
    payload = shop.retained[OUTBOX + shop.told[-1].id]
    return Notification.of(json.dumps(json.loads(payload) | values).encode())


# What an answer means.


@pytest.mark.parametrize(
    ("answer", "verdict", "reason"),
    [
        (Answer(200), Verdict.DELIVERED, ""),
        (Answer(202, b""), Verdict.DELIVERED, ""),
        (Answer(200, b"not JSON"), Verdict.DELIVERED, ""),
        (Answer(301, headers=(("Location", "http://127.0.0.1:1/"),)), Verdict.REFUSED, "127.0.0.1 answered 301"),
        (Answer(400), Verdict.REFUSED, "127.0.0.1 answered 400"),
        (Answer(401), Verdict.REFUSED, "127.0.0.1 answered 401"),
        (Answer(429), Verdict.NOT_TAKEN, "127.0.0.1 answered 429"),
        (Answer(500), Verdict.NOT_TAKEN, "127.0.0.1 answered 500"),
        (Answer(503), Verdict.NOT_TAKEN, "127.0.0.1 answered 503"),
        (Answer(504), Verdict.UNSURE, "127.0.0.1 answered 504: a gateway had no answer; it may have arrived"),
        (Answer(drop=True), Verdict.UNSURE, "it may have arrived"),
        (Answer(wait_s=3.0), Verdict.UNSURE, "ReadTimeout after 1 s; it may have arrived"),
    ],
)
def test_what_each_answer_means(server: ReceivingServer, answer: Answer, verdict: Verdict, reason: str) -> None:
    server.answers.append(answer)
    outcome = service(server, **({"timeout_s": 1.0} if answer.wait_s else {})).send(message())
    assert outcome.verdict is verdict
    assert reason in outcome.reason
    assert len(server.received) == 1


def test_a_receiver_that_drips_does_not_hold_the_courier_for_ever(server: ReceivingServer) -> None:
    server.usual = Answer(drip=True)
    outcome = service(server, timeout_s=1.0).send(message())
    assert outcome.verdict is Verdict.UNSURE
    assert "no answer within 1 s" in outcome.reason


def test_what_was_surely_not_taken_is_told_apart_from_what_may_have_been() -> None:
    with socket.socket() as deaf:  # it has the port, and listens to nobody
        deaf.bind(("127.0.0.1", 0))
        port = deaf.getsockname()[1]
        for url, said in (
            (f"http://127.0.0.1:{port}/x", f"127.0.0.1:{port}: connection refused"),
            ("https://nowhere.invalid/x", "nowhere.invalid: there is no host of this name"),
        ):
            receiver = RECEIVER.validate_python({"type": "webhook", "url": url, "timeout_s": 20.0})
            outcome = service_of("x", receiver, {}).send(message())
            assert outcome.verdict is Verdict.NOT_TAKEN, outcome
            assert said in outcome.reason


def test_a_server_without_tls_where_tls_is_asked_for_has_taken_nothing(server: ReceivingServer) -> None:
    receiver = RECEIVER.validate_python({"type": "webhook", "url": f"https://127.0.0.1:{server.port}/x", "timeout_s": 2.0})
    assert service_of("x", receiver, {}).send(message()).verdict is Verdict.NOT_TAKEN
    assert server.received == []


def test_a_receiver_may_ask_for_time(server: ReceivingServer) -> None:
    server.answers.append(Answer(429, headers=(("Retry-After", "17"),)))
    assert service(server).send(message()).after_s == 17.0


# Webhook.


def test_a_webhook_is_sent_the_body_with_its_id_and_bearer(server: ReceivingServer) -> None:
    told = message()
    assert service(server).send(told).verdict is Verdict.DELIVERED
    (received,) = server.received
    assert (received.method, received.path, received.id) == ("POST", "/hook", told.id)
    assert received.headers["authorization"] == "Bearer b34r3r-s3cr3t"
    assert received.headers["content-type"] == "application/json"
    assert received.json == told.body
    assert received.json["version"] == "4"


# Alertmanager.


def test_alertmanager_is_sent_an_array_of_alerts_that_end_unless_sent_again(server: ReceivingServer) -> None:
    assert service(server, "alertmanager", resend_s=60.0).send(message()).verdict is Verdict.DELIVERED
    (received,) = server.received
    assert (received.method, received.path) == ("POST", "/api/v2/alerts")
    (alert,) = received.json
    assert set(alert) == {"labels", "annotations", "startsAt", "endsAt"}
    assert alert["labels"]["alertname"] == "rule_vibration"
    assert alert["startsAt"] <= alert["endsAt"]


def test_what_fires_ends_four_resends_from_now_and_what_is_resolved_has_ended() -> None:
    now_s = 1_795_000_100.0
    (alert,) = alerts_for(message().body["alerts"], now_s, 240.0)
    assert (alert["startsAt"], alert["endsAt"]) == ("2026-11-18T11:06:40.000Z", "2026-11-18T11:12:20.000Z")
    (alert,) = alerts_for(message("resolved").body["alerts"], now_s, 240.0)
    assert alert["endsAt"] == "2026-11-18T11:07:00.000Z"
    (early,) = alerts_for(message("resolved").body["alerts"], now_s - 95.0, 240.0)
    assert early["endsAt"] == "2026-11-18T11:06:45.000Z"  # never in the future, or it would still fire


def test_an_alert_that_was_raised_ends_at_its_lesser_severity() -> None:
    told = message()
    rows = alerts_for(told.body["alerts"], 1_795_000_100.0, 240.0, {told.body["alerts"][0]["fingerprint"]})
    assert [(row["labels"]["severity"], row["endsAt"][14:19]) for row in rows] == [
        ("high", "12:20"),
        ("low", "08:20"),
        ("medium", "08:20"),
    ]


def test_alertmanager_may_be_sent_again_what_may_have_arrived(server: ReceivingServer) -> None:
    server.answers.append(Answer(drop=True))
    assert service(server, "alertmanager").send(message()).verdict is Verdict.NOT_TAKEN


# Pushover.

QUEUED = Answer(200, b'{"status":1,"request":"647d2300-702c-4b38-8b2f-d56326ae460b"}')
RINGS = Answer(200, b'{"receipt":"rLqVuqTRh62UzxtmqiaLzQmVcPgiCy","status":1,"request":"647d2300"}')


@pytest.mark.parametrize(("severity", "priority"), [("high", "2"), ("medium", "0"), ("low", "-1"), ("resolved", "-1")])
def test_pushover_is_told_the_priority_of_the_severity(server: ReceivingServer, severity: str, priority: str) -> None:
    server.usual = QUEUED
    assert service(server, "pushover").send(message(severity)).verdict is Verdict.DELIVERED
    (received,) = server.received
    assert (received.method, received.path) == ("POST", "/1/messages.json")
    form = received.form
    assert (form["token"], form["user"], form["priority"]) == (TOKEN, USER, priority)
    assert ("retry" in form) is ("expire" in form) is (priority == "2")
    assert received.headers["content-type"] == "application/x-www-form-urlencoded"


def test_an_emergency_has_a_receipt(server: ReceivingServer) -> None:
    server.usual = RINGS
    outcome = service(server, "pushover", retry_s=30, expire_s=10_800).send(message())
    assert outcome.receipt == "rLqVuqTRh62UzxtmqiaLzQmVcPgiCy"
    assert (server.received[0].form["retry"], server.received[0].form["expire"]) == ("30", "10800")


def test_titles_and_texts_are_cut_to_what_pushover_takes(server: ReceivingServer) -> None:
    server.usual = QUEUED
    service(server, "pushover").send(message(title="ä" * 500, text="ö" * 3000))
    assert (len(server.received[0].form["title"]), len(server.received[0].form["message"])) == (250, 1024)


@pytest.mark.parametrize(
    ("answer", "verdict", "reason"),
    [
        (Answer(200, b"<html>"), Verdict.UNSURE, "something else than its API says"),
        (Answer(200, b'{"status":0}'), Verdict.UNSURE, "something else than its API says"),
        (Answer(400, b'{"status":0,"errors":["user identifier is invalid"]}'), Verdict.REFUSED, "user identifier is invalid"),
        (Answer(429, b"{}", (("X-Limit-App-Remaining", "0"),)), Verdict.REFUSED, "messages of this month are used up"),
        (Answer(429, b"{}"), Verdict.NOT_TAKEN, "429"),
        (Answer(500, b"oops"), Verdict.NOT_TAKEN, "500"),
    ],
)
def test_what_pushover_answers(server: ReceivingServer, answer: Answer, verdict: Verdict, reason: str) -> None:
    server.answers.append(answer)
    outcome = service(server, "pushover").send(message())
    assert outcome.verdict is verdict
    assert reason in outcome.reason


@pytest.mark.parametrize(
    ("answer", "state"),
    [
        (b'{"status":1,"acknowledged":0,"expired":0}', ReceiptState("", False)),
        (b'{"status":1,"acknowledged":1,"acknowledged_by":"uKey1234","acknowledged_by_device":"ada-phone","expired":0}',
         ReceiptState("pushover ada-phone", False)),
        (b'{"status":1,"acknowledged":1,"acknowledged_by":"uKey1234","acknowledged_by_device":""}',
         ReceiptState("pushover user …1234", False)),
        (b'{"status":1,"acknowledged":0,"expired":1}', ReceiptState("", True)),
        (b"nonsense", None),
    ],
)  # fmt: skip
def test_a_receipt_is_asked_for(server: ReceivingServer, answer: bytes, state: ReceiptState | None) -> None:
    server.usual = Answer(200, answer)
    pushover = service(server, "pushover")
    assert isinstance(pushover, Pushover)
    assert pushover.ask("r123") == state
    (received,) = server.received
    assert (received.method, received.path, received.query) == ("GET", "/1/receipts/r123.json", {"token": TOKEN})


def test_a_receipt_that_pushover_does_not_know_is_over_and_one_it_cannot_find_now_is_not(server: ReceivingServer) -> None:
    pushover = service(server, "pushover")
    assert isinstance(pushover, Pushover)
    server.answers.extend([Answer(404), Answer(503), Answer(drop=True)])
    assert [pushover.ask("r1") for _ in range(3)] == [ReceiptState("", True), None, None]


def test_an_emergency_is_cancelled(server: ReceivingServer) -> None:
    pushover = service(server, "pushover")
    assert isinstance(pushover, Pushover)
    server.answers.extend([Answer(200, b'{"status":1}'), Answer(404), Answer(500)])
    assert [pushover.cancel("r1") for _ in range(3)] == [True, True, False]
    assert {(r.method, r.path, r.form["token"]) for r in server.received} == {("POST", "/1/receipts/r1/cancel.json", TOKEN)}


# Apprise.


def test_apprise_is_sent_to_whatever_its_address_names(server: ReceivingServer) -> None:
    pytest.importorskip("apprise")
    receiver = RECEIVER.validate_python({"type": "apprise", "url": "$URL"})
    apprise = service_of("x", receiver, {"URL": f"json://127.0.0.1:{server.port}/x"})
    assert apprise.send(message()).verdict is Verdict.DELIVERED
    assert server.received[0].json["type"] == "failure"
    server.usual = Answer(500)
    assert apprise.send(message()).verdict is Verdict.UNSURE


LINK = "https://twin.plant.example/#/replay/okuma?from=1&to=2&at=3"


def test_pushover_is_sent_the_link_in_the_field_that_it_has_for_it(server: ReceivingServer) -> None:
    server.usual = QUEUED
    service(server, "pushover").send(message("medium", link=LINK, link_title="See that moment"))
    service(server, "pushover").send(message("medium", link="https://twin.plant.example/" + "x" * 500))
    first, second = (one.form for one in server.received)
    assert (first["url"], first["url_title"]) == (LINK, "See that moment")
    assert "url" not in second, "Pushover refuses a message whose address is longer than 512 characters"


@pytest.mark.parametrize(
    ("address", "shown"),
    [
        ("slack://T1JJ3T3L2/A1BRTD4JD/TIiajkdnlazkcOXrIdevi7FQ/#general", "Part_7 (2)\\nSee that moment: https://twin.plant"),
        ("workflows://h/workflow1a/signature1/", f"Part\\\\_7 \\\\(2\\\\)\\n\\n[See that moment]({LINK})"),
        ("mailto://user:pass@example.com?to=x@example.com", "Part_7 (2)\nSee that moment: https://twin.plant"),
    ],
)
def test_what_slack_teams_and_mail_are_sent_by_apprise(address: str, shown: str) -> None:
    """As the libraries that it sends with are given it; the first line is what the service shows as a title."""
    pytest.importorskip("apprise")
    ours = service_of("x", RECEIVER.validate_python({"type": "apprise", "url": "$URL"}), {"URL": address})
    told = message("high", text="Part_7 (2)", link=LINK, link_title="See that moment")
    with (
        patch("requests.request") as request,
        patch("requests.post") as post,
        patch("smtplib.SMTP") as mail,
        patch("smtplib.SMTP_SSL") as mails,
    ):
        for calls in (request, post):
            calls.return_value.status_code, calls.return_value.content = 200, b"ok"
        ours.send(told)
    sent = [*(call.kwargs["data"] for one in (request, post) for call in one.call_args_list)]
    sent += [call.args[2] for one in (mail, mails) for call in one.return_value.sendmail.call_args_list]
    assert len(sent) == 1
    assert "okuma: Vibration too high for 10 s" in sent[0]
    assert shown in quopri.decodestring(sent[0]).decode() if address.startswith("mailto") else shown in sent[0]


def test_an_address_that_apprise_does_not_know_is_said_before_anything_starts() -> None:
    pytest.importorskip("apprise")
    receiver = RECEIVER.validate_python({"type": "apprise", "url": "$URL"})
    with pytest.raises(ConfigurationError, match=r"\[alerts.receivers.x\] Apprise does not know") as error:
        service_of("x", receiver, {"URL": "hunter2://hunter2"})
    assert "hunter2" not in str(error.value)


# Secrets.


def test_a_secret_comes_from_the_environment_or_a_file_of_its_owner(tmp_path: Path) -> None:
    file = tmp_path / "token"
    file.write_text("s3cret\n")
    file.chmod(0o600)
    assert read_secret("$A", {"A": "s3cret"}) == "s3cret"
    assert read_secret(f"file:{file}") == "s3cret"


@pytest.mark.parametrize("mode", [0o644, 0o640, 0o604, 0o660, 0o610])
def test_a_file_that_others_may_use_is_refused(tmp_path: Path, mode: int) -> None:
    file = tmp_path / "token"
    file.write_text("s3cret")
    file.chmod(mode)
    with pytest.raises(ConfigurationError, match=f"others than its owner may use .*mode {mode:o}.*; chmod 600"):
        read_secret(f"file:{file}")


def test_what_is_no_secret_is_said_and_never_repeated(tmp_path: Path) -> None:
    (tmp_path / "empty").touch(0o600)
    (tmp_path / "long").write_bytes(b"x" * 5000)
    (tmp_path / "binary").write_bytes(b"\xff\xfe")
    (tmp_path / "link").symlink_to(tmp_path / "empty")
    os.mkfifo(tmp_path / "pipe", 0o600)
    for name in ("long", "binary"):
        (tmp_path / name).chmod(0o600)
    for name, said in (
        ("missing", "No such file"),
        ("empty", "is empty"),
        ("long", "more than 4096 bytes"),
        ("binary", "not UTF-8"),
        ("link", "symbolic link"),
        ("pipe", "no plain file"),
    ):
        with pytest.raises(ConfigurationError, match=said):
            read_secret(f"file:{tmp_path / name}")
    with pytest.raises(ConfigurationError, match="the environment has no variable NOT_THERE"):
        read_secret("$NOT_THERE", {})


def test_a_secret_address_is_checked_too() -> None:
    receiver = RECEIVER.validate_python({"type": "webhook", "url": "$URL"})
    with pytest.raises(ConfigurationError, match="not encrypted") as error:
        service_of("x", receiver, {"URL": "http://hooks.example/T0/hunter2"})
    assert "hunter2" not in str(error.value)


def test_no_secret_is_in_any_reason_or_log(server: ReceivingServer, caplog: pytest.LogCaptureFixture) -> None:
    echo = json.dumps({"status": 0, "errors": [f"token {TOKEN} of {USER} is bad"]}).encode()
    answers = [Answer(400, echo), Answer(500, echo), Answer(drop=True), Answer(429, echo), Answer(wait_s=2.0)]
    with caplog.at_level(logging.DEBUG):
        for answer in answers:
            for kind in ("pushover", "webhook", "alertmanager"):
                server.answers.append(answer)
                made = service(server, kind, timeout_s=0.5)
                text = repr(made.send(message())) + repr(made)
                assert not [secret for secret in ENVIRONMENT.values() if secret in text]
        pushover = service(server, "pushover")
        assert isinstance(pushover, Pushover)
        pushover.ask("r1")
    assert not [secret for secret in ENVIRONMENT.values() if secret in caplog.text]
