"""Sets of runners that share a processor are told apart from those that do not."""

import pytest

pytest.importorskip("confluent_kafka", reason="no confluent-kafka in this Python; install the extra kafka")

from cnctwin.kafka.groups import _overlapping
from cnctwin.kafka.topics import Topics

TOPICS = Topics("cnc")


@pytest.mark.parametrize(
    ("groups", "wanted"),
    [
        ([], None),
        (["cnctwin.cnc.gap+thermal"], None),
        (["cnctwin.cnc.bridge.b0", "cnctwin.cnc.events", "cnctwin.cnc.bridge.read"], None),
        (["cnctwin.cnc.thermal"], ("cnctwin.cnc.thermal", ["thermal"])),
        (["cnctwin.cnc.events", "cnctwin.cnc.gap+mirror+thermal"], ("cnctwin.cnc.gap+mirror+thermal", ["gap", "thermal"])),
    ],
)
def test_a_set_that_shares_a_processor_is_found(groups: list[str], wanted: tuple[str, list[str]] | None) -> None:
    assert _overlapping(groups, TOPICS, ["thermal", "gap"]) == wanted
