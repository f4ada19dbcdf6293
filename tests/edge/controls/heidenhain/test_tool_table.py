"""The tool table of the control: columns by their names, whole or not at all, and the row of the tool in the spindle."""

from importlib.resources import files

import pytest
from hypothesis import given
from hypothesis import strategies as st

from edge.controls.heidenhain.tool_table import ToolTable, read_table
from tests.edge.controls.heidenhain.test_cursor import Player, value

TABLE = files("cnctwin.standins.lsv2_server").joinpath("tool.t").read_text(encoding="ascii")
PATH = "TNC:\\table\\tool.t"
SIGNALS = (
    "tool_length_mm",
    "tool_radius_mm",
    "tool_length_wear_mm",
    "tool_radius_wear_mm",
    "tool_life_used_min",
    "tool_life_limit_min",
)


def figures(table: ToolTable, tool: int) -> list[object]:
    return [outcome[0] if outcome[0] is not None else outcome[2] for _, outcome in table.outcomes(tool)]


def test_a_row_has_length_radius_wear_age_and_its_limit() -> None:
    table = read_table(TABLE)
    assert len(table.rows) == 6
    assert figures(table, 1) == [127.5, 6.0, -0.01, 0.005, 18.5, 60.0]
    assert figures(table, 2)[-1] == "tool 2 has no TIME1 in the tool table"
    assert figures(table, 77) == ["tool 77 is not in the tool table"] * 6


def test_a_table_in_inches_becomes_millimetres_and_its_times_stay() -> None:
    assert figures(read_table(TABLE.replace("TOOL.T MM", "TOOL.T INCH").replace("+127.5", "+5    ")), 1)[:1] == [127.0]
    assert figures(read_table(TABLE.replace("TOOL.T MM", "TOOL.T INCH")), 1)[4] == 18.5


def test_an_index_of_a_tool_is_not_that_tool_and_a_missing_column_is_named() -> None:
    assert figures(read_table(TABLE.replace("\n1    ", "\n1.1  ")), 1) == ["tool 1 is not in the tool table"] * 6
    assert figures(read_table(TABLE.replace("CUR_TIME", "REMARK  ")), 1)[4] == "the tool table has no column CUR_TIME"


@pytest.mark.parametrize(
    ("text", "fault"),
    [
        (TABLE.replace("[END]", ""), "the tool table has no [END]; it was not read whole"),
        ("", "no table: it does not begin with BEGIN"),
        ("BEGIN TOOL.T MM\nT  NAME\n[END]", "the tool table has no line with the columns T, L and R"),
    ],
)
def test_a_table_that_is_not_whole_gives_no_figure(text: str, fault: str) -> None:
    assert figures(read_table(text), 1) == [fault] * 6


@given(st.text(max_size=200), st.integers(0, len(TABLE)))
def test_whatever_stands_in_a_table_it_is_read_or_refused(word: str, at: int) -> None:
    table = read_table(TABLE[:at] + word + TABLE[at:])
    assert all(outcome[0] is not None or outcome[2] for _, outcome in table.outcomes(1))


def test_the_parser_gives_the_row_of_the_tool_in_the_spindle() -> None:
    player = Player(tool_table=PATH)
    assert value(player.look(1), "tool_length_mm").reason == "unavailable: the tool in the spindle is not known"
    player.look(2)
    player.look(2)
    assert value(player.look(3), "tool_length_mm").reason == "the tool table was not read yet"
    given_ = player.look(3, tool_table=TABLE)
    assert [value(given_, name).value for name in SIGNALS] == [127.5, 6.0, -0.01, 0.005, 18.5, 60.0]
    player.look(5)
    player.look(5)
    assert value(player.look(6), "tool_life_used_min").value == 3.25
    assert {offer.source for offer in player.cursor.offers if offer.signal in SIGNALS} == {
        f"tool table {column}" for column in ("L", "R", "DL", "DR", "CUR_TIME", "TIME1")
    }


def test_without_a_table_an_itnc_tells_length_and_radius_and_the_program_its_comment() -> None:
    player = Player()
    given_ = player.look(3, tool=1, tool_length=100.0, tool_radius=6.0)
    assert [value(given_, name).value for name in SIGNALS[:2]] == [100.0, 6.0]
    assert not {sample.signal for sample in given_.samples} & set(SIGNALS[2:])
    assert value(given_, "program_comment").value == "PLATE"
