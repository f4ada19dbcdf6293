"""SHDR lines of an adapter that means ill or is broken: a line, a command or a counted reason, and that soon."""

from random import Random

import pytest
from hypothesis import given
from hypothesis import strategies as st

from cnctwin.standins.mtconnect_agent.shdr import (
    LINE_CHARS_MAX,
    MULTILINE_MARK,
    Command,
    Line,
    Unusable,
    entries,
    parse_line,
    parse_lines,
)
from tests.fuzz_depth import FUZZ, within

STAMP = "2022-08-08T13:51:34.7167146Z"
WORDS = st.sampled_from(
    ["|", "\\|", '"', "\\", STAMP, "* PING", "@ASSET@", MULTILINE_MARK, "FAULT", "\0", "\r", "x", "", "é", "\ud800"]
)
LINES = st.lists(WORDS, max_size=20).map("".join)


@FUZZ
@given(st.one_of(LINES, st.text(max_size=100)))
def test_any_line_is_taken_apart_or_counted(text: str) -> None:
    parsed = parse_line(text)
    assert isinstance(parsed, Line | Command | Unusable)
    if isinstance(parsed, Line):
        listed = list(entries(parsed.fields, lambda key: len(key) % 4))
        assert sum(1 + len(entry.values) for entry in listed) == len(parsed.fields), "each field belongs to one entry"


@FUZZ
@given(
    st.lists(
        st.one_of(LINES, st.just(f"{STAMP}|@ASSET@|1|CuttingTool|{MULTILINE_MARK}A"), st.just(f"{MULTILINE_MARK}A")), max_size=12
    )
)
def test_any_lines_are_taken_apart_or_counted(texts: list[str]) -> None:
    assert len(list(parse_lines(texts))) <= len(texts)


@pytest.mark.parametrize(
    "text",
    [
        STAMP + "|k" * (LINE_CHARS_MAX // 2 - 20),
        STAMP + "|" * (LINE_CHARS_MAX - 40),
        STAMP + "|" + "\\|" * (LINE_CHARS_MAX // 2 - 20),
        STAMP + '|k|"' + "\\|" * (LINE_CHARS_MAX // 2 - 40) + '"',
        "9" * LINE_CHARS_MAX,
        "|" * LINE_CHARS_MAX,
    ],
    ids=["keys", "bars", "escaped bars", "quoted bars", "digits", "bars only"],
)
def test_the_longest_line_takes_no_longer_than_its_length(text: str) -> None:
    assert len(text) <= LINE_CHARS_MAX
    with within(8.0):
        parsed = parse_line(text)
        if isinstance(parsed, Line):
            for _ in entries(parsed.fields, lambda _: 0):
                pass


def test_an_asset_of_nothing_but_empty_lines_ends_somewhere() -> None:
    def endless() -> list[str]:
        return [f"{STAMP}|@ASSET@|1|CuttingTool|{MULTILINE_MARK}A", *[""] * (2 * LINE_CHARS_MAX)]

    lines = endless()
    with within(8.0):
        first = next(parse_lines(iter(lines)))
    assert isinstance(first, Unusable) and first.reason == "line_too_long"


def test_a_line_that_is_too_long_keeps_only_its_beginning() -> None:
    parsed = parse_line("x" * (LINE_CHARS_MAX + 1))
    assert isinstance(parsed, Unusable) and len(parsed.text) == 80


@FUZZ
@given(st.integers(0, 2**32))
def test_a_damaged_line_never_gives_a_value_to_a_key_that_it_does_not_name(seed: int) -> None:
    chance, text = Random(seed), f"{STAMP}|Xpos|12.5|mode|AUTOMATIC|alarm|FAULT|7|1|HIGH|overtravel"
    cut = text[: chance.randrange(len(text))]
    parsed = parse_line(cut)
    if isinstance(parsed, Line):
        whole = text.split("|")[1:]
        for entry in entries(parsed.fields, lambda key: 5 if key == "alarm" else 1):
            assert any(one.startswith(entry.key) for one in whole)
