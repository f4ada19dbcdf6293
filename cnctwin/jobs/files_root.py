"""The folder below which files that a request names have to lie: whoever may write to a topic is not to read the whole disk."""

import tomllib
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from cnctwin.errors import UsageError
from cnctwin.files.program_text import decoded

TEXT_BYTES_MAX = 20_000_000
TOML_BYTES_MAX = 1_000_000


@dataclass(frozen=True, slots=True)
class FilesRoot:
    """folder: None = no request may name a file. Each method raises UsageError that names the key and the value."""

    folder: Path | None = None

    def file(self, name: str, key: str) -> Path:
        """The file of that name, links followed."""
        path = self._inside(name, key)
        if not path.is_file():
            raise UsageError(f"{key} = {name!r}: there is no such file below the consumer's files folder")
        return path

    def text(self, name: str, key: str, bytes_max: int = TEXT_BYTES_MAX) -> str:
        """Return the text of the file."""
        return self.encoded_text(name, key, bytes_max)[0]

    def encoded_text(self, name: str, key: str, bytes_max: int = TEXT_BYTES_MAX) -> tuple[str, str]:
        """Return the text of the file and its encoding."""
        path = self.file(name, key)
        try:
            with path.open("rb") as source:
                raw = source.read(bytes_max + 1)
        except OSError as error:
            raise UsageError(f"{key} = {name!r}: cannot be read: {error.strerror}") from None
        if len(raw) > bytes_max:
            raise UsageError(f"{key} = {name!r}: has more than {bytes_max:,} bytes")
        return decoded(raw)

    def case(self, name: str, key: str) -> tuple[Path, str]:
        """A case folder all of whose files lie below the root too, and the text of its machine.toml."""
        folder = self._inside(name, key)
        if not (folder / "case.toml").is_file():
            raise UsageError(f"{key} = {name!r}: is no folder with a case.toml below the consumer's files folder")
        told = _toml(self.text(f"{name}/case.toml", key), f"{key} = {name!r}: case.toml")
        for named in _named(told):
            self._inside(str(Path(name) / named), f"{key} = {name!r}: its case.toml")
        machine = _text(_table(told, "case"), "machine")
        return folder, self.text(str(Path(name) / machine), f"{key} = {name!r}: case.machine", TOML_BYTES_MAX)

    def shown(self, text: str) -> str:
        """A text with the root left out of its paths: where it lies is nobody's business on the broker."""
        roots = () if self.folder is None else (self.folder.resolve(), self.folder)
        for root in roots:
            text = text.replace(f"{root}/", "")
        return text

    def _inside(self, name: str, key: str) -> Path:
        if self.folder is None:
            raise UsageError(f"{key} = {name!r}: this consumer knows no files; start it with --files DIR, or send texts")
        root = self.folder.resolve()
        try:
            path = (root / name).resolve()
        except (OSError, ValueError, RuntimeError) as error:  # a zero byte, a ring of links
            raise UsageError(f"{key} = {name!r}: is no file name: {error}") from None
        if Path(name).is_absolute() or not path.is_relative_to(root):
            raise UsageError(f"{key} = {name!r}: leads out of the consumer's files folder; name a file below it")
        return path


def machine_name(toml: str, key: str) -> str:
    """The name that a machine.toml states; empty where it states none. Raises UsageError where it is not TOML.

    >>> machine_name("[machine]\\nname = 'vmc'", "machine_toml")
    'vmc'
    """
    return _text(_table(_toml(toml, key), "machine"), "name")


def _named(case: dict[str, Any]) -> list[str]:
    """All files that a case.toml names."""
    runs = case.get("runs")
    tables = [one for one in runs if isinstance(one, dict)] if isinstance(runs, list) else []
    named = [_text(one, key) for one in tables for key in ("file", "repeats", "program")]
    return [name for name in (_text(_table(case, "case"), "machine"), *named) if name]


def _toml(text: str, where: str) -> dict[str, Any]:
    try:
        return tomllib.loads(text)
    except (tomllib.TOMLDecodeError, RecursionError) as error:
        raise UsageError(f"{where}: is not TOML: {error}") from None


def _table(document: dict[str, Any], key: str) -> dict[str, Any]:
    found = document.get(key)
    return found if isinstance(found, dict) else {}


def _text(table: dict[str, Any], key: str) -> str:
    found = table.get(key)
    return found if isinstance(found, str) else ""
