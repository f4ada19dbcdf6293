"""A table fits its terminal: words stay whole as long as there is room for them, and lesser columns go first."""

import io

import pytest
from rich.console import Console

from cnctwin.terminal.table import left_out, text_table

COLUMNS = ("signal", "native unit", "value now", "why not")
ROWS = (
    ("spindle_override_pct", "REVOLUTION/MINUTE", "12000.25", "the control has not sent it since the edge has begun to listen"),
    ("axis_x_pos_mm", "MILLIMETER", "[1.5]", ""),
)


def printed(width: int) -> tuple[str, list[str]]:
    console = Console(file=io.StringIO(), width=width)
    table = text_table(COLUMNS, ROWS, width, ("native unit",), show_edge=True)
    console.print(table)
    return str(console.file.getvalue()), left_out(table, COLUMNS)  # type: ignore[attr-defined]


@pytest.mark.parametrize(("width", "gone"), [(200, []), (80, []), (60, ["native unit"])])
def test_words_stay_whole_and_lesser_columns_give_way(width: int, gone: list[str]) -> None:
    text, missing = printed(width)
    assert missing == gone
    words = text.split()
    assert {"spindle_override_pct", "axis_x_pos_mm", "12000.25", "[1.5]", "control"} <= set(words)
    assert max(map(len, text.splitlines())) <= width


def test_where_there_is_no_room_at_all_a_word_is_broken_and_the_frame_stays() -> None:
    assert max(map(len, printed(30)[0].splitlines())) <= 30
