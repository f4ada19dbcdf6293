"""The envelope of the effect that the demo hides in its machine: closed until somebody reveals it."""

import json
from pathlib import Path
from typing import Any

from cnctwin.api.errors import ApiError
from cnctwin.files.sealed import SealError, read_sealed


class Envelope:
    """The file that the demo's machine has sealed its hidden effect in; None where nothing is hidden."""

    def __init__(self, file: Path | None) -> None:
        self._file = file
        self._open = False

    @property
    def is_given(self) -> bool:
        """Return True where the server was told of such a file."""
        return self._file is not None

    @property
    def exists(self) -> bool:
        """Return True where something is hidden."""
        return self._file is not None and self._file.exists()

    def shown(self) -> dict[str, Any] | None:
        """Return what may be seen of it; None where nothing is hidden. Raises ApiError where the file was changed."""
        if self._file is None or not self._file.exists():
            return None
        try:
            sealed = read_sealed(self._file)
        except SealError as error:
            raise ApiError(503, str(error)) from None
        told = {**json.loads(sealed.text), "salt": sealed.salt, "text": sealed.text} if self._open else None
        return {"sha256": sealed.seal.digest, "revealed": told}

    def open(self) -> None:
        """Reveal it from now on."""
        self._open = True
