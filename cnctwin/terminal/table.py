"""A table of what a plant says, made to fit: cells break between words, and columns that matter less give way.

Every cell is text, since a bracket in a name is no markup.
"""

from collections.abc import Collection, Iterable, Sequence

from rich.table import Table
from rich.text import Text

FRAME = 3
"""Characters that a column takes beside its text: a blank on each side and a line."""


def text_table(
    columns: Sequence[str],
    rows: Iterable[Sequence[str]],
    width: int | None = None,
    gives_way: Collection[str] = (),
    *,
    title: str | None = None,
    show_edge: bool = False,
) -> Table:
    """Return a table with a row for each of `rows`.

    width: of the terminal; where a word would break in it, columns of `gives_way` are left out, the first of them first
    """
    lines = [columns, *rows]
    shown = list(range(len(columns)))
    widths = None
    if width is not None:
        for name in gives_way:
            if _needed([_longest_word(lines, place) for place in shown]) <= width:
                break
            shown.remove(columns.index(name))
        widths = fitted(
            [(_longest_word(lines, place), _longest_line(lines, place)) for place in shown], width - FRAME * len(shown) - 1
        )
    table = Table(show_edge=show_edge, title=title, title_justify="left")
    for at, place in enumerate(shown):
        table.add_column(columns[place], overflow="fold", width=None if widths is None else widths[at])
    for row in lines[1:]:
        table.add_row(*(Text(row[place]) for place in shown))
    return table


def fitted(columns: Sequence[tuple[int, int]], room: int) -> list[int]:
    """Return the width of each column, from its longest word and its longest line: the widest is narrowed first, and none below
    its longest word while another one can be.

    >>> fitted([(4, 4), (9, 40), (6, 20)], 40), fitted([(4, 4), (9, 9)], 40), fitted([(10, 10), (20, 20)], 24)
    ([4, 18, 18], [4, 9], [10, 14])
    """
    widths = [line for _, line in columns]
    while sum(widths) > max(room, len(widths)):
        slack = [at for at, (word, _) in enumerate(columns) if widths[at] > word]
        widest = max(slack or range(len(widths)), key=lambda at: widths[at])
        widths[widest] -= 1
    return widths


def left_out(table: Table, columns: Sequence[str]) -> list[str]:
    """Return the columns that gave way."""
    shown = {str(column.header) for column in table.columns}
    return [name for name in columns if name not in shown]


def _needed(widths: Sequence[int]) -> int:
    return sum(widths) + FRAME * len(widths) + 1


def _longest_word(lines: Sequence[Sequence[str]], place: int) -> int:
    return max((len(word) for line in lines for word in line[place].split()), default=1)


def _longest_line(lines: Sequence[Sequence[str]], place: int) -> int:
    return max((len(part) for line in lines for part in line[place].split("\n")), default=1)
