"""The courier beside a runner: it comes and goes with the partition of the alerts, one after the other, and leaves no thread."""

import threading
import time
from collections.abc import Callable
from pathlib import Path
from threading import Event

import pytest

pytest.importorskip("confluent_kafka", reason="no confluent-kafka in this Python; install the extra kafka")

from cnctwin.kafka import courier as module
from cnctwin.kafka import running
from cnctwin.kafka.courier import MovingCourier
from cnctwin.kafka.settings import KafkaSettings
from processors.errors import ConfigurationError
from processors.running.runtime import configured
from sparkplug.broker import BrokerAddress
from tests.cnctwin.kafka.test_running import CLAIMED, Runners, without_kafka

HOME = ("cnctwin.cnc.cells.alerts", 3)
ELSEWHERE = [("cnctwin.cnc.cells.alerts", 2), ("cnctwin.cnc.readings", 3)]
WAIT_S_MAX = 30.0


class Couriers:
    """Couriers that note when they come and go. `slow`: one that is to stop waits until this is set."""

    def __init__(self) -> None:
        self.slow = Event()
        self.slow.set()
        self.said: list[str] = []
        self.made = self.at_work = self.most = 0
        self.refusals = 0

    def __call__(self) -> "Couriers":
        if self.refusals > 0 and self.made > 0:
            self.refusals -= 1
            raise ConfigurationError("[alerts.receivers.desk] the file of the secret is gone")
        self.made += 1
        return self

    def start(self) -> None:
        self.at_work += 1
        self.most = max(self.most, self.at_work)
        self.said.append("start")

    def stop(self) -> None:
        assert self.slow.wait(WAIT_S_MAX)
        self.at_work -= 1
        self.said.append("stop")


def until(condition: Callable[[], bool]) -> None:
    end_s = time.monotonic() + WAIT_S_MAX
    while not condition():
        assert time.monotonic() < end_s, "it does not come"
        time.sleep(0.005)


def test_it_is_at_work_while_its_runner_has_the_partition_of_the_alerts() -> None:
    couriers = Couriers()
    before = set(threading.enumerate())
    with MovingCourier(couriers, HOME) as moving:
        assert couriers.made == 1, "secrets are read at the start"
        moving.hold(ELSEWHERE)
        moving.hold([*ELSEWHERE, HOME])
        until(lambda: couriers.said == ["start"])
        moving.hold([HOME])
        moving.hold(ELSEWHERE)
        assert couriers.said == ["start", "stop"], "the partition goes after the courier"
        moving.hold([HOME])
        until(lambda: couriers.said == ["start", "stop", "start"])
    assert couriers.said == ["start", "stop", "start", "stop"]
    assert couriers.made == 2
    assert set(threading.enumerate()) <= before, "it leaves no thread"


def test_one_that_is_slow_to_end_holds_up_no_rebalance_and_ends_before_the_next_begins(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(module, "LEAVE_S_MAX", 0.05)
    couriers = Couriers()
    couriers.slow.clear()
    with MovingCourier(couriers, HOME) as moving:
        moving.hold([HOME])
        until(lambda: couriers.said == ["start"])
        moving.hold([])
        assert couriers.said == ["start"] and moving.is_at_work
        moving.hold([HOME])
        couriers.slow.set()
        until(lambda: couriers.said == ["start", "stop", "start"])
    assert couriers.most == 1


def test_a_partition_that_comes_and_goes_at_once_leaves_no_courier() -> None:
    couriers = Couriers()
    with MovingCourier(couriers, HOME) as moving:
        for _ in range(200):
            moving.hold([HOME])
            moving.hold([])
            assert couriers.at_work == 0
    assert couriers.said == ["start", "stop"] * (len(couriers.said) // 2)


def test_a_secret_that_has_gone_is_looked_for_again(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(module, "AGAIN_S", 0.01)
    couriers = Couriers()
    with MovingCourier(couriers, HOME) as moving:
        moving.hold([HOME])
        until(lambda: couriers.said == ["start"])
        moving.hold([])
        couriers.refusals = 3
        moving.hold([HOME])
        until(lambda: couriers.said == ["start", "stop", "start"])
    assert couriers.refusals == 0


# At the start of a runner.

DESK = """[alerts.receivers.desk]
type = "webhook"
url = "http://127.0.0.1:1/desk"
"""


def start(monkeypatch: pytest.MonkeyPatch, folder: Path, toml: str, broker: BrokerAddress | None) -> Runners:
    (folder / "processors.toml").write_text(toml)
    runners = Runners()
    without_kafka(monkeypatch, runners)
    pairs = configured(["alerts"], folder / "processors.toml")
    settings = KafkaSettings(bootstrap="127.0.0.1:1")
    running.run_over_kafka(settings, pairs, Event(), group="cnc", member="r0", claimed=CLAIMED, broker=broker)
    return runners


def test_without_a_broker_a_runner_with_receivers_does_not_start(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    with pytest.raises(ConfigurationError, match="give --broker"):
        start(monkeypatch, tmp_path, DESK, None)
    assert start(monkeypatch, tmp_path, "", None).started == 1, "nobody is to be told"


def test_a_secret_that_is_missing_is_told_at_the_start(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.delenv("DESK_TOKEN", raising=False)
    with pytest.raises(ConfigurationError, match="DESK_TOKEN"):
        start(monkeypatch, tmp_path, DESK + 'bearer = "$DESK_TOKEN"\n', BrokerAddress(port=1))


def test_a_runner_that_has_no_alerts_yet_connects_to_no_broker(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    before = set(threading.enumerate())
    assert start(monkeypatch, tmp_path, DESK, BrokerAddress(port=1)).started == 1
    assert set(threading.enumerate()) <= before, "it leaves no thread"
