"""A moment of the machine: what its adapter tells at one time, and the same as a line of SHDR."""

from collections.abc import Iterable, Iterator, Mapping
from typing import NamedTuple

from cnctwin.standins.mtconnect_agent.shdr import Line, parse_lines
from cnctwin.standins.mtconnect_agent.stamp import stamp_text


class Moment(NamedTuple):
    """The control's state at one time.

    at_s: time of the machine since it was switched on; values: text by key; waits: it stands still for a part not computed yet
    """

    at_s: float
    values: Mapping[str, str]
    waits: bool = False


class Adapter:
    """Tells what has changed, as adapters do."""

    def __init__(self, origin_s: float) -> None:
        self._origin_s = origin_s
        self._told: dict[str, str] = {}

    def line(self, moment: Moment) -> str | None:
        """The line of SHDR for this moment; None where nothing has changed.

        >>> adapter = Adapter(origin_s=60.0)
        >>> adapter.line(Moment(0.25, {"Srpm": "8500", "Fact": "0"}))
        '1970-01-01T00:01:00.25Z|Srpm|8500|Fact|0'
        >>> adapter.line(Moment(0.5, {"Srpm": "8500", "Fact": "3000"}))
        '1970-01-01T00:01:00.5Z|Fact|3000'
        """
        news = {key: value for key, value in moment.values.items() if self._told.get(key) != value}
        if not news:
            return None
        self._told |= news
        stamp = stamp_text(self._origin_s + moment.at_s)
        return "|".join((stamp, *(word for pair in news.items() for word in pair)))


def moments_of(lines: Iterable[str]) -> Iterator[Moment]:
    """The moments that such lines tell, from the first one on.

    >>> list(moments_of(["1970-01-01T00:01:00.25Z|Srpm|8500", "1970-01-01T00:01:00.75Z|Fact|0|Srpm|0"]))
    [Moment(at_s=0.0, values={'Srpm': '8500'}, waits=False), Moment(at_s=0.5, values={'Fact': '0', 'Srpm': '0'}, waits=False)]
    """
    origin_s: float | None = None
    for line in parse_lines(lines):
        assert isinstance(line, Line), f"not a line of the agent: {line}"
        origin_s = line.stamp.seconds if origin_s is None else origin_s
        yield Moment(round(line.stamp.seconds - origin_s, 6), dict(zip(line.fields[::2], line.fields[1::2], strict=True)))
