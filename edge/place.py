"""The place in the control's stream up to which everything is published or counted, kept over restarts of the edge.

With it, an edge that was killed goes on where it was as far as the control's server still has what came since, and counts as a
hole what it has not. The file is replaced as a whole after each frame was published; so a kill -9 at any moment has at most the
last frame published twice, with the same time stamps, and nothing lost. No fsync: after a power cut the place may be gone, and
then the edge starts from the present state as on its first day.
"""

import json
import logging
from pathlib import Path
from typing import NamedTuple

EDGE_RESTARTED = "edge restarted"  # the hole of an edge that knows where it was, but not what it had taken
_log = logging.getLogger(__name__)


class Place(NamedTuple):
    """The life of the control's server, and the number of the first observation that was not taken yet."""

    instance: str
    next_sequence: int


class PlaceFile:
    """Keeps a place; `file` None keeps nothing."""

    def __init__(self, file: Path | None) -> None:
        self._file = file
        self._kept: Place | None = None
        self._is_told = False

    def read(self) -> Place | None:
        """The place that was kept last; None where there is none, or none that can be read."""
        if self._file is None or not self._file.exists():
            return None
        try:
            document = json.loads(self._file.read_text())
            instance, next_sequence = document["instance"], document["next_sequence"]
        except (OSError, ValueError, KeyError, TypeError) as error:
            _log.warning(
                "%s: no place can be read from it, so what came while the edge was away is not known: %s", self._file, error
            )
            return None
        return Place(instance, next_sequence) if isinstance(instance, str) and type(next_sequence) is int else None

    def keep(self, place: Place | None) -> None:
        """Remember this place. A disk that takes nothing is told once; the edge goes on without."""
        if self._file is None or place is None or place == self._kept:
            return
        self._kept = place
        fresh = self._file.with_name(self._file.name + ".new")
        try:
            self._file.parent.mkdir(parents=True, exist_ok=True)
            fresh.write_text(json.dumps(place._asdict()))
            fresh.replace(self._file)
        except OSError as error:
            if not self._is_told:
                _log.warning("%s: the place in the stream cannot be kept: %s", self._file, error)
            self._is_told = True
