"""The folders of models: <models>/<machine>/<first 12 digits of its SHA-256>/, and `current`, a link to the one that scores.

A model never changes; to promote another, or to go back, is to turn the link, which is done in one move.
"""

import os
import tempfile
from pathlib import Path

from twin.anomaly.errors import ModelError
from twin.anomaly.golden import GoldenWeek
from twin.anomaly.model import CURRENT, AnomalyModel, files_of
from twin.forest.artefact import MANIFEST, digest, write_folder
from twin.forest.errors import ForestError

DIGITS = 12
NAME_MAX = 200


def stored(model: AnomalyModel, models: Path, machine: str, golden: GoldenWeek | None = None) -> Path:
    """The folder in which the model now stands, beside those before it; not yet the current one. Raises ModelError."""
    files = files_of(model, golden)
    folder = _of_machine(models, machine) / digest(files[MANIFEST])[:DIGITS]
    if not (folder / MANIFEST).exists():
        try:
            write_folder(folder, files)
        except ForestError as error:
            raise ModelError(str(error)) from None
    return folder


def promote(models: Path, machine: str, version: str) -> str | None:
    """Makes a version (its 12 digits, or the first few of them) the current one; which was it before.

    Raises ModelError where there is none, or more than one begins so.
    """
    folder = _of_machine(models, machine)
    found = [name for name in versions_of(models, machine) if name.startswith(version)] if version else []
    if len(found) != 1:
        there = ", ".join(versions_of(models, machine)) or "none"
        raise ModelError(f"{machine}: {len(found)} models begin with {version!r}; there are {there}")
    before = current_of(models, machine)
    try:
        with tempfile.TemporaryDirectory(prefix=".link.", dir=folder) as aside:
            link = Path(aside) / CURRENT
            link.symlink_to(found[0], target_is_directory=True)
            os.replace(link, folder / CURRENT)  # noqa: PTH105  Path.replace would do the same
    except OSError as error:
        raise ModelError(f"{folder / CURRENT}: cannot be turned: {error.strerror}") from None
    return before


def current_of(models: Path, machine: str) -> str | None:
    """The version that scores; None where none does."""
    link = _of_machine(models, machine) / CURRENT
    return link.resolve().name if link.is_symlink() else None


def versions_of(models: Path, machine: str) -> tuple[str, ...]:
    """All versions of a machine's model, the newest last."""
    found = [path.parent for path in _of_machine(models, machine).glob(f"*/{MANIFEST}") if path.parent.name != CURRENT]
    return tuple(path.name for path in sorted(found, key=lambda path: (path.stat().st_mtime_ns, path.name)))


def _of_machine(models: Path, machine: str) -> Path:
    if not machine or len(machine) > NAME_MAX or machine.startswith(".") or set("/\\\0") & set(machine):
        raise ModelError(f"{machine!r} cannot name a folder: a machine's name has no slash and begins with no dot")
    return models / machine
