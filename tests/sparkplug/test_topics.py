"""Topics: every one that is built is parsed back; every other one is refused."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from sparkplug.errors import TopicError
from sparkplug.topics import NAMESPACE, NodeId, Topic, Verb, check_id, state_topic

IDS = st.text(st.characters(exclude_categories=("Cs",), exclude_characters="+/#\0"), min_size=1, max_size=10)


@given(st.sampled_from(list(Verb)), IDS, IDS, IDS)
def test_every_topic_survives_the_round_trip(verb: Verb, group: str, node: str, device: str) -> None:
    topic = Topic(verb, NodeId(group, node), device if verb.of_device else None)
    assert Topic.parse(str(topic)) == topic


@given(st.text(max_size=40) | st.lists(st.sampled_from([NAMESPACE, "NBIRTH", "DDATA", "g", "", "+"]), max_size=6).map("/".join))
def test_any_text_is_a_topic_or_a_topic_error(text: str) -> None:
    try:
        topic = Topic.parse(text)
    except TopicError:
        return
    assert str(topic) == text


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("", "does not begin with spBv1.0/"),
        ("spAv1.0/g/NBIRTH/n", "does not begin with spBv1.0/"),
        ("spBv1.0/g/NBIRTH", "3 levels"),
        ("spBv1.0/g/DDATA/n/d/x", "6 levels"),
        ("spBv1.0/g/NFOO/n", "'NFOO' is no message type"),
        ("spBv1.0/g/nbirth/n", "'nbirth' is no message type"),
        ("spBv1.0/g/NBIRTH/n/d", "NBIRTH has no device id"),
        ("spBv1.0/g/DBIRTH/n", "DBIRTH needs device id"),
        ("spBv1.0//NBIRTH/n", "group id is empty"),
        ("spBv1.0/g/DBIRTH/n/", "device id is empty"),
        ("spBv1.0/+/NBIRTH/n", "group id '\\+' holds '\\+'"),
        ("spBv1.0/g/NBIRTH/#", "edge node id '#' holds '#'"),
        ("spBv1.0/STATE/scada", "3 levels"),
    ],
)
def test_what_is_no_topic_says_why(text: str, says: str) -> None:
    with pytest.raises(TopicError, match=says):
        Topic.parse(text)


@pytest.mark.parametrize("verb", list(Verb))
def test_only_deaths_of_nodes_and_commands_carry_no_number(verb: Verb) -> None:
    assert verb.counted == (verb.value in {"NBIRTH", "NDATA", "DBIRTH", "DDEATH", "DDATA"})
    assert verb.of_device == (verb.value[0] == "D")


def test_an_id_with_a_zero_byte_is_refused() -> None:
    with pytest.raises(TopicError, match="zero byte"):
        check_id("a\0b", "device id")


def test_the_state_topic_is_that_of_version_3() -> None:
    assert state_topic("plant 1") == "spBv1.0/STATE/plant 1"
    with pytest.raises(TopicError, match="host id"):
        state_topic("a/b")
