"""The files of expectations: <folder>/<machine>/<program>.json, worked out once and read by a processor; plain JSON, no pickle.

    {"version": 1, "sha256": checksum of the rest, "expectation": {…}}

A file keeps the checksum of the program's text and the version of the machine's description that it was worked out from, by which
`stale` tells one that no longer holds. A folder is bounded: FILES_MAX files of at most BYTES_MAX each.
"""

import hashlib
import json
import os
import re
import tempfile
from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path
from typing import Any

from twin.errors import ExpectationError
from twin.expected.expectation import Expectation
from twin.expected.expected import Run, Stretch
from twin.expected.lines import Numbering
from twin.expected.meter import Meter
from twin.vocabulary.program_names import program_key

VERSION, ENDING = 1, ".json"
BYTES_MAX, FILES_MAX = 256 * 1024 * 1024, 2000
UNSAFE = re.compile(r"[^A-Za-z0-9._+-]+")
AGAIN = "make it again with cnctwin expect"


def place_of(folder: Path, machine: str, program: str) -> Path:
    """Return the file of a program of a machine."""
    return folder / _safe(machine) / (_safe(program) + ENDING)


def written(folder: Path, expectation: Expectation) -> Path:
    """Write an expectation into its place in a folder, in one move; return the file. Raises ExpectationError."""
    place = place_of(folder, expectation.machine, expectation.program)
    try:
        place.parent.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryDirectory(prefix=".new.", dir=place.parent) as aside:
            made = Path(aside) / place.name
            made.write_text(to_json(expectation), encoding="utf-8")
            os.replace(made, place)  # noqa: PTH105  Path.replace would do the same
    except OSError as error:
        raise ExpectationError(f"{place}: cannot be written: {error.strerror}") from None
    return place


class ByProgram(Mapping[str, Expectation]):
    """The expectations of a machine by program, looked up by any name that a control or a file has for it.

    >>> found = ByProgram([])
    >>> len(found), found.get("O0012.nc")
    (0, None)
    """

    def __init__(self, expectations: Iterable[Expectation]) -> None:
        """Keep expectations by the key of their program and by its O word; a later one replaces an earlier one."""
        self._own: dict[str, Expectation] = {}
        for one in expectations:
            self._own |= {program_key(name): one for name in (one.o_word, one.program) if name}

    def __getitem__(self, program: str) -> Expectation:
        return self._own[program_key(program)]

    def __iter__(self) -> Iterator[str]:
        return iter(self._own)

    def __len__(self) -> int:
        return len(self._own)


def load_expectations(folder: Path) -> dict[str, ByProgram]:
    """Return the expectations in a folder by machine, as each says whose it is. Raises ExpectationError."""
    if not folder.is_dir():
        raise ExpectationError(f"{folder}: there is no such folder; cnctwin expect --out makes it")
    files = sorted(path for path in folder.glob(f"*/*{ENDING}") if not path.name.startswith("."))
    if len(files) > FILES_MAX:
        raise ExpectationError(f"{folder}: {len(files)} files are more than {FILES_MAX}; take out programs that no machine runs")
    found: dict[str, list[Expectation]] = {}
    for path in files:
        expectation = read_expectation(path)
        found.setdefault(expectation.machine, []).append(expectation)
    return {machine: ByProgram(own) for machine, own in found.items()}


def read_expectation(path: Path) -> Expectation:
    """Return the expectation in a file. Raises ExpectationError where it is damaged, too large or of another version."""
    try:
        size = path.stat().st_size
        if size > BYTES_MAX:
            raise ExpectationError(f"{path}: {size} bytes are more than {BYTES_MAX}; split the program")
        return from_json(path.read_text(encoding="utf-8"))
    except (OSError, UnicodeDecodeError) as error:
        raise ExpectationError(f"{path}: cannot be read: {error}") from None
    except ExpectationError as error:
        raise ExpectationError(f"{path}: {error}") from None


def to_json(expectation: Expectation) -> str:
    """Return an expectation as JSON, with its checksum."""
    meter = expectation.meter
    body = {
        "program": expectation.program,
        "machine": expectation.machine,
        "o_word": expectation.o_word,
        "file": expectation.file,
        "numbering": expectation.numbering.value,
        "program_sha256": expectation.program_sha256,
        "description": expectation.description,
        "basis": list(expectation.basis),
        "meter": None if meter is None else [list(meter.speeds_rpm), list(meter.powers_kw), [list(r) for r in meter.loads_pct]],
        "runs": [[*run[:7], [[one.until_mm, *one.forces_n] for one in run.stretches], run.why_not] for run in expectation.runs],
    }
    text = _compact(body)
    return f'{{"version":{VERSION},"sha256":"{_checksum(text)}","expectation":{text}}}\n'


def from_json(text: str) -> Expectation:
    """Return the expectation that a JSON text is. Raises ExpectationError."""
    try:
        told = json.loads(text)
        version, checksum, body = told["version"], told["sha256"], told["expectation"]
    except (ValueError, KeyError, TypeError):
        raise ExpectationError(f"is no expectation; {AGAIN}") from None
    if version != VERSION:
        raise ExpectationError(f"version {version} is not {VERSION}; {AGAIN}")
    if checksum != _checksum(_compact(body)):
        raise ExpectationError(f"its checksum is not that of what it holds; {AGAIN}")
    try:
        return _of(body)
    except (ValueError, KeyError, TypeError, IndexError) as error:
        raise ExpectationError(f"is no expectation ({type(error).__name__}: {error}); {AGAIN}") from None


def stale(expectation: Expectation, *, program_sha256: str = "", description: str = "") -> str | None:
    """Return why an expectation no longer holds: its program or the machine's description has changed; None where it does.

    What stands behind a + in the description of an expectation is the version of a table of tools that came with it.
    """
    if program_sha256 and expectation.program_sha256 != program_sha256:
        return f"the program {expectation.program} has changed since; {AGAIN}"
    own = expectation.description.partition("+")[0]
    if description and own and own != description:
        return f"the description of {expectation.machine} has changed since; {AGAIN}"
    return None


def _of(body: Mapping[str, Any]) -> Expectation:
    meter = body["meter"]
    runs = tuple(
        Run._make([*own, tuple(Stretch(one[0], tuple(one[1:])) for one in stretches), why_not])
        for *own, stretches, why_not in body["runs"]
    )
    return Expectation(
        program=str(body["program"]),
        machine=str(body["machine"]),
        numbering=Numbering(body["numbering"]),
        runs=runs,
        meter=None if meter is None else Meter(tuple(meter[0]), tuple(meter[1]), tuple(tuple(row) for row in meter[2])),
        basis=tuple(body["basis"]),
        program_sha256=str(body["program_sha256"]),
        description=str(body["description"]),
        o_word=str(body["o_word"]),
        file=str(body.get("file", "")),
    )


def _compact(body: object) -> str:
    return json.dumps(body, ensure_ascii=False, separators=(",", ":"))


def _checksum(text: str) -> str:
    return hashlib.sha256(text.encode()).hexdigest()


def _safe(name: str) -> str:
    """Return a name as a file may have it.

    >>> _safe("/PRG/O1701.nc"), _safe("..")
    ('PRG_O1701.nc', 'unnamed')
    """
    return UNSAFE.sub("_", name).strip("._")[:100] or "unnamed"
