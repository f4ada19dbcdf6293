"""The golden week of a machine: a stretch of data that was frozen by its hash, the standing test of every challenger.

    <shelf>/golden/<first digits of the hash>.parquet, and golden.json: {file, sha256, from, to, source, frozen_at}

Freezing another one keeps the files of those before, and says which hash counts now.
"""

import hashlib
import json
import tempfile
from collections.abc import Mapping
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from cnctwin.errors import UsageError
from cnctwin.models.registry import GOLDEN, Shelf, write_whole
from twin.runlog import RunLog, read_run, write_run

MANIFEST, DIGITS = "golden.json", 12


def freeze(own: Shelf, log: RunLog, source: str, at_s: float) -> dict[str, Any]:
    """Freeze a stretch; what was written down of it."""
    folder = own.folder / GOLDEN
    folder.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory(prefix=".golden.", dir=folder) as aside:
        part = Path(aside) / "week.parquet"
        write_run(log, part)
        sha256 = hashlib.sha256(part.read_bytes()).hexdigest()
        name = f"{sha256[:DIGITS]}.parquet"
        part.replace(folder / name)
    told = {
        "file": name,
        "sha256": sha256,
        "from_s": float(log.t_s[0]),
        "to_s": float(log.t_s[-1]),
        "rows": len(log),
        "source": source,
        "frozen_at": datetime.fromtimestamp(at_s, UTC).isoformat(timespec="seconds"),
    }
    write_whole(folder / MANIFEST, json.dumps(told, indent=2) + "\n")
    return told


def golden_of(own: Shelf) -> tuple[RunLog, Mapping[str, Any]] | None:
    """The frozen stretch; None where there is none. Raises UsageError where it is not what was frozen."""
    path = own.folder / GOLDEN / MANIFEST
    try:
        told = json.loads(path.read_bytes())
        data = path.with_name(Path(str(told["file"])).name)
        sha256 = hashlib.sha256(data.read_bytes()).hexdigest()
    except FileNotFoundError as error:
        if not path.exists():
            return None
        raise UsageError(f"{error.filename}: the golden week is gone; freeze one with cnctwin model golden") from None
    except (OSError, ValueError, KeyError, TypeError) as error:
        raise UsageError(f"{path}: cannot be read: {error}") from None
    if sha256 != told.get("sha256"):
        raise UsageError(f"{data}: is not what was frozen (SHA-256 {sha256[:DIGITS]}…): it is no test any more; freeze one again")
    return read_run(data), told
