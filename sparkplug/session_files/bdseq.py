"""The birth/death sequence number, kept over restarts (Sparkplug 3.0.0, 6.4.2: one more for each CONNECT, mod 256, from 0)."""

import json
import os
from pathlib import Path

from sparkplug.errors import SparkplugError


class BdSeq:
    """Hands out the number of the next CONNECT and remembers it in `file` (None: only as long as the process lives).

    The file is replaced as a whole before the number is used, so that a kill -9 at any moment may skip a number but can
    never use one twice.
    """

    def __init__(self, file: Path | None = None) -> None:
        self._file = file
        self._unused = False
        self._last = -1 if file is None else self._read(file)

    def next(self) -> int:
        """The number for the next CONNECT."""
        if self._unused:
            self._unused = False
            return self._last
        self._last = (self._last + 1) % 256
        if self._file is not None:
            self._write(self._file, self._last)
        return self._last

    def give_back(self) -> None:
        """The last number was not used: no CONNECT went out with it."""
        self._unused = True

    @staticmethod
    def _read(file: Path) -> int:
        try:
            last = json.loads(file.read_text())["bdSeq"]
        except FileNotFoundError:
            return -1
        except (OSError, ValueError, KeyError, TypeError) as error:
            raise SparkplugError(f"{file}: cannot read the last bdSeq ({error}); mend or delete the file") from error
        if type(last) is not int or not 0 <= last <= 255:
            raise SparkplugError(f"{file}: bdSeq {last!r} is not 0 to 255; mend or delete the file")
        return last

    @staticmethod
    def _write(file: Path, last: int) -> None:
        file.parent.mkdir(parents=True, exist_ok=True)
        fresh = file.with_name(file.name + ".new")
        with fresh.open("w") as out:
            json.dump({"bdSeq": last}, out)
            out.flush()
            os.fsync(out.fileno())
        fresh.replace(file)
