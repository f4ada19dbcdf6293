"""How long the fuzz tests try: CNCTWIN_FUZZ_EXAMPLES is the number of examples of each, 40 where nothing is said."""

import os
import time
import tracemalloc
from collections.abc import Iterator
from contextlib import contextmanager

from hypothesis import HealthCheck, settings

EXAMPLES = int(os.environ.get("CNCTWIN_FUZZ_EXAMPLES", "40"))
FUZZ = settings(max_examples=EXAMPLES, deadline=None, suppress_health_check=list(HealthCheck))


@contextmanager
def within(cpu_s: float, peak_mb: float | None = None) -> Iterator[None]:
    """What is done in here takes no more of the processor and of the memory, however busy the machine is otherwise."""
    if peak_mb is not None:
        tracemalloc.start()
    began_s = time.process_time()
    try:
        yield
        took_s, peak = time.process_time() - began_s, tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()
    assert took_s < cpu_s, f"{took_s:.1f} s of the processor"
    assert peak_mb is None or peak < peak_mb * 2**20, f"{peak / 2**20:.0f} MiB"
