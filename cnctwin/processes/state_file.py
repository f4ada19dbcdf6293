"""The state file of a process: its address and its counts as JSON, for the program that started it."""

import json
from pathlib import Path
from typing import Any

STATE_S = 0.5
"""Seconds from one state to the next."""


def keep(state_file: Path | None, state: dict[str, Any]) -> None:
    """Replace the state file, where there is to be one, as a whole, so that a reader never sees half of it."""
    if state_file is None:
        return
    fresh = state_file.with_name(state_file.name + ".new")
    fresh.write_text(json.dumps(state))
    fresh.replace(state_file)


def read(state_file: Path) -> dict[str, Any]:
    """Return the state that a process keeps; empty before it has written any."""
    try:
        state: dict[str, Any] = json.loads(state_file.read_text())
    except (OSError, ValueError):
        return {}
    return state
