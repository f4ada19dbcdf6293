"""Users of the page: a TOML file of mode 600 with a table for each, its role, and its token.

[ada]
role = "operator"
token = "…"        # openssl rand -hex 24; without one ada comes through the proxy only
"""

import os
import re
import stat
import tomllib
from dataclasses import dataclass, field
from pathlib import Path
from typing import Literal

from pydantic import BaseModel, ConfigDict, Field, RootModel, ValidationError

from cnctwin.api.door.role import Role
from cnctwin.errors import UsageError
from twin.vocabulary.faults import faults_of, report

TOKEN_CHARACTERS_MIN = 16
USERS_MAX = 1000
FILE_BYTES_MAX = 1_000_000
_NAME = re.compile(r"[A-Za-z0-9][A-Za-z0-9._@-]{0,59}")
_PRIVATE = 0o077


@dataclass(frozen=True, slots=True)
class User:
    """A person or a program. The token appears in no `repr`."""

    name: str
    role: Role
    token: str | None = field(default=None, repr=False)


class _Entry(BaseModel):
    model_config = ConfigDict(extra="forbid", hide_input_in_errors=True)
    role: Literal["reader", "operator", "administrator"]
    token: str | None = Field(None, min_length=TOKEN_CHARACTERS_MIN, max_length=1000, repr=False)


class _Entries(RootModel[dict[str, _Entry]]):
    model_config = ConfigDict(hide_input_in_errors=True)


def read_users(path: Path) -> tuple[User, ...]:
    """Return the users of a file that only its owner can use. Raises UsageError, without repeating a token."""
    try:
        told = tomllib.loads(private_text(path, "--users"))
    except tomllib.TOMLDecodeError as error:
        place = re.search(r"line \d+", str(error))
        raise UsageError(f"--users {path}: {place[0] if place else 'the end'} is no TOML; see docs/reference/api.md") from None
    if len(told) > USERS_MAX:
        raise UsageError(f"--users {path} has {len(told)} users; {USERS_MAX} are the limit")
    try:
        entries = _Entries.model_validate(told).root
    except ValidationError as error:
        faults = [dict(fault) for fault in error.errors(include_input=False, include_url=False)]
        raise UsageError(report(f"--users {path}", faults_of(faults, _Entries, shown=None), "docs/reference/api.md")) from None
    users = tuple(User(name, Role[one.role.upper()], one.token) for name, one in entries.items())
    for user in users:
        if not _NAME.fullmatch(user.name):
            raise UsageError(f"--users {path}: {user.name[:60]!r} is no name; 1 to 60 letters, digits, '.', '_', '@' and '-'")
        if user.token is not None and sum(one.token == user.token for one in users) > 1:
            raise UsageError(f"--users {path}: {user.name} has the token of another user; give each its own")
    return users


def private_text(path: Path, option: str) -> str:
    """Return the text of a file that only its owner can use. Raises UsageError, without repeating what stands in it."""
    try:
        with path.open("rb") as file:
            mode = stat.S_IMODE(os.fstat(file.fileno()).st_mode)
            text = file.read(FILE_BYTES_MAX).decode("utf-8").strip()
    except (OSError, UnicodeDecodeError) as error:
        raise UsageError(f"{option} {path}: {getattr(error, 'strerror', None) or 'no text'}; give a readable file") from None
    if mode & _PRIVATE:
        raise UsageError(f"{option} {path} has mode {mode:o}; chmod 600 it, so that only its owner can read it")
    return text
