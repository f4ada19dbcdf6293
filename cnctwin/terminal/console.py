"""Standard output as a console."""

import os

from rich.console import Console

WIDTH_ELSEWHERE = 120


def standard_output(width_elsewhere: int = WIDTH_ELSEWHERE) -> Console:
    """Return standard output; into a file or a pipe it is as wide as COLUMNS says, else as the tables need."""
    console = Console()
    if not console.is_terminal and not os.environ.get("COLUMNS", "").isdecimal():
        console.width = width_elsewhere
    return console
