"""The sum of the verdicts: precision, a threshold that is suggested and never set, and what is published."""

import json

from tests.twin.anomaly.parts.alarms.examples import alarmed, spoken, verdict
from twin.anomaly.parts.alarms.episodes import Memory
from twin.anomaly.parts.alarms.feedback import TEXT_CHARACTERS_MAX, precision, suggested, told_of


def told(cases: list[tuple[float, str]]) -> Memory:
    """A memory of alarms of a score, each with a verdict."""
    memory = Memory()
    for place, (score, word) in enumerate(cases):
        at_s = 1000.0 + 100.0 * place
        memory = alarmed(memory, at_s, score=score)
        if word:
            memory = spoken(memory, verdict(word, at_s, at_s + 50.0, label="x" * 60, by="y" * 100))
    return memory


def test_the_share_of_true_alarms_counts_known_ones_and_no_silence() -> None:
    assert precision(told([(3.0, "")])) is None
    found = precision(told([(3.0, "true"), (3.0, "known"), (3.0, "false"), (3.0, "")]))
    assert found is not None
    assert (found.true, found.verdicts) == (2, 3)
    assert 0.0 < found.low < 2.0 / 3.0 < found.high < 1.0


def test_a_threshold_is_suggested_from_ten_verdicts_on_where_it_would_have_done_better() -> None:
    cases = [(2.5, "false")] * 5 + [(8.0, "true")] * 4
    assert suggested(told(cases)) is None
    found = suggested(told([*cases, (10.0, "known")]))
    assert found is not None
    assert (found.threshold, found.dropped, found.false) == (7.6, 5, 5)


def test_no_threshold_is_suggested_that_would_lose_a_true_alarm() -> None:
    assert suggested(told([(9.0, "false")] * 9 + [(2.2, "true")])) is None
    assert suggested(told([(9.0, "false")] * 12)) is None


def test_the_published_text_says_who_said_what_and_is_bounded() -> None:
    memory = told([(3.0, word) for word in ("true", "false", "known", "")] * 30)
    text = told_of(memory, 5000.0)
    document = json.loads(text)
    assert len(text) <= TEXT_CHARACTERS_MAX
    assert document["alarms"][1]["said"] == {
        "verdict": "known",
        "label": "x" * 60,
        "by": "y" * 100,
        "at_s": memory.episodes[-2].began_s + 50.0,
    }
    assert [one["state"] for one in document["alarms"][:2]] == ["over", "held back"]
    assert document["limits"][0]["by"] == "y" * 100
    assert "of the last" in document["precision"]
