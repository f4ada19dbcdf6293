"""The reason of an alarm in one line: what it says of each kind of signal, and that no text breaks it."""

import json

import pytest
from hypothesis import given
from hypothesis import strategies as st

from twin.anomaly.parts.alarms.why import Like, Why
from twin.anomaly.parts.alarms.words import LINE_MAX, in_words

WHY = Why("spindle_load_pct", "cut", "O1", 5, (210, 260), 7, 43.66, 37.0, "%", 5.2, 42.0, "12 parts", (Like("dull", 0.9, 1.0),))
CASES = {
    "a ratio": (WHY, "spindle_load_pct 18 % above the last 12 parts in lines 210–260; looks like dull (0.90); no peer shows it"),
    "a difference": (
        WHY._replace(measured=25.0, expected=37.0, unit="K", by="the twin only", lines=(7, 7), like=(), peers=("vmc2",)),
        "spindle_load_pct 12 K below what the twin expects in line 7; a peer shows it too",
    ),
    "a factor": (
        WHY._replace(measured=370.0, by="1 part", lines=None, like=(), peers=("a", "b")),
        "spindle_load_pct 10 times the part before; 2 peers show it too",
    ),
    "nothing to compare": (
        WHY._replace(expected=0.0, unit=None, by="", lines=None, like=()),
        "spindle_load_pct 43.7 above what is usual; no peer shows it",
    ),
}


@pytest.mark.parametrize("case", CASES.values(), ids=CASES.keys())
def test_a_reason_reads_as_a_sentence(case: tuple[Why, str]) -> None:
    why, sentence = case
    assert in_words(why.in_json()) == sentence


JSON = st.recursive(
    st.none() | st.booleans() | st.floats(allow_nan=False) | st.text(max_size=5),
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.sampled_from(WHY._fields), inner, max_size=4),
    max_leaves=8,
)


@given(more=st.dictionaries(st.sampled_from(WHY._fields), JSON))
def test_no_reason_of_another_shape_breaks_the_line(more: dict[str, object]) -> None:
    line = in_words(json.dumps({**WHY._asdict(), **more}))
    assert len(line) <= LINE_MAX
    assert line.isprintable()


@given(text=st.text(max_size=50))
def test_a_text_that_is_no_reason_says_nothing(text: str) -> None:
    assert in_words(text) == ""
