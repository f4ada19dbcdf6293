"""A bundle for a report of a fault: what runs here and how it is configured, without secrets, in one zip file.

README.txt              what is in it, and what was taken out
versions.json           cnctwin, Python, system, the packages that it uses
doctor.json             what `cnctwin doctor` found
configuration/…json     each configuration file as a table, without comments and secrets
logs/…                  the end of each log
"""

import json
import os
import platform
import sys
import tomllib
import zipfile
from collections.abc import Iterator, Mapping, Sequence
from importlib import metadata
from pathlib import Path
from typing import Any

from cnctwin.errors import UsageError
from cnctwin.plant.blanked import BLANK, Blanks

FILES_MAX = 200
CONFIGURATION_BYTES_MAX = 1_000_000
LOG_BYTES_MAX = 200_000
LOGS = (".log", ".jsonl")
LOGS_FOLDER = "logs/"
NO_LOGS = "none found; run this in the plant's folder, where `cnctwin up` keeps state/logs, or name them with --include"
DEFAULT = ("processors.toml", "edges", "machines", "logs", "state/logs")
"""Files and folders that are taken of the current folder where none is named; `cnctwin up` logs into the last one."""
README = """A bundle of `cnctwin doctor --bundle`, for a report of a fault.

Secrets are taken out: {blank} stands where one was. Names of machines, hosts and signals are still in it, and so may be
what a person typed into a name. Look through it before you send it.

Taken out by key: {keys}
Not read: {unread}
Logs: {logs}
"""


def write_bundle(
    out: Path, report: Mapping[str, Any], include: Sequence[Path], environment: Mapping[str, str] = os.environ
) -> list[str]:
    """Write the bundle, and return the names of what is in it. Raises UsageError where it cannot be written."""
    blanks = Blanks()
    blanks.of_environment(environment)
    named = list(include) or [path for name in DEFAULT if (path := Path(name)).exists()]
    if missing := [path for path in named if not path.exists()]:
        raise UsageError(f"--include {missing[0]}: there is no such file or folder")
    unread: list[str] = []
    tables = dict(_tables([file for file in _files(named) if file.suffix == ".toml"], unread))
    # Secrets of all files are known before the first one is written.
    for table in tables.values():
        blanks.table(table)
    parts = {f"configuration/{name}.json": _json(blanks.texts(blanks.table(table))) for name, table in tables.items()}
    for file in _files(named):
        if file.suffix in LOGS:
            parts[f"{LOGS_FOLDER}{_name(file)}"] = blanks.text(_end_of(file))
    parts["doctor.json"] = _json(blanks.texts(report))
    parts["versions.json"] = _json(versions(environment))
    keys = ", ".join(sorted(blanks.keys)) or "nothing"
    logs = str(sum(name.startswith(LOGS_FOLDER) for name in parts) or NO_LOGS)
    parts["README.txt"] = README.format(blank=BLANK, keys=keys, unread=", ".join(unread) or "nothing", logs=logs)
    try:
        with zipfile.ZipFile(out, "w", zipfile.ZIP_DEFLATED) as bundle:
            for name, text in sorted(parts.items()):
                bundle.writestr(name, text)
    except OSError as error:
        raise UsageError(f"--bundle {out}: {error.strerror or error}; name a file that can be written") from None
    return sorted(parts)


def summary(out: Path, names: Sequence[str]) -> str:
    """Return the line that is printed on a bundle: what is in it, and that there is no log where none was found.

    >>> summary(Path("bug.zip"), ["README.txt", "logs/state/logs/edge.log"])
    'bug.zip: 2 files, 1 of them a log, secrets taken out; look through it before you send it'
    """
    count = sum(name.startswith(LOGS_FOLDER) for name in names)
    logs = f"{count} of them {'a log' if count == 1 else 'logs'}" if count else "no logs among them"
    told = f"{out}: {len(names)} files, {logs}, secrets taken out; look through it before you send it"
    return told if count else f"{told}\nlogs: {NO_LOGS}"


def versions(environment: Mapping[str, str]) -> dict[str, Any]:
    """Return what runs here. Of the environment only the names of our variables."""
    packages = {}
    for line in metadata.requires("cnctwin") or ():
        name = line.split(";")[0].split("[")[0].strip().rstrip("<>=!~,.0123456789 ")
        try:
            packages[name] = metadata.version(name)
        except metadata.PackageNotFoundError:
            packages[name] = "not installed"
    return {
        "cnctwin": metadata.version("cnctwin"),
        "python": sys.version.split()[0],
        "system": platform.platform(),
        "processor": platform.machine(),
        "cores": os.cpu_count(),
        "packages": dict(sorted(packages.items())),
        "variables": sorted(name for name in environment if name.startswith("CNCTWIN_")),
    }


def _files(named: Sequence[Path]) -> list[Path]:
    """Return the files named, and those of the folders named: configuration and logs, a bounded number."""
    found = [
        file
        for path in named
        for file in (sorted(path.rglob("*")) if path.is_dir() else [path])
        if file.is_file() and file.suffix in (".toml", *LOGS)
    ]
    return list(dict.fromkeys(found))[:FILES_MAX]


def _tables(files: Sequence[Path], unread: list[str]) -> Iterator[tuple[str, dict[str, Any]]]:
    """Yield what the files hold; one that is no TOML is left out, since nobody knows where its secrets are."""
    for file in files:
        try:
            if file.stat().st_size > CONFIGURATION_BYTES_MAX:
                unread.append(f"{_name(file)} (too long)")
                continue
            yield _name(file), tomllib.loads(file.read_text(encoding="utf-8"))
        except (OSError, UnicodeDecodeError, tomllib.TOMLDecodeError) as error:
            unread.append(f"{_name(file)} ({type(error).__name__})")


def _name(file: Path) -> str:
    """Return a file's name in the bundle, whatever folder it is in."""
    parts = [part for part in file.parts if part not in ("..", ".", file.anchor)]
    return "/".join(parts[-3:])


def _end_of(file: Path) -> str:
    """Return the end of a log, from the beginning of a line."""
    with file.open("rb") as opened:
        opened.seek(max(0, file.stat().st_size - LOG_BYTES_MAX))
        text = opened.read(LOG_BYTES_MAX).decode("utf-8", errors="replace")
    return text if file.stat().st_size <= LOG_BYTES_MAX else text.partition("\n")[2]


def _json(value: Any) -> str:
    return json.dumps(value, indent=2, default=str, ensure_ascii=False) + "\n"
