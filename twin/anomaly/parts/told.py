"""One tick of a machine, as its control tells it."""

from collections.abc import Sequence
from typing import NamedTuple, Protocol


class Expects(Protocol):
    """The twin's expectation at a line, at programmed feed and speed: overrides are taken into account by whoever compares."""

    @property
    def cut_load_pct(self) -> float | None:
        """Spindle load of the cut alone, without what the spindle takes idle."""

    @property
    def load_pct(self) -> float | None:
        """Spindle load."""

    @property
    def feed_mm_min(self) -> float | None:
        """Feed along the path."""

    @property
    def spindle_rpm(self) -> float | None:
        """Spindle speed."""

    @property
    def force_n(self) -> float | None:
        """Cutting force."""


class Told(NamedTuple):
    """values: in the order of the model's signals, None where one is not known; line: of the NC program
    expected: the twin's expectation at this line, None where no NC program is at hand
    """

    tick: int
    values: Sequence[float | None]
    program: str | None = None
    tool: int | None = None
    line: int | None = None
    feed_override_pct: float | None = None
    spindle_override_pct: float | None = None
    expected: Expects | None = None
    is_gated: bool = False
