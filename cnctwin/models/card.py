"""The card of a version: read from the manifest that its trainer wrote, whatever the kind, and from its files."""

import hashlib
import json
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from datetime import UTC, datetime
from importlib.metadata import version
from pathlib import Path
from typing import Any

from cnctwin.errors import UsageError

MANIFEST, CARD = "manifest.json", "card.json"
DIGITS = 12
MANIFEST_BYTES_MAX = 50_000_000
FEATURES_MAX = 500
KINDS = {
    "cnctwin anomaly model": "anomaly",
    "cnctwin tool-change detector": "detector",
    "cnctwin residual model": "residual",
}
"""The kind of a manifest → the kind that it is kept under."""


@dataclass(frozen=True, slots=True)
class Card:
    """A version.

    files: name → SHA-256; from_, to: of the data it was trained on, ISO 8601, or s of a run log; data_sha256: its hash, if told
    held_out: figures on data that was held out; added_at: when it was registered, "" where it never was
    """

    kind: str
    machine: str
    version: str
    files: Mapping[str, str]
    from_: str = ""
    to: str = ""
    data_sha256: str = ""
    source: tuple[str, ...] = ()
    code_version: str = ""
    features: tuple[str, ...] = ()
    seed: int | None = None
    held_out: Mapping[str, float] = field(default_factory=dict)
    added_at: str = ""

    def as_json(self) -> dict[str, Any]:
        """For a program to read."""
        told = asdict(self)
        return {name.rstrip("_"): value for name, value in told.items()}


def card_of(folder: Path, kind: str, machine: str) -> Card:
    """The card of a version's folder: what it registered as, with what its manifest says now. Raises UsageError."""
    manifest = manifest_of(folder)
    if (own := KINDS.get(str(manifest.get("kind")))) is not None and own != kind:
        raise UsageError(f"{folder}: its manifest says {manifest['kind']}, so it is kept under {own}, not {kind}")
    trained = _table(manifest.get("trained")) or _table(manifest.get("training"))
    kept = _read(folder / CARD) if (folder / CARD).exists() else {}
    return Card(
        kind=kind,
        machine=machine,
        version=folder.name,
        files=_table(kept.get("files")) or sums_of(folder),
        from_=_moment(trained, "from"),
        to=_moment(trained, "to"),
        data_sha256=str(trained.get("data_sha256") or kept.get("data_sha256") or ""),
        source=tuple(map(str, trained.get("source") or trained.get("runs") or ())),
        code_version=str(kept.get("code_version") or manifest.get("code_version") or _versions(trained)),
        features=tuple(map(str, manifest.get("features") or _table(manifest.get("detector")).get("features") or ()))[
            :FEATURES_MAX
        ],
        seed=_seed(manifest, trained),
        held_out=_numbers(manifest.get("held_out") or manifest.get("calibration") or trained),
        added_at=str(kept.get("added_at", "")),
    )


def registered(folder: Path, card: Card, at_s: float) -> None:
    """Write the card beside the model: checksum of every file, and when."""
    stamp = datetime.fromtimestamp(at_s, UTC).isoformat(timespec="seconds").replace("+00:00", "Z")
    code = f"cnctwin {version('cnctwin')}"
    told_code = ", ".join(dict.fromkeys(part for part in (code, card.code_version) if part))
    told = {"files": sums_of(folder), "code_version": told_code, "data_sha256": card.data_sha256, "added_at": stamp}
    try:
        (folder / CARD).write_text(json.dumps(told, indent=2) + "\n", encoding="utf-8")
    except OSError as error:
        raise UsageError(f"{folder / CARD}: cannot be written: {error.strerror}") from None


def faults_of(folder: Path) -> list[str]:
    """Return what is not as it was registered: files that are missing, more, or other than then."""
    if not (folder / CARD).exists():
        return []
    then, now = _table(_read(folder / CARD).get("files")), sums_of(folder)
    return [
        f"{name}: {'is missing' if name not in now else 'was not there' if name not in then else 'is not what it was'}"
        for name in sorted({*then, *now})
        if then.get(name) != now.get(name)
    ]


def sums_of(folder: Path) -> dict[str, str]:
    """SHA-256 of every file but the card."""
    try:
        files = sorted(path for path in folder.iterdir() if path.is_file() and path.name != CARD)
        return {path.name: hashlib.sha256(path.read_bytes()).hexdigest() for path in files}
    except OSError as error:
        raise UsageError(f"{folder}: cannot be read: {error.strerror}") from None


def manifest_of(folder: Path) -> dict[str, Any]:
    """Return the trainer's manifest. Raises UsageError where there is none."""
    if not (folder / MANIFEST).is_file():
        raise UsageError(f"{folder}: holds no {MANIFEST}; a model is a folder that a cnctwin train command wrote")
    return _read(folder / MANIFEST)


def version_of(folder: Path) -> str:
    """The first twelve digits of the SHA-256 of its manifest, in which the checksums of its arrays stand."""
    manifest_of(folder)
    return hashlib.sha256((folder / MANIFEST).read_bytes()).hexdigest()[:DIGITS]


def _read(path: Path) -> dict[str, Any]:
    try:
        if path.stat().st_size > MANIFEST_BYTES_MAX:
            raise UsageError(f"{path}: is larger than {MANIFEST_BYTES_MAX // 1_000_000} MB; no manifest is")
        found = json.loads(path.read_bytes())
    except OSError as error:
        raise UsageError(f"{path}: cannot be read: {error.strerror}") from None
    except (ValueError, RecursionError) as error:
        raise UsageError(f"{path}: is not JSON: {error}") from None
    return _table(found)


def _table(value: Any) -> dict[str, Any]:
    return value if isinstance(value, dict) else {}


def _moment(trained: Mapping[str, Any], side: str) -> str:
    """As ISO 8601 where it counts from 1970, else as seconds of a run."""
    value = trained.get(side, trained.get(f"{side}_ms", trained.get(f"{side}_s")))
    if not isinstance(value, (int, float)):
        return str(value or "")
    seconds = value / 1000.0 if side not in trained and f"{side}_ms" in trained else float(value)
    if seconds < 1e9:
        return f"{seconds:g} s"
    return datetime.fromtimestamp(seconds, UTC).isoformat(timespec="seconds").replace("+00:00", "Z")


def _versions(trained: Mapping[str, Any]) -> str:
    return ", ".join(f"{name} {version}" for name, version in _table(trained.get("versions")).items())


def _seed(*tables: Mapping[str, Any]) -> int | None:
    found = next((table["seed"] for table in tables if isinstance(table.get("seed"), int)), None)
    return None if found is None else int(found)


def _numbers(value: Any) -> dict[str, float]:
    """All numbers of a table, those of tables in it by a dotted name."""
    found: dict[str, float] = {}
    for name, one in _table(value).items():
        if isinstance(one, (int, float)) and not isinstance(one, bool):
            found[str(name)] = float(one)
        elif isinstance(one, dict):
            found |= {f"{name}.{key}": number for key, number in _numbers(one).items()}
    return found
