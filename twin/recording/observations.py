"""Observations in the text of the NIST Smart Manufacturing Systems Test Bed: `2017-02-01T13:59:35.1093750Z|Block_Number|12`.

One a line, on change only, UTC with any number of fractional digits. What these files really hold is met here: lines cut off in
the middle and values that are missing are dropped and counted; lines that go back in time are sorted.
"""

from collections.abc import Iterable
from dataclasses import dataclass
from datetime import datetime
from typing import NamedTuple

from twin.errors import RunLogError

FIELDS_MAX = 7
"""A condition has `time|name_cond|level||||`."""


class Observation(NamedTuple):
    """`value` of `key` from `t_s` (seconds since 1970, UTC) on."""

    t_s: float
    key: str
    value: str


@dataclass(frozen=True, slots=True)
class Observations:
    """In order of time. dropped: how many lines were cut off or had no value."""

    rows: tuple[Observation, ...]
    dropped: int


def read_observations(text: str, source: str = "recording") -> Observations:
    """The observations in `text`. Raises RunLogError where there is not one.

    >>> read_observations("2017-02-01T00:00:01.5000000Z|Feed_Rate|50.8\\n2017\\n2017-02-01T00:00:02Z|Block_Number|").rows[0][1:]
    ('Feed_Rate', '50.8')
    """
    rows, dropped = [], 0
    for line in text.splitlines():
        if not line.strip():
            continue
        observation = _parsed(line.strip())
        if observation is None:
            dropped += 1
        else:
            rows.append(observation)
    if not rows:
        raise RunLogError(f"{source}: no line reads time|key|value, such as 2017-02-01T13:59:35.1Z|Block_Number|12")
    return Observations(tuple(sorted(rows, key=lambda row: row.t_s)), dropped)


def _parsed(line: str) -> Observation | None:
    stamp, *fields = line.split("|")
    if not 2 <= len(fields) < FIELDS_MAX or not fields[1].strip() or not stamp.endswith("Z"):
        return None
    seconds, _, fraction = stamp[:-1].partition(".")
    try:
        whole = datetime.fromisoformat(seconds + "+00:00").timestamp()
        return Observation(whole + (float("0." + fraction) if fraction else 0.0), fields[0], fields[1].strip())
    except ValueError:
        return None


def last_values(rows: Iterable[Observation]) -> dict[str, str]:
    """The value that each key had in the end: what a recording that follows on the same machine begins with."""
    return {row.key: row.value for row in rows}
