"""`cnctwin alerts` against a real broker, the real processor and a courier with a receiver on loopback."""

import json
import re
import signal
import sys
import time
from collections.abc import Iterator
from pathlib import Path

import pytest

from cnctwin.commands.see.alerts import alerts_app, duration_s
from cnctwin.errors import UsageError
from cnctwin.plant.doctor import examine
from processors.alerts.config import AlertsConfig
from processors.alerts.courier.thread import Courier
from processors.config import read_tables
from processors.running.runtime import configured, run
from sparkplug.broker import BrokerAddress
from sparkplug.datatype import DataType
from sparkplug.edge_node import EdgeNode
from sparkplug.metric import Change, MetricSpec, NodeId
from tests.cnctwin.program import Program, until
from tests.processors.alerts.courier.alert_shop import VIBRATION
from tests.processors.alerts.courier.receiving_server import Answer, ReceivingServer
from tests.until_stopped import until_stopped
from tests.wire.mosquitto import Mosquitto
from twin.vocabulary.twin_signals import RULE_FINDINGS

pytestmark = pytest.mark.broker
TABLE = """\
[alerts]
group_wait_s = 0.0
[alerts.signals]
"twin/rule_vibration" = {{ severity = "high", keep_firing_for_s = 0.0 }}
[alerts.receivers.desk]
type = "webhook"
url = "{url}/desk"
"""
FINDINGS = json.dumps({"vibration": {"value": 8.25, "limit": 7.1, "unit": "mm/s", "signal": "vibration_velocity_mm_s"}})


class Cnctwin:
    """The command, run in this process to its end."""

    def __init__(self, broker: BrokerAddress, patch: pytest.MonkeyPatch, captured: pytest.CaptureFixture[str]) -> None:
        self._broker, self._patch, self._captured = broker, patch, captured

    def __call__(self, *arguments: str) -> tuple[int, str, str]:
        """Exit code, stdout, stderr; an error of ours is exit code 2, as in cnctwin.cli."""
        self._captured.readouterr()
        self._patch.setenv("CNCTWIN_BROKER", self._broker.url)
        try:
            code = alerts_app(list(arguments), standalone_mode=False)
        except UsageError as error:
            print(f"cnctwin: {error}", file=sys.stderr)
            code = 2
        return int(code or 0), *self._captured.readouterr()


@pytest.fixture
def broker(mosquitto: Mosquitto) -> BrokerAddress:
    return BrokerAddress(*mosquitto.address)


@pytest.fixture
def cnctwin(broker: BrokerAddress, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]) -> Cnctwin:
    return Cnctwin(broker, monkeypatch, capfd)


@pytest.fixture
def server() -> Iterator[ReceivingServer]:
    with ReceivingServer() as server:
        yield server


@pytest.fixture
def edge(broker: BrokerAddress, server: ReceivingServer, tmp_path: Path) -> Iterator[EdgeNode]:
    """A machine, with the processor and the courier at work."""
    file = tmp_path / "alerts.toml"
    file.write_text(TABLE.format(url=server.url))
    edge = EdgeNode(broker, NodeId("cnc", "edge-okuma"), [MetricSpec("health/beat", DataType.INT64)])
    findings = MetricSpec(RULE_FINDINGS, DataType.STRING, value=FINDINGS)
    edge.declare_device("okuma", [MetricSpec(VIBRATION, DataType.BOOLEAN, value=False), findings])
    edge.start()
    courier = Courier(broker, AlertsConfig.model_validate(read_tables(file)["alerts"]))
    with until_stopped(run, configured(["alerts"], file), broker):
        courier.start()
        yield edge
    courier.stop()
    edge.stop()


def fire(edge: EdgeNode, value: bool = True) -> None:
    while not edge.publish("okuma", [Change(VIBRATION, value, time.time_ns() // 1_000_000)]):
        time.sleep(0.05)


def test_list_acknowledge_silence_and_test(cnctwin: Cnctwin, edge: EdgeNode, server: ReceivingServer) -> None:
    code, out, err = cnctwin("list")
    assert (code, err) == (0, "")
    assert "no alert fires" in out
    fire(edge)
    deadline_s = time.monotonic() + 60.0
    while cnctwin("list")[0] != 1:
        assert time.monotonic() < deadline_s
    code, out, _ = cnctwin("list")
    assert "rule_vibration" in out
    assert "okuma: Vibration 8.25 mm/s, limit 7.1 mm/s" in out
    assert "firing" in out
    (alert,) = json.loads(cnctwin("list", "--json")[1])["alerts"]
    code, out, err = cnctwin("ack", alert["fingerprint"][:6], "--by", "ada", "--comment", "on my way")
    assert (code, out, err) == (0, "rule_vibration on okuma is acknowledged\n", "")
    code, out, _ = cnctwin("list")
    assert code == 0  # somebody takes care of it
    assert "ada" in out
    code, out, _ = cnctwin("silence", "--machine", "okuma", "--for", "2h", "--by", "ada", "--comment", "[new] tool")
    assert code == 0
    silence = out.split()[1]
    assert f"silence {silence}: machine okuma, until " in cnctwin("list")[1]
    assert " UTC, by ada: [new] tool" in cnctwin("list")[1]
    assert f"there are: {silence}: machine okuma, until " in cnctwin("unsilence", "x", "--by", "ada")[2]
    assert cnctwin("unsilence", silence[:4], "--by", "ada") == (0, f"silence {silence} has ended\n", "")
    assert cnctwin("test", "desk") == (0, "desk: delivered\n", "")
    assert server.received[-1].json["groupKey"] == "test"
    assert [one["annotations"]["test"] for one in server.received[-1].json["alerts"]] == ["true"]
    server.answers.append(Answer(401))
    assert cnctwin("test", "desk") == (1, "", "desk: failed: 127.0.0.1 answered 401\n")
    fire(edge, False)
    deadline_s = time.monotonic() + 60.0
    while "okuma: Over after " not in cnctwin("list")[1]:
        assert time.monotonic() < deadline_s
    code, out, _ = cnctwin("list")
    assert code == 0
    assert "no alert fires" in out
    assert "s: vibration too high" in out


def test_wrong_input_is_one_line_and_exit_code_2(cnctwin: Cnctwin, edge: EdgeNode) -> None:
    for arguments, said in (
        (("ack", "0123", "--by", "ada"), "no alerts fire whose number begins with '0123'; there are: none"),
        (("silence", "--for", "2h", "--by", "ada"), "a silence needs --machine, --alert or --severity"),
        (("silence", "--machine", "m", "--for", "soon", "--by", "ada"), "'soon' is no duration"),
        (("silence", "--machine", "m", "--for", "2", "--by", "ada"), "--for '2' has no unit; write 2h for hours, 2m for minutes"),
        (("unsilence", "7", "--by", "ada"), "no silences have a number that begins with '7'; there are: none"),
        (("test", "nobody"), "there is no receiver 'nobody'; there are: desk"),
    ):
        code, out, err = cnctwin(*arguments)
        assert (code, out) == (2, "")
        assert said in err
        assert len(err.splitlines()) == 1


def test_without_the_processor_it_says_so(cnctwin: Cnctwin, broker: BrokerAddress) -> None:
    code, _, err = cnctwin("list", "--wait", "1")
    assert code == 2
    assert "does the processor run? (cnctwin process alerts)" in err


def test_a_receiver_that_is_down_is_named_and_tried_again(cnctwin: Cnctwin, edge: EdgeNode, server: ReceivingServer) -> None:
    server.__exit__()
    code, out, err = cnctwin("test", "desk")
    said = f"not taken yet (127.0.0.1:{server.port}: connection refused); it will be tried again"
    assert (code, out, err) == (1, "", f"desk: {said}\n")
    (desk,) = json.loads(cnctwin("list", "--json")[1])["receivers"].values()
    assert (desk["waiting"], desk["failed"], desk["last_error"]) == (1, 0, said)


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGKILL])
def test_a_processor_that_is_gone_is_no_quiet_plant(
    cnctwin: Cnctwin, broker: BrokerAddress, tmp_path: Path, number: signal.Signals
) -> None:
    options = ("--broker", broker.url, "--state-dir", str(tmp_path / "state"))
    with Program(tmp_path, "process", "rules", "alerts", *options) as program:
        until(lambda: cnctwin("list", "--wait", "1")[0] == 0, "the processor")
        program.process.send_signal(number)
        program.process.wait()
    code, out, err = cnctwin("list", "--wait", "1")
    assert (code, out) == (2, "")
    assert re.fullmatch(
        r"cnctwin: nothing heard from the processor alerts since 20[\d :-]+ UTC; is `cnctwin process alerts` running\?\n", err
    )
    bad = [finding.text for finding in examine(broker, "cnc", 1.5).findings if not finding.good]
    assert [text.partition(" since 20")[0] for text in bad] == [
        "no edge node was heard of; start one with `cnctwin edge run CONFIG`",
        "nothing heard from the processor alerts",
    ]
    assert bad[1].endswith("clear what it left on the broker: spBv1.0/STATE/twin-alerts, cnctwin/alerts/state")


def test_without_a_broker_it_says_so(mosquitto: Mosquitto, cnctwin: Cnctwin) -> None:
    mosquitto.kill()
    code, _, err = cnctwin("list", "--wait", "1")
    assert code == 2
    assert "no connection to mqtt://127.0.0.1" in err


@pytest.mark.parametrize("text", ["", "0", "-1h", "1w", "1e3", "31d", "h"])
def test_what_is_no_duration(text: str) -> None:
    with pytest.raises(UsageError):
        duration_s(text)
