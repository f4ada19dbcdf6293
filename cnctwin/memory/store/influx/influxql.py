"""The text of questions in InfluxQL, which InfluxDB 1.x, 2 (by its DBRP names) and 3 all answer on `/query`; no Flux."""

from collections.abc import Sequence

from cnctwin.memory.store.contract import Query

SAMPLE_FIELDS = "value, held, flag, text, quality, reason"


def identifier(name: str) -> str:
    """A name in double quotes."""
    return '"' + name.replace("\\", "\\\\").replace('"', '\\"').replace("\n", "\\n") + '"'


def literal(text: str) -> str:
    """A text in single quotes.

    >>> print(literal("Mill's"))
    'Mill\\'s'
    """
    return "'" + text.replace("\\", "\\\\").replace("'", "\\'").replace("\n", "\\n") + "'"


def _of(machine: str, signals: Sequence[str] | None = None) -> str:
    chosen = "" if signals is None else " AND (" + " OR ".join(f'"signal" = {literal(name)}' for name in signals) + ")"
    return f'"machine" = {literal(machine)}{chosen}'


def _within(from_ms: int, to_ms: int) -> str:
    return f"time >= {from_ms}ms AND time < {to_ms}ms"


_BY = 'GROUP BY "signal", "node", "unit"'


def machines(source: str) -> str:
    """All machines of a measurement."""
    return f'SHOW TAG VALUES FROM {source} WITH KEY = "machine"'


def last_samples(source: str, machine: str) -> str:
    """The newest sample of each series of a machine."""
    return f"SELECT {SAMPLE_FIELDS} FROM {source} WHERE {_of(machine)} {_BY} ORDER BY time DESC LIMIT 1"  # noqa: S608 — names and texts are quoted


def ends(source: str, machine: str) -> list[str]:
    """The times of the first and the last sample of each series of a machine."""
    return [f"SELECT {which}(quality) FROM {source} WHERE {_of(machine)} {_BY}" for which in ("first", "last")]  # noqa: S608 — names and texts are quoted


def units(source: str, query: Query) -> str:
    """The time of the newest sample of each series of the signals asked for."""
    return f"SELECT last(quality) FROM {source} WHERE {_of(query.machine, query.signals)} {_BY}"  # noqa: S608 — names and texts are quoted


def samples(source: str, machine: str, signals: Sequence[str] | None, from_ms: int, to_ms: int) -> str:
    """All samples of a stretch; signals None: of all."""
    return f"SELECT {SAMPLE_FIELDS} FROM {source} WHERE {_of(machine, signals)} AND {_within(from_ms, to_ms)} {_BY}"  # noqa: S608 — names and texts are quoted


def windows(source: str, query: Query) -> list[str]:
    """Three statements: what is in each window, and the reasons of its bad and of its stale samples."""
    where = f"WHERE {_of(query.machine, query.signals)} AND {_within(query.from_ms, query.to_ms)}"
    by = f'GROUP BY time({query.every_ms}ms), "signal" fill(none)'
    figures = "mean(value) AS mean, min(value) AS low, max(value) AS high, count(quality) AS count, max(quality) AS worst"
    statements = [f"SELECT {figures}, last(flag) AS flag, last(text) AS text FROM {source} {where} {by}"]  # noqa: S608 — names and texts are quoted
    statements += [f"SELECT last(reason) AS reason FROM {source} {where} AND quality = {code} {by}" for code in (2, 1)]  # noqa: S608 — names and texts are quoted
    return statements
