"""The twin's expectation of the programs of a machine, as a score takes it: by program, line and tool, as programmed.

Files are those of `cnctwin expect`. One that was worked out from another description of the machine than the one that is live
still counts, and the basis of the score says that it is stale. The live one is that which `twin/spindle_temp_basis` names.
"""

import re
from collections.abc import Mapping, Sequence
from functools import lru_cache
from pathlib import Path

from sparkplug.metric import Reading
from twin.errors import ExpectationError
from twin.expected import Expectation, Expected
from twin.expected.files import load_expectations
from twin.vocabulary import twin_signals
from twin.vocabulary.program_names import program_key

LINES_KEPT = 20_000
NAMED_MAX = 5
DESCRIBED_BY = twin_signals.SPINDLE_TEMP_BASIS
_DESCRIPTION = re.compile(r"description ([0-9a-f]{12})")
Expectations = Mapping[str, Expectation]
"""Program, as `program_key` spells it → the expectation of it."""


def read_expectations(folder: str) -> dict[str, Expectations]:
    """Return the expectations in a folder by machine; "" = none. Raises ValueError where one cannot be read."""
    if not folder:
        return {}
    try:
        found = load_expectations(Path(folder))
    except ExpectationError as error:
        raise ValueError(str(error)) from None
    return dict(found)


def expected_at(expectations: Expectations, program: str | None, line: int | None, tool: int | None) -> Expected | None:
    """Return what the twin expects at a line; None where no expectation has it."""
    if program is None or not expectations:
        return None
    one = expectations.get(_key(program))
    return None if one is None else _at(one, line, tool)


@lru_cache(maxsize=LINES_KEPT)
def _at(one: Expectation, line: int | None, tool: int | None) -> Expected | None:
    return one.at(line, tool=tool)


@lru_cache(maxsize=1000)
def _key(program: str) -> str:
    return program_key(program)


def live_description(row: Mapping[str, Reading]) -> str:
    """Return the version of the description that is live, as far as a machine's row tells it; "" = not known."""
    reading = row.get(DESCRIBED_BY)
    return "" if reading is None or type(reading.value) is not str else _version(reading.value)


@lru_cache(maxsize=1000)
def _version(basis: str) -> str:
    found = _DESCRIPTION.search(basis)
    return "" if found is None else found[1]


def basis_of(expectations: Expectations, description: str) -> str:
    """Return in words which programs the twin expects, and which of them stale; description: the live one, "" = not known."""
    if not expectations:
        return "no expectation of the twin"
    stale = sorted({one.program for one in expectations.values() if description and one.description not in ("", description)})
    old = f"; stale, since the machine is described again: {_listed(stale)}: cnctwin expect makes them again" if stale else ""
    return f"the twin expects {_listed(sorted({one.program for one in expectations.values()}))}{old}"


def _listed(names: Sequence[str]) -> str:
    more = f" and {len(names) - NAMED_MAX} more" if len(names) > NAMED_MAX else ""
    return ", ".join(names[:NAMED_MAX]) + more
