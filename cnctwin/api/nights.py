"""The nights in which the twin was judged, as `cnctwin validate` keeps them; read again only when a file has changed."""

import threading
from pathlib import Path
from typing import Any

from cnctwin.validation.history import default_folder, file_of, validation_of


class Nights:
    """The answers by machine. Threads may share it."""

    def __init__(self, folder: Path | None = None) -> None:
        self.folder = folder or default_folder()
        self._lock = threading.Lock()
        self._known: dict[str, tuple[int, dict[str, Any]]] = {}

    def of(self, machine: str) -> dict[str, Any]:
        """Return the validation of a machine; `t` is None where it was never judged. Raises UsageError."""
        try:
            changed_ns = file_of(machine, self.folder).stat().st_mtime_ns
        except (OSError, ValueError):
            return {"machine": machine, "t": None, "verdict": None, "figures": [], "nights": [], **_NO_RETRAINING}
        with self._lock:
            known = self._known.get(machine)
            if known is None or known[0] != changed_ns:
                known = self._known[machine] = (changed_ns, validation_of(machine, self.folder))
            return known[1]


_NO_RETRAINING: dict[str, Any] = {"retrain": False, "retrain_reason": None, "over_in_a_row": {}}
