"""Folders whose entries outlive the loss of power: a file that was forced to the disk is gone with an entry that was not."""

import os
from pathlib import Path


def make_folder(folder: Path) -> None:
    """Make a folder with those above it that are missing, each forced to the disk. Raises OSError."""
    missing = [folder, *folder.parents]
    while missing and missing[-1].exists():
        missing.pop()
    folder.mkdir(parents=True, exist_ok=True)
    for made in missing:
        sync(made.parent)


def sync(path: Path) -> None:
    """Force a file to the disk, or the entries of a folder: what was made, renamed or removed in it. Raises OSError."""
    descriptor = os.open(path, os.O_RDONLY)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)
