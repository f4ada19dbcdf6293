"""The state of the fold: the cells by signal and regime, how far time has come, and by which rules they are kept."""

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import NamedTuple

from processors.gap.cell import Cell, Terms, described_anew
from processors.gap.described import Given
from processors.gap.signals import LOAD, RESOLUTIONS, TEMPERATURE, TOOL_CHANGE
from processors.gap.timing import NOTHING_TIMED, Timing
from processors.gap.watch import Watch

YEAR_S = 365.25 * 86_400.0
SIDES = 3
"""The ways in which a cell grows: its mean rises, its mean falls, its scatter grows."""
OF_DESCRIPTION = (f"{TEMPERATURE}/", f"{LOAD}/air", f"{TOOL_CHANGE}/spindle_stopped")
"""The cells, by the start of their key, whose twin is computed from the description."""


@dataclass(frozen=True, slots=True)
class State:
    """The cells by signal and regime, and how far time has come.

    block, round: number since 1970 of the present block, and of the last time that figures were published
    left_out: share of the time in which nothing could be compared
    version, described_s: of the description that the cells compare with, and since when it counts; None = since the first sample
    """

    watch: Watch = field(default_factory=Watch)
    timing: Timing = NOTHING_TIMED
    healthy_from_s: float | None = None
    block: int = -1
    round: int = -1
    seconds: float = 0.0
    left_out: float = 0.0
    version: str = ""
    described_s: float | None = None
    cells: Mapping[str, Cell] = field(default_factory=dict)

    def watching(self, watch: Watch, timing: Timing) -> "State":
        """Return the state with this watch and timing. Spelled out, since `replace` looks up each field."""
        return State(
            watch, timing, self.healthy_from_s, self.block, self.round, self.seconds, self.left_out, self.version,
            self.described_s, self.cells,
        )  # fmt: skip


class Floor(NamedTuple):
    """The floor of a cell, in the unit of its signal. is_learned: from the samples of the healthy machine, or configured"""

    value: float
    is_learned: bool


def begun(given: Given, state: State, at_s: float) -> State:
    """Return the state with the start of the healthy period; where another one is configured now, all is learned again."""
    if given.config.healthy_from is None:
        return state if state.healthy_from_s is not None else replace(state, healthy_from_s=at_s)
    from_s = given.config.healthy_from.timestamp()
    if state.healthy_from_s == from_s:
        return state
    return State(state.watch, state.timing, from_s, version=state.version, described_s=state.described_s)


def taken_up(given: Given, state: State, at_s: float) -> State:
    """Return the state under the description that holds now: what its twin computes begins again, what was learned stays."""
    version = given.twin.version
    if state.version == version:
        return state
    cells = {key: described_anew(cell) if key.startswith(OF_DESCRIPTION) else cell for key, cell in state.cells.items()}
    is_first = not cells and not state.version
    watch = replace(state.watch, rise_mean_k=None)
    return replace(state, watch=watch, version=version, described_s=None if is_first else at_s, cells=cells)


def healthy_s(given: Given, state: State) -> tuple[float, float]:
    """Return the healthy period, s since 1970."""
    from_s = state.healthy_from_s or 0.0
    return from_s, from_s + given.config.healthy_hours * 3600.0


def floor_of(given: Given, state: State, signal: str, cell: Cell, at_s: float) -> Floor | None:
    """Return the floor of a cell: configured or learned, else from the noise of the description; None while it is not known."""
    configured = given.config.floors.get(signal)
    if configured is not None:
        return Floor(configured, True)
    if cell.has_floor and at_s >= healthy_s(given, state)[1]:
        return Floor(max(cell.deviation, RESOLUTIONS[signal] / math.sqrt(12.0)), True)
    until_learned = None if cell.is_learned else given.floor_until_learned(signal)
    return None if until_learned is None else Floor(until_learned, False)


def terms_of(given: Given, state: State, key: str, cell: Cell, at_s: float) -> Terms:
    """Return the rules by which a cell is kept."""
    config, signal = given.config, key.partition("/")[0]
    floor = floor_of(given, state, signal, cell, at_s)
    return Terms(
        floor=None if floor is None else floor.value,
        resolution=RESOLUTIONS[signal],
        standing_s=config.standing_hours * 3600.0,
        block_s=config.block_s,
        growth_floors=config.growth_floors,
        blocks_between_alarms=SIDES * max(len(state.cells), 1) * YEAR_S / config.block_s / config.false_alarms_per_year,
        blocks_of_window=config.blocks_of_window,
    )


def cells_of(cells: Mapping[str, Cell], signal: str) -> dict[str, Cell]:
    """Return the cells of a signal, by regime."""
    start = f"{signal}/"
    return {key[len(start) :]: cell for key, cell in cells.items() if key.startswith(start)}
