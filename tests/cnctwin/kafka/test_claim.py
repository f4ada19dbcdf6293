"""The name of a runner is one that the group's members can be told by."""

from threading import Event

import pytest

pytest.importorskip("confluent_kafka", reason="no confluent-kafka in this Python; install the extra kafka")

from cnctwin.kafka import claim as module
from cnctwin.kafka.claim import claim
from cnctwin.kafka.settings import KafkaSettings
from processors.errors import ConfigurationError

SETTINGS = KafkaSettings(bootstrap="127.0.0.1:1")


def test_a_member_with_a_dot_is_refused_before_the_cluster_is_asked(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(module, "Transactions", lambda *_: pytest.fail("the cluster was asked"))
    with pytest.raises(ConfigurationError, match=r"'r\.0' has a dot"):
        claim(SETTINGS, "cnc", ["thermal"], "r.0", Event())


def test_a_name_does_not_depend_on_the_order_of_the_processors(monkeypatch: pytest.MonkeyPatch) -> None:
    claimed: list[str] = []
    monkeypatch.setattr(module, "Transactions", lambda _, name, __: claimed.append(name))
    for names in (["thermal", "gap"], ["gap", "thermal", "gap"]):
        claim(SETTINGS, "cnc", names, "r0", Event())
    assert claimed == ["cnctwin.cnc.gap+thermal.r0"] * 2
