"""A plan for a year of these machines on this disk, and what to keep: from what a store has seen, or from figures.

Bytes a sample are measured (docs/reference/store.md): of slow signals with few decimals, of vibration in blocks, of features.
"""

import math
from dataclasses import asdict, dataclass
from typing import Any

from cnctwin.memory.store.retention import Retention

DAYS_A_YEAR = 365.25
SECONDS_A_DAY = 86_400
SLOW_BYTES, BLOCK_BYTES, TWIN_BYTES = 1.3, 1.0, 7.0
ROLLUP_BYTES_A_SIGNAL_AND_DAY = 12_000
TWIN_SAMPLES_A_MACHINE_AND_SECOND = 5.0
BLOCK_DAYS_LEAST, RAW_DAYS_MOST = 1.0, 365.0
SPARE = 0.85
"""The share of the disk that may be used; the rest is for pins, for the hot tier and for what nobody thought of."""


@dataclass(frozen=True, slots=True)
class Load:
    """The bytes that all machines together write a day: slow signals, blocks (vibration), features, roll-ups; and its basis."""

    slow: float
    blocks: float
    features: float
    rollups: float
    basis: str

    @property
    def for_ever(self) -> float:
        """Bytes a day that are never swept."""
        return self.features + self.rollups


def load_of(machines: int, signals: int, rate_hz: float, *, vibration_hz: float = 0.0, vibration_axes: int = 3) -> Load:
    """The load of so many machines with so many slow signals each.

    >>> round(load_of(1, 10, 10.0).slow / 1e6, 1)
    11.2
    """
    return Load(
        slow=machines * signals * rate_hz * SECONDS_A_DAY * SLOW_BYTES,
        blocks=machines * vibration_hz * vibration_axes * SECONDS_A_DAY * BLOCK_BYTES,
        features=machines * TWIN_SAMPLES_A_MACHINE_AND_SECOND * SECONDS_A_DAY * TWIN_BYTES,
        rollups=machines * (signals + 10) * ROLLUP_BYTES_A_SIGNAL_AND_DAY,
        basis=f"{machines} machine" + "s" * (machines != 1) + f", {signals} signals each, {rate_hz:g} Hz",
    )


@dataclass(frozen=True, slots=True)
class Plan:
    """A year's cost, and what is proposed.

    fits: whether the wish (raw for a year, blocks for a week) fits the disk; days_to_full: at that load with nothing swept;
    years_for_ever: how long what is never swept has room. None: there is no end to it
    """

    load: Load
    year_bytes: float
    disk_bytes: int
    fits: bool
    days_to_full: float | None
    years_for_ever: float | None
    proposed: Retention

    def as_json(self) -> dict[str, Any]:
        """For a program to read."""
        told = asdict(self)
        told["load"] = {name: round(value) if isinstance(value, float) else value for name, value in told["load"].items()}
        told["year_bytes"] = round(self.year_bytes)
        return told


def plan(load: Load, disk_bytes: int) -> Plan:
    """The proposal: a year of raw and a week of blocks, or what of these fits beside a year of what stays for ever.

    >>> plan(load_of(8, 10, 10.0), 40_000_000_000).proposed.raw_days
    272.0
    """
    a_day = load.slow + load.blocks + load.for_ever
    room = disk_bytes * SPARE - load.for_ever * DAYS_A_YEAR
    wished = Retention(disk_bytes=disk_bytes)
    block_days = wished.block_days
    if load.blocks and load.blocks * block_days > room / 2:
        block_days = max(BLOCK_DAYS_LEAST, min(block_days, room / 2 / load.blocks))
    left = room - load.blocks * block_days
    raw_days = min(RAW_DAYS_MOST, left / load.slow) if load.slow else RAW_DAYS_MOST
    fits = block_days == wished.block_days and raw_days >= RAW_DAYS_MOST
    return Plan(
        load=load,
        year_bytes=a_day * DAYS_A_YEAR,
        disk_bytes=disk_bytes,
        fits=fits,
        days_to_full=disk_bytes / a_day if a_day else None,
        years_for_ever=disk_bytes * SPARE / (load.for_ever * DAYS_A_YEAR) if load.for_ever else None,
        proposed=Retention(max(1.0, float(math.floor(raw_days))), round(block_days, 1), disk_bytes),
    )
