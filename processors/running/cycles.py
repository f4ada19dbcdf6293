"""Looking for cycles seldom, where the work makes hardly any.

What a message brings lives until the next one of its machine comes. To look for cycles after each 700 objects, as Python does
by itself, would be a quarter of all work.
"""

import gc
from collections.abc import Iterator
from contextlib import contextmanager

SELDOM = (50_000, 20, 100)


@contextmanager
def seldom_looked_for() -> Iterator[None]:
    """Have Python look for cycles seldom while this lasts."""
    thresholds = gc.get_threshold()
    gc.set_threshold(*SELDOM)
    try:
        yield
    finally:
        gc.set_threshold(*thresholds)
