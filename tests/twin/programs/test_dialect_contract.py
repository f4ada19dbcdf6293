"""What every language of part programs keeps to. Each is tried by its declaration and by three texts beside its own tests:

* `tests/twin/programs/<name>/plate.<suffix>`: the part of `plate.py`, whose docstring says what has to be in it
* `…/sample.<suffix>`: a program as a shop has it, with what is the language's own
* `…/endless.<suffix>`: a program that never ends
"""

import re
from collections.abc import Iterator
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.twin.programs.plate import SAME_MM, SETTINGS, SPEEDS_RPM, TRUTH, cuts, figures
from twin.errors import PartProgramError
from twin.programs import Arc, Linear, Spindle, interpret
from twin.programs.dialect import Dialect
from twin.programs.discovery import dialect_of, dialects
from twin.programs.source import WordPlace, joined, source_lines
from twin.vocabulary.program_names import ENDINGS

HERE = Path(__file__).parent
ROOT = HERE.parents[2]
DIALECTS = list(dialects().values())
every_dialect = pytest.mark.parametrize("dialect", DIALECTS, ids=lambda one: one.name)
GARBAGE = "§17 ?nonsense?"


def text_of(dialect: Dialect, kind: str) -> str:
    (found,) = (HERE / dialect.name).glob(f"{kind}.*")
    assert found.suffix in dialect.suffixes
    return found.read_text(encoding="utf-8")


def with_all(dialect: Dialect, text: str, which: str, figures_by_line: dict[int, str]) -> str:
    """The text with these feeds or speeds; nothing of a line but its figure may have changed."""
    changed, words = {}, dialect.words
    for number, figure in figures_by_line.items():
        line = source_lines(text)[number]
        place = words.feed_place(line) if which == "feed" else words.speed_place(line)
        changed[number] = words.with_feed(line, figure) if which == "feed" else words.with_speed(line, figure)
        if place is not None:
            assert changed[number] == line[: place.figure] + figure + line[place.end :]
        else:
            assert changed[number].replace(figure, "", 1) != line or changed[number] == line
    return joined(text, changed)


def places(dialect: Dialect, text: str, which: str) -> Iterator[tuple[int, WordPlace]]:
    for number, line in enumerate(source_lines(text)):
        place = dialect.words.feed_place(line) if which == "feed" else dialect.words.speed_place(line)
        if place is not None and (which == "feed" or dialect.words.commands_speed(line)):
            yield number, place


@every_dialect
def test_its_declaration_is_whole(dialect: Dialect) -> None:
    assert re.fullmatch(r"[a-z]+", dialect.name)
    assert dialect.title and dialect.control
    assert dialect.suffixes and set(dialect.suffixes) <= set(ENDINGS)
    assert {0, 2, 3, 4, 5, 30} <= dialect.m_codes


@every_dialect
@pytest.mark.parametrize("kind", ["sample", "plate", "endless"])
def test_its_texts_are_taken_for_its_own_and_for_no_others(dialect: Dialect, kind: str) -> None:
    text = text_of(dialect, kind)
    assert dialect_of(text) is dialect
    own = dialect.recognises(text)
    assert 0.0 < own <= 1.0
    assert all(other.recognises(text) < own for other in DIALECTS if other is not dialect)


@every_dialect
def test_its_sample_is_read(dialect: Dialect) -> None:
    moves = interpret(text_of(dialect, "sample"))
    assert sum(isinstance(move, Linear | Arc) for move in moves) >= 5


@every_dialect
def test_the_plate_is_the_same_part_in_every_language(dialect: Dialect) -> None:
    made = cuts(interpret(text_of(dialect, "plate"), SETTINGS))
    assert len(made) == len(TRUTH)
    for cut, true in zip(made, TRUTH, strict=True):
        assert figures(cut) == pytest.approx(figures(true), abs=SAME_MM, rel=0.0)


@every_dialect
@pytest.mark.parametrize("ending", ["\r\n", "\r"])
def test_lines_may_end_in_any_way(dialect: Dialect, ending: str) -> None:
    text = text_of(dialect, "plate")
    assert interpret(text.replace("\n", ending), SETTINGS) == interpret(text, SETTINGS)


@every_dialect
def test_a_line_that_cannot_be_read_is_refused_with_line_and_word(dialect: Dialect) -> None:
    text = text_of(dialect, "plate")
    lines = source_lines(text)
    first_cut = next(move.line for move in interpret(text, SETTINGS) if isinstance(move, Linear))
    with pytest.raises(PartProgramError) as caught:
        dialect.interpret("\n".join([*lines[:first_cut], GARBAGE, *lines[first_cut:]]), SETTINGS)
    assert caught.value.line == first_cut + 1
    assert caught.value.word and caught.value.word in GARBAGE
    assert caught.value.reason


@every_dialect
def test_a_program_without_an_end_is_an_error(dialect: Dialect) -> None:
    with pytest.raises(PartProgramError, match=r"^(line \d+|block \d+ \(line \d+\)): "):
        dialect.interpret(text_of(dialect, "endless"), SETTINGS)


@every_dialect
@settings(max_examples=25, deadline=None)
@given(data=st.data())
def test_no_text_crashes_it(dialect: Dialect, data: st.DataObject) -> None:
    """Cut off anywhere, or with anything written over a part of it, a text is run or refused."""
    text = text_of(dialect, data.draw(st.sampled_from(["sample", "plate"])))
    start = data.draw(st.integers(0, len(text)))
    length = data.draw(st.integers(0, 12))
    over = data.draw(st.text('0123456789.+-*/=()[]{};:,#%"<>QRXYZFSGMLCNO \n~\x00é', max_size=8))
    damaged = text[:start] + over + data.draw(st.sampled_from(["", text[start + length :]]))
    try:
        moves = dialect.interpret(damaged, SETTINGS)
    except PartProgramError as refused:
        lines = [len(source_lines(damaged)), *(len(source_lines(one)) for one in SETTINGS.programs.values())]
        assert 1 <= refused.line <= max(lines)
    else:
        assert isinstance(moves, list)
    words, lines_of_text = dialect.words, source_lines(damaged)
    assert len(words.branches(lines_of_text)) == len(words.inch_lines(lines_of_text, False)) == len(lines_of_text)
    for line in lines_of_text:
        for place in (words.feed_place(line), words.speed_place(line)):
            assert place is None or 0 <= place.begin <= place.figure <= place.end <= len(line)
        assert isinstance(words.takes_feed(line), bool)
        assert isinstance(words.probes(line), bool)
        assert isinstance(words.commands_speed(line), bool)
        assert isinstance(words.starts_spindle(line), bool)
        assert words.block_number(line) is None or isinstance(words.block_number(line), int)


@every_dialect
def test_feeds_written_into_a_program_are_the_feeds_that_are_read(dialect: Dialect) -> None:
    text = text_of(dialect, "plate")
    wanted = {number: 301.0 + k for k, (number, place) in enumerate(places(dialect, text, "feed")) if place.plain}
    assert len(wanted) >= 3
    written = {number: dialect.words.feed_figure(feed, False) for number, feed in wanted.items()}
    moves = interpret(with_all(dialect, text, "feed", written), SETTINGS)
    read = {(move.line, move.feed_mm_min) for move in moves if isinstance(move, Linear | Arc) and move.line in wanted}
    assert read <= set(wanted.items())
    assert len(read) >= 3


@every_dialect
def test_a_feed_is_added_to_a_line_that_has_none(dialect: Dialect) -> None:
    """Or it stays as it is, where the language has none there."""
    text, words, tried = text_of(dialect, "plate"), dialect.words, 0
    before = interpret(text, SETTINGS)
    cutting = {move.line for move in before if isinstance(move, Linear | Arc)}
    for number in sorted(cutting):
        line = source_lines(text)[number]
        if words.feed_place(line) is not None or words.with_feed(line, "333") == line:
            continue
        after = interpret(joined(text, {number: words.with_feed(line, "333")}), SETTINGS)
        pairs = zip(before, after, strict=True)
        feeds = {new.feed_mm_min for old, new in pairs if old.line == number and isinstance(new, Linear | Arc)}
        assert feeds == {333.0} or not words.takes_feed(line)
        tried += 1
    assert tried >= 3


@every_dialect
def test_a_line_that_takes_a_feed_is_one_that_moves(dialect: Dialect) -> None:
    """Every line of the plate is run; one that would take a feed and did not move would be told as a branch that was not."""
    text = text_of(dialect, "plate")
    moved = {move.line for move in interpret(text, SETTINGS)}
    taking = {number for number, line in enumerate(source_lines(text)) if dialect.words.takes_feed(line)}
    assert taking <= moved
    assert len(taking) >= 10


@every_dialect
def test_speeds_written_into_a_program_are_the_speeds_that_are_read(dialect: Dialect) -> None:
    text = text_of(dialect, "plate")
    wanted = {number: 4001.0 + k for k, (number, place) in enumerate(places(dialect, text, "speed")) if place.plain}
    assert len(wanted) == len(SPEEDS_RPM)
    moves = interpret(with_all(dialect, text, "speed", {n: f"{rpm:.9g}" for n, rpm in wanted.items()}), SETTINGS)
    turning = [move.rpm for move in moves if isinstance(move, Spindle) and move.direction]
    assert list(dict.fromkeys(turning)) == [wanted[number] for number in sorted(wanted)]


@every_dialect
def test_comments_hold_no_words(dialect: Dialect) -> None:
    """Each text has a comment with F and S in it; a place that lay in one would change it and not the feed."""
    text = text_of(dialect, "plate")
    count = sum(1 for line in source_lines(text) if re.search(r"\bF1 AND S1\b", line))
    assert count == 1
    for which in ("feed", "speed"):
        figures_by_line = {number: "77" for number, _ in places(dialect, text, which)}
        assert "F1 AND S1" in with_all(dialect, text, which, figures_by_line)


@every_dialect
@settings(max_examples=50)
@given(feed=st.floats(1.0, 40_000.0), inch=st.booleans())
def test_a_feed_is_written_no_higher_than_it_is_meant(dialect: Dialect, feed: float, inch: bool) -> None:
    read = dialect.words.figure_mm_min(dialect.words.feed_figure(feed, inch), inch)
    assert feed * (1.0 - 2e-3) <= read <= feed * (1.0 + 1e-9)
    assert dialect.words.figure_mm_min(dialect.words.exact_feed_figure(feed, inch), inch) == pytest.approx(feed, rel=1e-4)


@every_dialect
def test_only_its_own_folder_knows_it(dialect: Dialect) -> None:
    own = ROOT / "twin" / "programs" / dialect.name
    sources = [path for part in ("twin", "processors", "cnctwin", "edge") for path in (ROOT / part).rglob("*.py")]
    name = f"twin.programs.{dialect.name}"
    assert [path for path in sources if own not in path.parents and name in path.read_text(encoding="utf-8")] == []


@every_dialect
def test_its_page_says_what_is_read_of_it(dialect: Dialect) -> None:
    name = f"part-programs-{dialect.name}.md"
    page = (ROOT / "docs" / "reference" / name).read_text(encoding="utf-8")
    assert f'dialect = "{dialect.name}"' in page
    assert [suffix for suffix in dialect.suffixes if f"`{suffix}`" not in page] == []
    hub = (ROOT / "docs" / "reference" / "part-programs.md").read_text(encoding="utf-8")
    assert f"({name})" in hub and f"| `{dialect.name}` |" in hub
