"""The aliases of an edge node, kept over restarts, so that a metric has the same one in each birth of each life.

No rule asks for it (6.4.7: a birth tells the aliases again), but who has recorded data messages can then read them with any
birth.
A row of the file is a line of JSON, device (null: the node's own) and name; its number is the alias. New rows are added at the
end, so that a thousand devices cost a thousand times what one does. (Files written before are one list of all rows.)
"""

import json
import logging
from itertools import islice
from pathlib import Path

from sparkplug.edge_session import Aliases

ALIASES_MAX = 100_000
_log = logging.getLogger(__name__)


class AliasFile:
    """Keeps a table of aliases; `file` None keeps nothing. What cannot be read or written is said once and costs nothing else."""

    def __init__(self, file: Path | None) -> None:
        self._file = file
        self._kept = 0
        self._is_whole = False  # the file holds just the rows that are kept, so that more can be added
        self._trouble = ""

    def read(self) -> Aliases:
        """The table that was kept last, without a last row that was not written to its end; empty where none can be used."""
        if self._file is None or not self._file.exists():
            return {}
        try:
            text = self._file.read_text(encoding="utf-8")
            *lines, torn = text.split("\n")
            is_list = text.startswith(("[[", "[]"))
            rows = json.loads(text) if is_list else [json.loads(line) for line in lines]
            aliases = {(device, name): alias for alias, (device, name) in enumerate(map(_key, rows), start=1)}
            if not len(aliases) == len(rows) <= ALIASES_MAX:
                raise ValueError(f"{len(rows)} rows, {len(aliases)} different ones")
        except (OSError, ValueError, TypeError, RecursionError) as error:
            _log.warning("%s: no aliases can be read from it, so the metrics get new ones: %s", self._file, error)
            return {}
        self._is_whole = not is_list and not torn
        self._kept = len(aliases) if self._is_whole else 0
        return aliases

    def keep(self, aliases: Aliases) -> None:
        """Keep the table where it has grown."""
        new = len(aliases) - self._kept
        if self._file is None or new <= 0:
            return
        try:
            if self._is_whole:
                self._add(self._file, aliases, new)
            else:
                self._replace(self._file, aliases)
        except OSError as error:
            self._is_whole, self._kept = False, 0  # nobody knows how much of it was written
            if str(error) != self._trouble:
                self._trouble = str(error)
                _log.warning("%s: the aliases cannot be kept: %s", self._file, error)
        else:
            self._is_whole, self._kept, self._trouble = True, len(aliases), ""

    @staticmethod
    def _add(file: Path, aliases: Aliases, new: int) -> None:
        rows = [*islice(reversed(aliases), new)]
        with file.open("a", encoding="utf-8") as out:
            out.write("".join(map(_line, reversed(rows))))

    @staticmethod
    def _replace(file: Path, aliases: Aliases) -> None:
        fresh = file.with_name(file.name + ".new")
        file.parent.mkdir(parents=True, exist_ok=True)
        fresh.write_text("".join(map(_line, aliases)), encoding="utf-8")
        fresh.replace(file)


def _line(key: tuple[str | None, str]) -> str:
    return json.dumps(key, ensure_ascii=False) + "\n"


def _key(row: object) -> tuple[str | None, str]:
    match row:
        case [None | str() as device, str() as name]:
            return device, name
    raise ValueError(f"{row!r} is no device and name")
