"""The data that a control keeps of the tool in the spindle, from tables that have a column for each tool.

Such a node is another one for each tool, so it cannot be watched: it is read after each change of the tool, and now and then,
since a tool's life goes on while it cuts.
"""

from collections.abc import Callable, Iterable, Sequence

from asyncua.client.client import Client

from edge.controls.opcua import plain, session
from edge.controls.opcua.config import Config, points_of
from edge.controls.opcua.point import node_of
from edge.controls.opcua.resolve import node_id
from edge.sweep import Fact

READ_S = 10.0
TOOL_NUMBER = "tool_number"
NO_TOOL, NOT_KNOWN = "no tool is in the spindle", "the number of the tool in the spindle is not known"


class ToolReader:
    """The points of a configuration that follow the tool, on one session."""

    def __init__(self, config: Config, client: Client, namespaces: Sequence[str], clock: Callable[[], float]) -> None:
        self._points = [point for point in points_of(config) if point.follows_tool]
        self._client, self._namespaces, self._clock = client, namespaces, clock
        self._tool: int | None = None
        self._tool_ms: int | None = None  # when the control says that it came or went
        self._is_due, self._read_s = bool(self._points), clock()

    def heard(self, facts: Iterable[Fact]) -> None:
        """Note the number of the tool, which tells which column is meant."""
        for fact in facts:
            if fact.key == TOOL_NUMBER:
                tool = _number(fact)
                self._is_due |= tool != self._tool
                self._tool, self._tool_ms = tool, fact.t_ms

    async def tick(self) -> list[Fact]:
        """Return the values of the tool in the spindle where they are due, else nothing."""
        if not self._points or not (self._is_due or self._clock() - self._read_s >= READ_S):
            return []
        self._is_due, self._read_s = False, self._clock()
        return await self._read()

    async def _read(self) -> list[Fact]:
        if not self._tool:
            fault = NOT_KNOWN if self._tool is None else NO_TOOL
            return [Fact(point.signal, fault=fault, t_ms=self._tool_ms) for point in self._points]
        nodes = [node_id(node_of(point.node_for(self._tool)), self._namespaces) for point in self._points]
        there = [(point, node) for point, node in zip(self._points, nodes, strict=True) if node is not None]
        values = await session.read_values(self._client, [node for _, node in there])
        facts = [
            plain.as_fact(point.signal, value, element=point.element, stamps="server")  # the moment of the read, not of the entry
            for (point, _), value in zip(there, values, strict=True)
        ]
        return [fact._replace(t_ms=self._not_before(fact.t_ms)) for fact in facts]

    def _not_before(self, at_ms: int | None) -> int | None:
        """Return this stamp, or that of the tool where a server stamps what it reads by when it was entered."""
        return self._tool_ms if at_ms is None or self._tool_ms is None else max(at_ms, self._tool_ms)


def _number(fact: Fact) -> int | None:
    value = fact.value
    is_number = isinstance(value, int | float) and not isinstance(value, bool)
    return int(value) if is_number and value is not None and 0 <= float(value) < 2**31 else None
