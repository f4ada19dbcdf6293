"""The aliases of an edge node, kept over restarts, so that a metric has the same one in each birth of each life.

No rule asks for it (6.4.7: a birth tells the aliases anew), but who has recorded data messages can then read them with any birth.
"""

import json
import logging
import time
from pathlib import Path

from sparkplug.edge_session import Aliases

ALIASES_MAX = 100_000
SHARE_OF_TIME = 50  # one part of so many goes into writing
_log = logging.getLogger(__name__)


class AliasFile:
    """Keeps a table of aliases; `file` None keeps nothing. What cannot be read or written is said once and costs nothing else."""

    def __init__(self, file: Path | None) -> None:
        self._file = file
        self._kept = 0
        self._busy_until_s = 0.0

    def read(self) -> Aliases:
        """The table that was kept last; empty where there is none that can be used."""
        if self._file is None or not self._file.exists():
            return {}
        try:
            rows = json.loads(self._file.read_text(encoding="utf-8"))
            aliases = {(device, name): alias for alias, (device, name) in enumerate(map(_key, rows), start=1)}
            if not len(aliases) == len(rows) <= ALIASES_MAX:
                raise ValueError(f"{len(rows)} rows, {len(aliases)} different ones")
        except (OSError, ValueError, TypeError) as error:
            _log.warning("%s: no aliases can be read from it, so the metrics get new ones: %s", self._file, error)
            return {}
        self._kept = len(aliases)
        return aliases

    def keep(self, aliases: Aliases, *, at_once: bool = False) -> None:
        """Keep the table where it has grown. The file is replaced as a whole; where that takes long, as while a thousand devices
        are declared one after the other, later calls keep it, unless it is to be done `at_once`."""
        began_s = time.monotonic()
        if self._file is None or len(aliases) == self._kept or (began_s < self._busy_until_s and not at_once):
            return
        self._kept = len(aliases)
        fresh = self._file.with_name(self._file.name + ".new")
        try:
            self._file.parent.mkdir(parents=True, exist_ok=True)
            fresh.write_text(json.dumps(list(aliases), ensure_ascii=False), encoding="utf-8")
            fresh.replace(self._file)
        except OSError as error:
            _log.warning("%s: the aliases cannot be kept: %s", self._file, error)
        done_s = time.monotonic()
        self._busy_until_s = done_s + SHARE_OF_TIME * (done_s - began_s)


def _key(row: object) -> tuple[str | None, str]:
    match row:
        case [None | str() as device, str() as name]:
            return device, name
    raise ValueError(f"{row!r} is no device and name")
