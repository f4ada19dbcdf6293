"""Samples as line protocol (https://docs.influxdata.com/influxdb/v2/reference/syntax/line-protocol/).

    cnc_raw,machine=vmc,node=cnc/hall,signal=spindle_rpm,unit=rev/min value=8000,quality=0 1764547200000000000

Every line has `quality` (0 good, 1 stale, 2 bad). `value` is a good number (a bool as 0 or 1, a text of `codes` as its code),
`held` one that is stale or bad, so that a mean over `value` holds no stale figure; `flag` and `text` say what a number does not.

VictoriaMetrics has neither texts nor places for two samples in one millisecond, and each field is a series of its own there: so
`text`, `flag` and `reason` are labels of series whose value is 1, and the n-th value of a millisecond has a label `nth`.
"""

from cnctwin.memory.store.influx.codes import code
from cnctwin.memory.store.influx.sample_row import CODE, SampleRow, SeriesKey
from sparkplug.quality import Quality

TAG_CHARACTERS_MAX = 500
_ESCAPED = str.maketrans({",": "\\,", " ": "\\ ", "=": "\\="})
_QUOTED = str.maketrans({'"': '\\"', "\\": "\\\\"})


class UnfitTextError(ValueError):
    """A text that line protocol cannot carry as a tag."""


def tag(text: str) -> str:
    """A tag's value; a backslash or a line break has no sure form there.

    >>> print(tag("Mill 3, left"))
    Mill\\ 3\\,\\ left
    """
    if not text or len(text) > TAG_CHARACTERS_MAX or "\\" in text or not text.isprintable():
        raise UnfitTextError(
            f"{text[:60]!r} cannot be a tag: use 1 to {TAG_CHARACTERS_MAX} printable characters without backslash"
        )
    return text.translate(_ESCAPED)


def quoted(text: str) -> str:
    """The value of a text field."""
    return f'"{text.translate(_QUOTED)}"'


def tags(key: SeriesKey, unit: str | None) -> str:
    """Measurement and tags of a series, without what only VictoriaMetrics needs."""
    told = "" if not unit else f",unit={tag(unit)}"
    return f"{key.measurement},machine={tag(key.machine)},node={tag(key.node)},signal={tag(key.signal)}{told}"


def number(row: SampleRow) -> str:
    """`value=` or `held=` of a sample, '' where it has no number."""
    given = code(row.key.signal, row.value) if isinstance(row.value, str) else row.value
    if given is None:
        return ""
    is_good = row.quality is Quality.GOOD
    if not is_good and isinstance(row.value, bool | str):
        return ""
    return f"{'value' if is_good else 'held'}={float(given)!r},"


def fields(row: SampleRow) -> str:
    """All fields of a sample: two samples of a millisecond are the same where these are."""
    if type(row.value) is float and row.quality is Quality.GOOD and row.reason is None:  # nearly all of them
        return f"value={row.value!r},quality=0"
    flag = f"flag={'true' if row.value else 'false'}," if isinstance(row.value, bool) else ""
    text = f"text={quoted(row.value)}," if isinstance(row.value, str) else ""
    reason = "" if row.reason is None else f",reason={quoted(row.reason)}"
    return f"{number(row)}{flag}{text}quality={CODE[row.quality]:g}{reason}"


def influx_line(series: str, row: SampleRow, told: str) -> str:
    """The line of a sample, given `tags` and `fields` of it."""
    return f"{series} {told} {row.t_us}000\n"


def victoria_line(series: str, row: SampleRow) -> str:
    """The lines of a sample for VictoriaMetrics; UnfitTextError where a text cannot be a label."""
    t_ms, nth = divmod(row.t_us, 1000)
    series = f"{series},nth={nth}" if nth else series
    end = f" {t_ms}000000\n"
    lines = f"{series} {number(row)}quality={CODE[row.quality]:g}{end}"
    if isinstance(row.value, bool):
        lines += f"{series},flag={'true' if row.value else 'false'} flag=1{end}"
    if isinstance(row.value, str):
        lines += f"{series},text={tag(row.value or EMPTY)} text=1{end}"
    if row.reason is not None:
        lines += f"{series},reason={tag(row.reason or EMPTY)} reason={CODE[row.quality]:g}{end}"
    return lines


EMPTY = "''"
"""An empty text as a label, which cannot be empty."""
