"""The folder where commands keep what has to survive a restart by default: birth/death numbers, and the places of edges."""

import os
from pathlib import Path

VARIABLE = "CNCTWIN_STATE_DIR"


def state_dir(given: Path | None = None) -> Path:
    """The given folder; else $CNCTWIN_STATE_DIR, else `cnctwin` in $XDG_STATE_HOME or ~/.local/state."""
    if given is not None:
        return given
    if named := os.environ.get(VARIABLE):
        return Path(named)
    home = os.environ.get("XDG_STATE_HOME")
    return (Path(home) if home else Path.home() / ".local" / "state") / "cnctwin"
