"""The files that a set-up is about to write: shown as a diff first, then written all or none."""

import difflib
import os
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from tempfile import NamedTemporaryFile

from cnctwin.errors import UsageError

PUBLIC, SECRET = 0o640, 0o600
SECRET_FOLDER = 0o700


@dataclass(frozen=True, slots=True)
class PlannedFile:
    """One file. before: its text as it is, None where it is new; is_secret: never shown, and its owner's alone."""

    path: Path
    text: str
    before: str | None
    is_secret: bool = False

    @property
    def changes(self) -> bool:
        """True where it is to be written."""
        return self.text != self.before

    def shown(self, root: Path) -> Iterator[str]:
        """Yield what is about to change, in lines for a person."""
        name = self.path.relative_to(root)
        if self.is_secret:
            yield f"{'new' if self.before is None else 'changes'}: {name} (mode 600; not shown)"
        elif self.before is None:
            yield f"new: {name}"
        else:
            lines = difflib.unified_diff(self.before.splitlines(), self.text.splitlines(), str(name), str(name), lineterm="", n=1)
            yield from lines


def write_all(files: Sequence[PlannedFile]) -> None:
    """Write the files that change. What can fail is done under temporary names first. Raises UsageError."""
    ready: list[tuple[Path, Path]] = []
    try:
        for file in files:
            if not file.changes:
                continue
            file.path.parent.mkdir(parents=True, exist_ok=True)
            if file.is_secret:
                file.path.parent.chmod(SECRET_FOLDER)
            with NamedTemporaryFile("w", encoding="utf-8", dir=file.path.parent, prefix=".init-", delete=False) as fresh:
                ready.append((Path(fresh.name), file.path))
                os.fchmod(fresh.fileno(), SECRET if file.is_secret else PUBLIC)
                fresh.write(file.text)
        for fresh_path, path in ready:
            fresh_path.replace(path)
    except OSError as error:
        raise UsageError(f"{error.filename}: cannot be written: {error.strerror or error}") from None
    finally:
        for fresh_path, _ in ready:
            fresh_path.unlink(missing_ok=True)
