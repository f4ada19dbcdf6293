"""Composes a case from a machine's history: finds its stretches and programs, gives them roles, writes them."""

from collections.abc import Callable
from pathlib import Path

from cnctwin.composing.composed import Composed
from cnctwin.memory.store.contract import Store

Span = tuple[int, int]


def compose(
    store: Store,
    machine: str,
    description: str,
    out: Path,
    *,
    span_ms: Span | None = None,
    healthy_ms: Span | None = None,
    programs: Path | None = None,
    ambient_c: float | None = None,
    progress: Callable[[str], None] = lambda _: None,
) -> Composed:
    """Write the case of a machine's history into the folder `out`, which appears when it is complete, and return it.

    description: the text of its machine.toml; span_ms: [from, to), else all that the store has of it
    healthy_ms: a stretch in which the twin was known to be right; programs: a folder with the NC files that it runs
    ambient_c: the surroundings, where no signal tells them

    The same history gives the same bytes. Raises UsageError where the history has nothing that could be compared, StoreError,
    and MachineError where the description is wrong.
    """
    raise NotImplementedError
