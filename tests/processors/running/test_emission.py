"""Plain messages go as they are once their topic is known, and never on a topic that is not declared."""

import pytest

from processors.contract import Output, PlainOutput, PlainSpec
from processors.errors import OutputError
from processors.running import emission
from processors.running.emission import PlainTopics

DECLARED = (PlainSpec("cnc/", "values"), PlainSpec("alerts/", "messages", qos=1))


def test_a_topic_is_known_once_a_message_was_found_to_be_declared() -> None:
    plain, message = PlainTopics("test", DECLARED), PlainOutput("cnc/a", b"1")
    assert plain.ready([message]) is None
    assert plain.message(message) is message
    assert plain.ready([message, message]) == [message, message]
    assert plain.ready([message, Output("twin/x", 1.0)]) is None
    assert plain.ready([message, PlainOutput("cnc/b", b"1")]) is None


def test_the_declaration_fills_in_the_qos_of_each_message() -> None:
    plain, message = PlainTopics("test", DECLARED), PlainOutput("alerts/a", b"1")
    for _ in range(2):
        assert plain.ready([message]) is None, "it is not to be sent as it is"
        assert plain.message(message) == ("alerts/a", b"1", 1, True)
    assert plain.ready([message._replace(qos=1)]) == [("alerts/a", b"1", 1, True)]


def test_a_topic_that_is_not_declared_is_never_known() -> None:
    plain, message = PlainTopics("test", DECLARED), PlainOutput("elsewhere/a", b"1")
    for _ in range(2):
        assert plain.ready([message]) is None
        with pytest.raises(OutputError, match="does not declare"):
            plain.message(message)


def test_no_more_topics_are_remembered_than_there_is_room_for(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(emission, "PLAIN_TOPICS_MAX", 3)
    plain = PlainTopics("test", DECLARED)
    for number in range(10):
        plain.message(PlainOutput(f"cnc/{number}", b""))
    assert len(plain._known) <= 3
