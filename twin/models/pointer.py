"""`current.json` in a folder of versions: which of them is the champion, and which was it before.

    {"champion": "3f2a…", "previous": "91bc…" | null, "promoted_at": "2026-11-22T00:10:00Z", "warm_until": "2026-11-24T00:10:00Z",
     "reason": "why"}

All of this is pure, on the text of that file; reading it is for whoever calls.
"""

import json
from dataclasses import asdict, dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from twin.models.errors import PointerError

POINTER, LINK = "current.json", "current"
VERSION_MAX = 200


@dataclass(frozen=True, slots=True)
class Pointer:
    """champion, previous: names of folders beside the file; promoted_at, warm_until (of the previous one): UTC, ISO 8601"""

    champion: str
    previous: str | None = None
    promoted_at: str = ""
    warm_until: str = ""
    reason: str = ""

    @property
    def text(self) -> str:
        """As the file holds it."""
        return json.dumps(asdict(self), indent=2, ensure_ascii=False) + "\n"

    def is_warm(self, now_s: float) -> bool:
        """Return True where the previous champion is kept beside the present one at a moment, s since 1970.

        >>> Pointer("b", "a", "1970-01-01T00:00:00Z", "1970-01-03T00:00:00Z").is_warm(172_799.0)
        True
        """
        return self.previous is not None and bool(self.warm_until) and now_s < seconds(self.warm_until)


def pointer_of(text: str, source: str = POINTER) -> Pointer:
    """The pointer in the text of a file. Raises PointerError.

    >>> pointer_of('{"champion": "3f2a"}').champion
    '3f2a'
    """
    try:
        found = json.loads(text)
    except (ValueError, RecursionError) as error:
        raise PointerError(f"{source}: is not JSON: {error}") from None
    if not isinstance(found, dict):
        raise PointerError(f"{source}: holds no object; cnctwin model promote writes it")
    champion = _version(found.get("champion"), "champion", source)
    previous = None if found.get("previous") is None else _version(found["previous"], "previous", source)
    stamps = {name: _stamp(found.get(name, ""), name, source) for name in ("promoted_at", "warm_until")}
    return Pointer(champion, previous, **stamps, reason=str(found.get("reason", ""))[:1000])


def resolve(folder: Path, text: str | None) -> Path:
    """The folder of the model that counts: that of the champion; the folder itself where it has no current.json (text None).

    >>> resolve(Path("models/residual/vmc"), '{"champion": "3f2a"}').as_posix()
    'models/residual/vmc/3f2a'
    """
    return folder if text is None else folder / pointer_of(text, str(folder / POINTER)).champion


def warm(folder: Path, text: str | None, now_s: float) -> Path | None:
    """The folder of the champion before, while it is kept warm; else None."""
    if text is None:
        return None
    pointer = pointer_of(text, str(folder / POINTER))
    return folder / pointer.previous if pointer.previous is not None and pointer.is_warm(now_s) else None


def seconds(stamp: str) -> float:
    """s since 1970 of a UTC stamp.

    >>> seconds("1970-01-01T00:01:00Z")
    60.0
    """
    found = datetime.fromisoformat(stamp)
    return (found if found.tzinfo else found.replace(tzinfo=UTC)).timestamp()


def _version(value: Any, key: str, source: str) -> str:
    """A version names a folder beside the file, and nothing else."""
    is_name = isinstance(value, str) and 0 < len(value) <= VERSION_MAX and not value.startswith(".")
    if not is_name or set("/\\\0") & set(value):
        raise PointerError(f"{source}: {key} is {value!r:.80}; it has to name a folder beside it")
    return str(value)


def _stamp(value: Any, key: str, source: str) -> str:
    try:
        if value != "":
            seconds(value)
    except (TypeError, ValueError, OverflowError):
        raise PointerError(f"{source}: {key} is {value!r:.80}; it has to be a time, as 2026-11-22T00:10:00Z") from None
    return str(value)
