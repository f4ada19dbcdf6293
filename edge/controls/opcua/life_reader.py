"""The life of the tool in the spindle where a machine follows OPC 40501-1: `Tool/ToolLife/<entry>`, whatever entries are called.

Which tool that is, the parser finds from where each tool is. Its life is read after each change, and now and then.
"""

from collections.abc import Callable, Iterable, Sequence
from typing import Any

from asyncua import ua
from asyncua.client.client import Client

from edge.controls.opcua import session
from edge.controls.opcua.plain import stamp_ms
from edge.controls.opcua.point import TOOL
from edge.controls.opcua.resolve import Resolved, children_of, follow
from edge.controls.opcua.tool_life import TOOL_LIFE, LifeEntry, life_fact
from edge.controls.opcua.tool_reader import NO_TOOL, READ_S
from edge.sweep import Fact

ENTRIES_MAX = 8
MODEL = "http://opcfoundation.org/UA/MachineTool/"
_PARTS = ("Indication", "IsCountingUp", "StartValue", "LimitValue", "EngineeringUnits")


class LifeReader:
    """The tools of one session, and which of them is in the spindle."""

    def __init__(self, client: Client, nodes: Iterable[Resolved], namespaces: Sequence[str], clock: Callable[[], float]) -> None:
        self._client, self._namespaces, self._clock = client, namespaces, clock
        self._tools = {int(one.key.split(":")[1]): one.owner for one in nodes if one.point.signal == TOOL and one.owner}
        self._index: int | None = None
        self._read_s = 0.0
        self._stamp_ms: int | None = None  # the server's, of the last look

    async def tick(self, index: int | None) -> list[Fact]:
        """Return the life of this tool of the list where that is due, else nothing; None: no tool is in the spindle."""
        is_due = index != self._index or (index is not None and self._clock() - self._read_s >= READ_S)
        if not self._tools or not is_due:
            return []
        self._index, self._read_s = index, self._clock()
        owner = None if index is None else self._tools.get(index)
        if owner is None:
            return [Fact(TOOL_LIFE, fault=NO_TOOL)]
        entries = await self._entries(owner)
        return [life_fact(entries, self._stamp_ms)]

    async def _entries(self, tool: ua.NodeId) -> list[LifeEntry]:
        (life,) = await follow(self._client, [(tool, "ToolLife")], self._namespaces, MODEL)
        if life is None:
            return []
        references = (await children_of(self._client, [life]))[0]
        variables = [r.NodeId for r in references if r.NodeClass == ua.NodeClass.Variable][:ENTRIES_MAX]
        nodes = [ua.NodeId(one.Identifier, one.NamespaceIndex) for one in variables]
        found = [await self._entry(node) for node in nodes]
        return [entry for entry in found if entry is not None]

    async def _entry(self, node: ua.NodeId) -> LifeEntry | None:
        parts = await follow(self._client, [(node, part) for part in _PARTS], self._namespaces, MODEL)
        there = [node, *(part for part in parts if part is not None)]
        answers = await session.read_values(self._client, there)
        self._stamp_ms = stamp_ms(answers[0].ServerTimestamp)
        values = [_good(value) for value in answers]
        named = dict(zip(["Value", *(name for name, part in zip(_PARTS, parts, strict=True) if part)], values, strict=True))
        value, indication, counts_up = _number(named.get("Value")), named.get("Indication"), named.get("IsCountingUp")
        if value is None or not isinstance(indication, int) or not isinstance(counts_up, bool):
            return None
        unit = str(getattr(getattr(named.get("EngineeringUnits"), "DisplayName", None), "Text", "") or "")
        return LifeEntry(
            int(indication), counts_up, value, _number(named.get("StartValue")), _number(named.get("LimitValue")), unit
        )


def _good(value: ua.DataValue) -> Any:
    is_good = value.StatusCode is None or value.StatusCode.is_good()
    return value.Value.Value if is_good and value.Value is not None else None


def _number(value: object) -> float | None:
    return float(value) if isinstance(value, int | float) and not isinstance(value, bool) else None
