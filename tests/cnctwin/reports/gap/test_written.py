"""Figures, names and markup as they are written."""

import math

import pytest

from cnctwin.reports.gap.markup import escaped, tag
from cnctwin.reports.gap.signal_name import effect_words
from cnctwin.reports.gap.written import figure, interval, known, p_value, share, stated, times
from twin.effects.catalogue import catalogue
from twin.gap.diagnosis import Interval


@pytest.mark.parametrize(
    ("value", "text"),
    [
        (0.0, "0"),
        (-0.0, "0"),
        (12.0, "12"),
        (1234.5, "1230"),
        (0.00012345, "0.000123"),
        (-2.5e-9, "−2.5 · 10⁻⁹"),
        (1e9, "1 · 10⁹"),
        (math.nan, "–"),
        (None, "–"),
        (math.inf, "∞"),
        (-math.inf, "−∞"),
    ],
)
def test_a_figure_has_the_digits_that_say_something(value: float | None, text: str) -> None:
    assert figure(value) == text


@pytest.mark.parametrize(
    ("value", "text"),
    [
        (0.0, "0 %"),
        (1.0, "100 %"),
        (0.9999, "> 99.9 %"),
        (0.996, "99.6 %"),
        (0.984, "98 %"),
        (0.0001, "< 0.1 %"),
        (0.004, "0.4 %"),
        (0.57, "57 %"),
        (None, "–"),
        (math.nan, "–"),
        (-0.2, "−20 %"),
    ],
)
def test_a_share_claims_neither_none_nor_all(value: float | None, text: str) -> None:
    assert share(value) == text


def test_a_gap_over_the_floor_has_three_digits() -> None:
    assert [times(v) for v in (0.987, 1.0, 9.999, 12.34, 99.97, 1234.5)] == ["0.99", "1.00", "10.0", "12.3", "100", "1234"]
    assert times(math.nan) == "–"


def test_a_p_value_is_not_more_exact_than_anybody_asks() -> None:
    assert [p_value(v) for v in (0.0, 1e-300, 2.2e-5, 0.0034, 0.4, 1.0)] == ["< 10⁻⁶", "< 10⁻⁶", "2 · 10⁻⁵", "0.0034", "0.4", "1"]


@pytest.mark.parametrize(
    ("given", "value", "between"),
    [
        (Interval(0.00861, 0.00834, 0.00889, "mm"), "0.00861 mm", "0.00834 … 0.00889"),
        (Interval(2690.0, 1810.0, 3950.0, "N/mm"), "2700 N/mm", "1800 … 4000"),
        (Interval(-0.128, -0.141, -0.116), "−0.128", "−0.141 … −0.116"),
        (Interval(3.0, math.nan, math.nan, "s"), "3 s", "–"),
        (Interval(math.nan, 1.0, 2.0), "–", "1 … 2"),
        (Interval(5.0, 5.0, 5.0), "5", "5 … 5"),
    ],
)
def test_a_parameter_has_the_digits_that_its_interval_is_worth(given: Interval, value: str, between: str) -> None:
    assert interval(given) == (value, between)


def test_a_sentence_begins_large_and_ends() -> None:
    assert [stated(s) for s in ("the gap", "The gap.", "", "really?")] == ["The gap.", "The gap.", "", "Really?"]


def test_numbers_are_known_or_not() -> None:
    assert known(0.0) and not known(None) and not known(math.nan) and not known(math.inf)


@pytest.mark.parametrize("name", list(catalogue()))
def test_every_effect_of_the_catalogue_has_words(name: str) -> None:
    words, effect = effect_words(name)
    assert effect is not None and len(words) > 20 and "\n" not in words


def test_text_is_escaped_once_and_attributes_as_well() -> None:
    inner = tag("b", "<i>&\"'")
    assert inner == "<b>&lt;i&gt;&amp;&quot;&#x27;</b>"
    assert tag("p", inner, title='"><script>', hidden=False, open=True) == f'<p title="&quot;&gt;&lt;script&gt;" open>{inner}</p>'


def test_characters_that_no_page_may_have_are_replaced() -> None:
    assert escaped("a\x00\x1b\ud800\ufffe\x85b\tµ😀") == "a" + 5 * "\ufffd" + "b\tµ😀"
