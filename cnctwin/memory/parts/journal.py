"""The deliveries to one receiver, on the disk: up to when, and the ids of late, so that a restart sends nothing again.

Written before the next part is sent. A part that was taken just before a crash is sent again, with the same id.
"""

import json
import os
from dataclasses import dataclass, field
from pathlib import Path

from cnctwin.errors import UsageError
from cnctwin.files.synced import make_folder, sync

IDS_MAX = 5000


@dataclass(slots=True)
class Journal:
    """since_ms: parts that were finished before are none of the receiver's; until_ms: by machine, the end of the newest part that
    is settled; ids: the last ones, with what became of each."""

    file: Path
    since_ms: int | None = None
    until_ms: dict[str, int] = field(default_factory=dict)
    ids: dict[str, str] = field(default_factory=dict)

    @classmethod
    def read(cls, file: Path) -> "Journal":
        """As it was left; empty where there is none yet. Raises UsageError."""
        try:
            document = json.loads(file.read_text(encoding="utf-8"))
            return cls(file, int(document["since_ms"] or 0), dict(document["until_ms"]), dict(document["ids"]))
        except FileNotFoundError:
            return cls(file)
        except (OSError, ValueError, KeyError, TypeError) as error:
            raise UsageError(f"{file} cannot be read ({error}); remove it, and all parts are delivered again") from None

    def begin(self, since_ms: int) -> None:
        """From when on parts are delivered."""
        self.since_ms = since_ms
        self._write()

    def settle(self, machine: str, part_id: str, ended_ms: int, became: str) -> None:
        """A part has come to its end: delivered, refused or given up."""
        self.until_ms[machine] = max(self.until_ms.get(machine, 0), ended_ms)
        self.ids[part_id] = became
        while len(self.ids) > IDS_MAX:
            del self.ids[next(iter(self.ids))]
        self._write()

    def _write(self) -> None:
        make_folder(self.file.parent)
        beside = self.file.with_suffix(".new")
        with beside.open("w", encoding="utf-8") as out:
            json.dump({"since_ms": self.since_ms, "until_ms": self.until_ms, "ids": self.ids}, out)
            out.flush()
            os.fsync(out.fileno())
        beside.replace(self.file)
        sync(self.file.parent)
