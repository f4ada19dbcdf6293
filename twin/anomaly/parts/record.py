"""An operation of a part that has ended, beside the same operation of earlier parts: what wear and drift are read from.

    load_ratio = mean over the sections of   cutting load / frozen reference

The reference is frozen (the twin's expectation where there is one, else the first healthy parts), so that wear stays visible.
"""

import json
from typing import NamedTuple

VERSION = 1


class CutRecord(NamedTuple):
    """A ratio that is not known is None. operation: program, tool, and n-th use of the tool in the program
    ended_s: event time; load_ratio_sd: standard error of load_ratio; reference: "twin" or "parts"
    """

    program: str | None
    tool: int | None
    operation: str
    part: int
    ended_s: float
    duration_s: float
    duration_ratio: float | None
    load_ratio: float | None
    load_ratio_sd: float | None
    vibration_ratio: float | None
    feed_ratio: float | None
    parts_known: int
    reference: str
    is_alarmed: bool

    def in_json(self) -> str:
        """Return the JSON text that is published."""
        return json.dumps({"version": VERSION, **self._asdict()}, separators=(",", ":"), allow_nan=False)
