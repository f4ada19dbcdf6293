"""A trained model in a folder: `manifest.json`, for people too, and `arrays.npz`, whose checksum stands in it. No pickle.

A folder is written beside its place and moved into it whole, so that a reader sees all of it or none.
"""

import hashlib
import io
import json
import shutil
import tempfile
import zipfile
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from twin.forest.errors import ForestError

MANIFEST, ARRAYS = "manifest.json", "arrays.npz"
BYTES_MAX = 2**30
Arrays = Mapping[str, NDArray[Any]]


def packed(arrays: Arrays) -> bytes:
    """The arrays as a compressed .npz; the same arrays give the same bytes."""
    file = io.BytesIO()
    np.savez_compressed(file, allow_pickle=False, **arrays)
    return file.getvalue()


def unpacked(data: bytes, source: str) -> dict[str, NDArray[Any]]:
    """The arrays of an .npz. Raises ForestError where it is none."""
    try:
        with np.load(io.BytesIO(data), allow_pickle=False) as file:
            if (size := sum(member.file_size for member in file.zip.infolist())) > BYTES_MAX:  # before it is unpacked
                raise ForestError(f"{source}: unpacks to {size} bytes; {BYTES_MAX} are read: it is no forest")
            return {name: file[name] for name in file.files}
    except (OSError, ValueError, EOFError, KeyError, zipfile.BadZipFile, zipfile.LargeZipFile) as error:
        raise ForestError(f"{source}: not arrays without pickled objects: {error}") from None


def digest(data: bytes) -> str:
    """SHA-256, in hexadecimal."""
    return hashlib.sha256(data).hexdigest()


def manifest_text(manifest: Mapping[str, Any]) -> str:
    """The manifest as it is written. Raises ValueError where it holds a figure that is not finite."""
    return json.dumps(manifest, indent=2, ensure_ascii=False, allow_nan=False) + "\n"


def write_folder(folder: Path, files: Mapping[str, bytes]) -> None:
    """Writes the files into a new folder, in one move; an older folder of that name is replaced.

    Raises ForestError where it cannot be written.
    """
    try:
        folder.parent.mkdir(parents=True, exist_ok=True)
        part = Path(tempfile.mkdtemp(prefix=f".{folder.name}.", dir=folder.parent))
        try:
            for name, data in files.items():
                (part / name).write_bytes(data)
            part.chmod(0o750)
            if folder.exists():
                shutil.rmtree(folder)
            part.rename(folder)
        finally:
            shutil.rmtree(part, ignore_errors=True)
    except OSError as error:
        raise ForestError(f"{folder}: cannot be written: {error.strerror}") from None


def read_file(path: Path) -> bytes:
    """The file's bytes. Raises ForestError where it is missing or larger than `BYTES_MAX`."""
    try:
        if path.stat().st_size > BYTES_MAX:
            raise ForestError(f"{path}: is larger than {BYTES_MAX >> 20} MB; no model is")
        return path.read_bytes()
    except OSError as error:
        raise ForestError(f"{path}: cannot be read as a part of a model: {error.strerror}") from None


def read_manifest(folder: Path, kind: str, version: int) -> dict[str, Any]:
    """The manifest of a folder. Raises ForestError where it is none of this kind and version."""
    path = folder / MANIFEST
    try:
        manifest = json.loads(read_file(path))
    except ValueError as error:
        raise error if isinstance(error, ForestError) else ForestError(f"{path}: is not JSON: {error}") from None
    if not isinstance(manifest, dict) or manifest.get("kind") != kind:
        found = manifest.get("kind") if isinstance(manifest, dict) else None
        raise ForestError(f"{path}: kind is {found!r}; it has to be {kind!r}")
    if manifest.get("version") != version:
        raise ForestError(f"{path}: version {manifest.get('version')!r} of the format; this cnctwin reads {version}: train again")
    return manifest


def read_arrays(path: Path, sha256: str) -> dict[str, NDArray[Any]]:
    """The arrays of a file whose checksum is this. Raises ForestError where it is another."""
    data = read_file(path)
    if digest(data) != sha256:
        raise ForestError(f"{path}: its SHA-256 is {digest(data)[:12]}…, the manifest says {sha256[:12]}…: copy the model again")
    return unpacked(data, str(path))
