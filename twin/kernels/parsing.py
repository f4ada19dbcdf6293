"""Syntax trees of source text, built one at a time.

CPython 3.11 and 3.12 count the depth of a tree in one place for all threads. Two that build trees at once may fail with
"SystemError: AST constructor recursion depth mismatch" (fixed in 3.13), and a diagnosis looks at several stages side by side.
"""

import ast
from threading import Lock

_ONE_AT_A_TIME = Lock()


def parsed(text: str) -> ast.Module:
    """Return the syntax tree of a text."""
    with _ONE_AT_A_TIME:
        return ast.parse(text)
