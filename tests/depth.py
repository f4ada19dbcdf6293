"""The depth of the suite: a slice that takes less than a quarter of an hour, or all of it with CNCTWIN_FULL=1.

The slice tries the same examples everywhere, the full run draws new ones each time (tests/conftest.py).
"""

import os

IS_FULL = bool(os.environ.get("CNCTWIN_FULL"))
EXAMPLES = 100 if IS_FULL else 50
"""Of a law that says nothing else."""


def examples(most: int, few: int = EXAMPLES) -> int:
    """Of a law that asks for `most`: all of them with CNCTWIN_FULL=1, else no more than `few`."""
    return most if IS_FULL else min(most, few)
