"""Secrets taken out of what is given to somebody else: configuration, logs, reports.

A value is taken out where its key is a secret's, where it stands below a table of receivers, where it looks like a token, and
where it is in an address. What was taken out once is taken out everywhere. What names the place of a secret (`$NAME`,
`file:/path`) stays.
"""

import re
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from sparkplug.shown_address import shown_address

BLANK = "…"
SECRET_CHARACTERS_MIN = 4
SECRET_BYTES_MAX = 4096
_WORD = "pass(?:word|wd|phrase)?|pwd|secret|token|credential|api[_-]?key|private[_-]?key|auth(?:orization)?|bearer|salt|cookie"
_KEY = re.compile(rf"(?:^|[_\-.])(?:{_WORD}|pin|key|user(?:name)?|login)s?(?:$|[_\-.])", re.I)
_IN_TEXT = re.compile(rf"""((?:{_WORD})["']?\s*[=:]\s*)(?:(?:bearer|basic|digest)\s+)?("[^"]*"|'[^']*'|[^\s,;]+)""", re.I)
_SCHEME = re.compile(r"\b(bearer|basic)\s+[A-Za-z0-9._~+/=-]{8,}", re.I)
_PEM = re.compile(r"-----BEGIN [A-Z ]*-----.*?(?:-----END [A-Z ]*-----|\Z)", re.S)
_TOKEN = re.compile(r"(?=[A-Za-z0-9_+/=-]*\d)(?=[A-Za-z0-9_+/=-]*[A-Za-z])[A-Za-z0-9_+/=-]{20,}")
_MAIL = re.compile(r"[\w.+-]+@(?=[\w-]+\.[\w.-]+)")
_IN_ADDRESS = re.compile(r"//[^/@:\s]*:(\S*)@|[?&#][^=&\s]*=([^&#\s]+)")
_PLACE = re.compile(r"\$\w+|file:.*")
_SECRET_TABLES = ("receivers", "heartbeat")
_HARMLESS = ("type", "language")


@dataclass(slots=True)
class Blanks:
    """The secrets that were taken out, which are written nowhere, and the keys that had them."""

    secrets: set[str] = field(default_factory=set)
    keys: set[str] = field(default_factory=set)

    def add(self, secret: str) -> None:
        """Have this taken out of every text from now on."""
        if len(secret) >= SECRET_CHARACTERS_MIN:
            self.secrets.add(secret)

    def of_environment(self, environment: Mapping[str, str]) -> None:
        """Have what variables of secrets hold taken out."""
        for name, value in environment.items():
            if _KEY.search(name):
                self.add(value)

    def table(self, value: Any, place: tuple[str, ...] = ()) -> Any:
        """Return a table of a configuration without its secrets.

        >>> Blanks().table({"broker": {"url": "mqtt://a:b@host:1883", "password_env": "PW"}, "ada": {"token": "0123"}})
        {'broker': {'url': 'mqtt://a:…@host:1883', 'password_env': 'PW'}, 'ada': {'token': '…'}}
        """
        if isinstance(value, Mapping):
            return {str(key): self.table(inner, (*place, str(key))) for key, inner in value.items()}
        if isinstance(value, list):
            return [self.table(inner, place) for inner in value]
        key = place[-1] if place else ""
        if isinstance(value, str) and _PLACE.fullmatch(value.strip()):
            self._read(Path(value.strip().removeprefix("file:")))
            return value
        if isinstance(value, str) and key.endswith("_file"):
            self._read(Path(value))
            return value
        is_secret = bool(_KEY.search(key)) and not key.endswith("_env") and not isinstance(value, bool)
        is_secret |= isinstance(value, str) and key not in _HARMLESS and any(table in place[:-1] for table in _SECRET_TABLES)
        if is_secret:
            self.add(str(value))
            self.keys.add(".".join(place))
            return BLANK
        if not isinstance(value, str):
            return value if isinstance(value, bool | int | float | None) else str(value)
        if "://" in value:
            for secret in _IN_ADDRESS.findall(value):
                self.add("".join(secret))
        return self.text(value)

    def texts(self, value: Any) -> Any:
        """Return a JSON value with every text in it as `text` returns it."""
        if isinstance(value, Mapping):
            return {str(key): self.texts(inner) for key, inner in value.items()}
        if isinstance(value, list | tuple):
            return [self.texts(inner) for inner in value]
        return self.text(value) if isinstance(value, str) else value

    def text(self, text: str) -> str:
        """Return a text without the secrets known so far, without those in addresses, and without what looks like one.

        >>> Blanks({"hunter2"}).text("login hunter2, token=abc; http://u:p@h/x?y=z Authorization: Bearer abcdefgh12")
        'login …, token=…; http://u:…@h/x?y=… Authorization: …'
        """
        text = _PEM.sub(BLANK, text)
        for secret in sorted(self.secrets, key=len, reverse=True):
            text = text.replace(secret, BLANK)
        text = _SCHEME.sub(rf"\1 {BLANK}", _IN_TEXT.sub(rf"\1{BLANK}", text))
        text = "\n".join(shown_address(line) for line in text.split("\n"))
        return _MAIL.sub(f"{BLANK}@", _TOKEN.sub(BLANK, text))

    def _read(self, file: Path) -> None:
        """Have what is in a secret's file taken out too, line by line: it is read for that alone."""
        try:
            if file.is_file() and file.stat().st_size <= SECRET_BYTES_MAX:
                for line in file.read_text(encoding="utf-8").split():
                    self.add(line)
        except (OSError, UnicodeDecodeError):
            return
