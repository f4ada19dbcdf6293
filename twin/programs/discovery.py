"""The languages of part programs: every `twin/programs/<name>/` whose `dialect.py` ends in `DIALECT = Dialect(...)`."""

import importlib
import pkgutil
from functools import cache, lru_cache
from pathlib import PurePath

from twin.errors import PartProgramError, TwinError
from twin.programs.dialect import RECOGNISED_CHARACTERS_MAX, Dialect
from twin.programs.settings import Settings
from twin.programs.source import source_lines

WORD_MAX = 24


@cache
def dialects() -> dict[str, Dialect]:
    """Return all languages by name."""
    found = {}
    here = __name__.rpartition(".")[0]
    folders = (one for one in pkgutil.iter_modules([str(PurePath(__file__).parent)]) if one.ispkg)
    for folder in sorted(folders, key=lambda one: one.name):
        declared = importlib.import_module(f"{here}.{folder.name}.dialect").DIALECT
        assert isinstance(declared, Dialect) and declared.name == folder.name
        found[declared.name] = declared
    return found


def known() -> str:
    """Return the languages as an error names them."""
    return ", ".join(f"{one.name} ({one.control})" for one in dialects().values())


def named(name: str) -> Dialect:
    """Return the language of that name. Raises TwinError where there is none."""
    if name not in dialects():
        raise TwinError(f"dialect {name!r} is not known; known are {known()}")
    return dialects()[name]


def dialect_of(text: str, settings: Settings | None = None) -> Dialect:
    """Return the language of a text: the one that the settings name, else the one that is surest of the text.

    A text in which nothing is written is a program of the first language.

    Raises PartProgramError where the text is of no language that is known, or as likely of two.
    """
    if settings is not None and settings.dialect is not None:
        return named(settings.dialect)
    certainties = _certainties(text[:RECOGNISED_CHARACTERS_MAX])
    best = max(certainties.values())
    surest = [name for name, certainty in certainties.items() if certainty == best]
    if best > 0.0 and len(surest) == 1:
        return dialects()[surest[0]]
    lines = source_lines(text)
    first = next((at for at, line in enumerate(lines) if line.strip()), None)
    if first is None:
        return next(iter(dialects().values()))
    if best > 0.0:
        reason = f"the language of this program can be {' and '.join(surest)}"
    else:
        reason = f"the language of this program is none of those that are read: {known()}"
    word = lines[first].strip()[:WORD_MAX]
    raise PartProgramError(first + 1, word, f'{reason}; choose one with dialect = "..." in [control] of machine.toml')


def told_by_ending(text: str, ending: str, dialect: str | None) -> str | None:
    """Return the name of the language of a program in a file: the one that is named, else the one that the ending is of.

    The ending does not count where it is one of the first language's, which any G code has, or where the text is surely of
    another language; None where it tells nothing, so that the text decides.

    >>> told_by_ending("T1 D1 M6", ".MPF", None)
    'sinumerik'
    """
    owner = next((one.name for one in dialects().values() if ending.casefold() in one.suffixes), None)
    if dialect is not None or owner is None or owner == next(iter(dialects())):
        return dialect
    sure = [name for name, certainty in _certainties(text[:RECOGNISED_CHARACTERS_MAX]).items() if certainty >= 1.0]
    return owner if not sure or owner in sure else None


@lru_cache(maxsize=256)
def _certainties(head: str) -> dict[str, float]:
    """Return how sure each language is of the beginning of a text."""
    return {name: one.recognises(head) for name, one in dialects().items()}
