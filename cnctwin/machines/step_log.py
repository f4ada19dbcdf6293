"""The steps of a machine's description, one JSON line each in `history/<machine>/steps.jsonl`, which only grows.

    {"t": 1795327200000, "step": "promoted", "version": "3f2a…", "by": "anna", "why": "coolant cools", "before": "9c01…"}

`version` is the description that the step is about, `before` the one that was live until then. Numbers of the standing gap may
stand beside them, in floors: `gap_before`, `gap_after`.
"""

import json
from collections.abc import Sequence
from enum import StrEnum
from functools import lru_cache
from pathlib import Path
from typing import Any

from pydantic import BaseModel, ConfigDict, Field, ValidationError

from cnctwin.machines import disk

TEXT_MAX = 2000


class StepKind(StrEnum):
    """The kinds of steps. The first three make a description live.

    described: a file was written by hand; filed, withdrawn: a challenger comes and goes; the others are the loop's
    """

    DESCRIBED = "described"
    PROMOTED = "promoted"
    BACK = "back"
    FILED = "filed"
    WITHDRAWN = "withdrawn"
    COMPOSING = "composing"
    DIAGNOSING = "diagnosing"
    REFUSED = "refused"


_LIVE = (StepKind.DESCRIBED, StepKind.PROMOTED, StepKind.BACK)


class Step(BaseModel):
    """A line of the log. t: ms since 1970; by: a person, `rule`, `loop` or `file`."""

    model_config = ConfigDict(frozen=True, extra="allow")

    t: int
    step: StepKind
    version: str = ""
    by: str = Field(default="", max_length=200)
    why: str = Field(default="", max_length=TEXT_MAX)
    before: str = ""

    @property
    def makes_live(self) -> bool:
        """True where the step has made its version the live one."""
        return self.step in _LIVE

    @property
    def line(self) -> str:
        """The step as it is written."""
        return json.dumps(self.document, ensure_ascii=False, sort_keys=True)

    @property
    def document(self) -> dict[str, Any]:
        """The step as JSON has it, without what is empty."""
        return {key: value for key, value in self.model_dump(mode="json").items() if value not in ("", None)}


def read_steps(path: Path) -> tuple[Step, ...]:
    """Return the steps of a log, oldest first; a line that is none, as half of one after a power cut, is passed over."""
    return _steps(disk.text_of(path) or "")


@lru_cache(maxsize=200)
def _steps(text: str) -> tuple[Step, ...]:
    return tuple(step for line in text.splitlines() if (step := _parsed(line)) is not None)


def lives(steps: Sequence[Step]) -> tuple[str, ...]:
    """Return the versions that `back` leads through: the live one last, before it the one it took over from, and so on.

    >>> def step(kind, version):
    ...     return Step(t=0, step=kind, version=version)
    >>> lives([step("described", "a"), step("promoted", "b"), step("promoted", "c"), step("back", "b")])
    ('a', 'b')
    """
    found: list[str] = []
    for step in steps:
        if step.step is StepKind.BACK and step.version in found:
            while found[-1] != step.version:
                found.pop()
        elif step.makes_live and (not found or found[-1] != step.version):
            found.append(step.version)
    return tuple(found)


def _parsed(line: str) -> Step | None:
    try:
        return Step.model_validate_json(line)
    except (ValidationError, ValueError):
        return None
