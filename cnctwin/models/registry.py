"""The registry's folders:

    <models>/<kind>/<machine>/<version>/       what a trainer wrote (manifest.json, arrays); card.json: checksums, when it came
    <models>/<kind>/<machine>/current.json     which version counts (twin/models/pointer.py)
    <models>/<kind>/<machine>/current          a link to the same, for whatever reads a link
    <models>/<kind>/<machine>/golden/          the golden week (cnctwin/models/golden.py)
    <models>/<kind>/<machine>/comparisons.jsonl

A version never changes. To promote, or to go back, is to write the pointer, in one move. Where somebody turned the link without
us (`cnctwin train promote` does), the link is right, since that is what scores, and the pointer follows at the next command. So
the folder `<models>/anomaly` is what `cnctwin train anomaly --out` writes, and `models` of the processor may name it.
"""

import json
import os
import shutil
import tempfile
from collections.abc import Mapping
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from cnctwin.errors import UsageError
from cnctwin.files.modes import PRODUCT_FILE, PRODUCT_FOLDER
from cnctwin.models.card import CARD, MANIFEST, Card, card_of, faults_of, registered, version_of
from twin.models.errors import PointerError
from twin.models.pointer import LINK, POINTER, Pointer, pointer_of, warm

GOLDEN, COMPARISONS = "golden", "comparisons.jsonl"
WARM_S = 48 * 3600.0
COMPARISONS_MAX = 200
NAME_MAX = 200


@dataclass(frozen=True, slots=True)
class Shelf:
    """All versions of one kind of one machine."""

    models: Path
    kind: str
    machine: str

    @property
    def folder(self) -> Path:
        """The folder of the versions."""
        return self.models / self.kind / self.machine

    def versions(self) -> tuple[str, ...]:
        """The newest last."""
        found = [path.parent for path in self.folder.glob(f"*/{MANIFEST}") if path.parent.name not in (LINK, GOLDEN)]
        return tuple(path.name for path in sorted(found, key=lambda path: ((path / MANIFEST).stat().st_mtime_ns, path.name)))

    def named(self, version: str) -> Path:
        """The folder of a version, by its first digits. Raises UsageError where none or several begin so."""
        found = [name for name in self.versions() if version and name.startswith(version)]
        if len(found) != 1:
            there = ", ".join(self.versions()) or "none"
            raise UsageError(f"{self.kind} of {self.machine}: {len(found)} versions begin with {version!r}; there are {there}")
        return self.folder / found[0]

    def card(self, version: str) -> Card:
        """Return the card of a version."""
        return card_of(self.folder / version, self.kind, self.machine)

    def pointer(self) -> Pointer | None:
        """Return the version that counts; None where none does. The link is right where it says otherwise."""
        try:
            text = (self.folder / POINTER).read_text(encoding="utf-8")
            told: Pointer | None = pointer_of(text, str(self.folder / POINTER))
        except FileNotFoundError:
            told = None
        except (OSError, UnicodeDecodeError, PointerError) as error:
            raise UsageError(f"{error}; cnctwin model promote writes it again") from None
        link = self.folder / LINK
        linked = Path(os.readlink(link)).name if link.is_symlink() else None  # noqa: PTH115  its text, whatever is there
        if linked is None or (told is not None and told.champion == linked):
            return told
        at_s = link.lstat().st_mtime
        before = None if told is None else told.champion
        return Pointer(linked, before, _iso(at_s), _iso(at_s + WARM_S) if before else "", "the link was turned")

    def warm(self, now_s: float) -> Path | None:
        """The champion before, while it is kept warm."""
        pointer = self.pointer()
        return None if pointer is None else warm(self.folder, pointer.text, now_s)


def shelf(models: Path, kind: str, machine: str) -> Shelf:
    """Checked: both name a folder. Raises UsageError."""
    for what, name in (("kind", kind), ("machine", machine)):
        if not name or len(name) > NAME_MAX or name.startswith(".") or set("/\\\0") & set(name):
            raise UsageError(f"{what} {name!r} cannot name a folder: it has no slash and begins with no dot")
    return Shelf(models, kind, machine)


def shelves(models: Path) -> list[Shelf]:
    """All there are, by kind and machine."""
    if not models.is_dir():
        raise UsageError(f"{models}: there is no such folder with models; cnctwin model add makes one")
    found = {path.parent.parent for path in models.glob(f"*/*/*/{MANIFEST}") if path.parent.name != LINK}
    return [Shelf(models, path.parent.name, path.name) for path in sorted(found)]


def add(models: Path, kind: str, machine: str, folder: Path, at_s: float) -> str:
    """Put a trained model into the registry; its version. The first one of a machine is promoted at once. Raises UsageError."""
    own = shelf(models, kind, machine)
    card_of(folder, kind, machine)
    version = version_of(folder)
    place = own.folder / version
    if not (place / MANIFEST).exists():
        _copied(folder, place)
    if not (place / CARD).exists():
        registered(place, card_of(place, kind, machine), at_s)
    if own.pointer() is None:
        promoted(own, version, "the first one", at_s)
    return version


def promoted(own: Shelf, version: str, reason: str, at_s: float) -> Pointer:
    """Let a version count; the one before is kept warm for two days. Raises UsageError where its files are not what they were."""
    folder = own.named(version)
    if faults := faults_of(folder):
        raise UsageError(f"{folder}: {'; '.join(faults)}: copy the model again")
    card = card_of(folder, own.kind, own.machine)
    before = _told(own)
    if before is not None and before.champion == folder.name:
        raise UsageError(f"{own.kind} of {own.machine}: {folder.name} is the champion already")
    if not (folder / CARD).exists():
        registered(folder, card, at_s)
    previous = None if before is None else before.champion
    pointer = Pointer(folder.name, previous, _iso(at_s), _iso(at_s + WARM_S) if previous else "", reason)
    _linked(own.folder, folder.name)
    write_whole(own.folder / POINTER, pointer.text)
    return pointer


def rolled_back(own: Shelf, reason: str, at_s: float) -> Pointer:
    """Let the champion before count again. Raises UsageError where there is none, or it is gone."""
    pointer = own.pointer()
    if pointer is None or pointer.previous is None:
        raise UsageError(f"{own.kind} of {own.machine}: there was no champion before; cnctwin model promote names one")
    return promoted(own, pointer.previous, reason, at_s)


def pruned(own: Shelf, keep: int, now_s: float) -> list[str]:
    """Delete versions but the newest `keep`; never the champion, nor one that is warm, nor the golden week."""
    pointer = own.pointer()
    spared = set() if pointer is None else {pointer.champion}
    if (beside := own.warm(now_s)) is not None:
        spared.add(beside.name)
    versions = own.versions()
    gone = [version for version in versions[: max(0, len(versions) - keep)] if version not in spared]
    for version in gone:
        try:
            shutil.rmtree(own.folder / version)
        except OSError as error:
            raise UsageError(f"{own.folder / version}: cannot be deleted: {error.strerror}") from None
    return gone


def keep_comparison(own: Shelf, told: Mapping[str, Any]) -> None:
    """Write down what a comparison gave: the newest COMPARISONS_MAX."""
    lines = [*comparisons(own), dict(told)][-COMPARISONS_MAX:]
    write_whole(own.folder / COMPARISONS, "".join(f"{json.dumps(line, allow_nan=False)}\n" for line in lines))


def comparisons(own: Shelf) -> list[dict[str, Any]]:
    """Return the comparisons, oldest first."""
    try:
        lines = (own.folder / COMPARISONS).read_text(encoding="utf-8").splitlines()
        return [one for line in lines if isinstance(one := json.loads(line), dict)]
    except FileNotFoundError:
        return []
    except (OSError, ValueError) as error:
        raise UsageError(f"{own.folder / COMPARISONS}: cannot be read: {error}") from None


def write_whole(path: Path, text: str) -> None:
    """Write a file in one move, so that a reader sees the old one or the new one. Raises UsageError."""
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        with tempfile.NamedTemporaryFile("w", encoding="utf-8", dir=path.parent, prefix=f".{path.name}.", delete=False) as file:
            file.write(text)
            file.flush()
            os.fsync(file.fileno())
        Path(file.name).chmod(PRODUCT_FILE)
        os.replace(file.name, path)  # noqa: PTH105  Path.replace would do the same
    except OSError as error:
        raise UsageError(f"{path}: cannot be written: {error.strerror}") from None


def _told(own: Shelf) -> Pointer | None:
    """The pointer; a damaged one is none, since promoting is the way out of that."""
    try:
        return own.pointer()
    except UsageError:
        return None


def _linked(folder: Path, version: str) -> None:
    try:
        with tempfile.TemporaryDirectory(prefix=".link.", dir=folder) as aside:
            link = Path(aside) / LINK
            link.symlink_to(version, target_is_directory=True)
            os.replace(link, folder / LINK)  # noqa: PTH105  Path.replace would do the same
    except OSError as error:
        raise UsageError(f"{folder / LINK}: cannot be turned: {error.strerror}") from None


def _copied(source: Path, place: Path) -> None:
    """Beside its place first, and moved there whole."""
    try:
        place.parent.mkdir(parents=True, exist_ok=True)
        part = Path(tempfile.mkdtemp(prefix=".model.", dir=place.parent))
        try:
            for path in sorted(source.iterdir()):
                if path.is_file() and path.name != CARD:
                    shutil.copyfile(path, part / path.name)
            part.chmod(PRODUCT_FOLDER)
            part.rename(place)
        finally:
            shutil.rmtree(part, ignore_errors=True)
    except OSError as error:
        raise UsageError(f"{place}: cannot be written: {error.strerror or error}") from None


def _iso(at_s: float) -> str:
    return datetime.fromtimestamp(at_s, UTC).isoformat(timespec="seconds").replace("+00:00", "Z")
