"""A table of what a plant says: long cells are folded, and every cell is text, since a bracket in a name is no markup."""

from collections.abc import Iterable, Sequence

from rich.table import Table
from rich.text import Text


def text_table(columns: Sequence[str], rows: Iterable[Sequence[str]]) -> Table:
    """Return a table without an edge, a row for each of `rows`."""
    table = Table(show_edge=False)
    for column in columns:
        table.add_column(column, overflow="fold")
    for row in rows:
        table.add_row(*map(Text, row))
    return table
