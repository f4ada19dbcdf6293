"""The signal that each node is: a map, as a TOML file beside this one, or a line of the configuration.

A node is named by its namespace's URI and its identifier (OPC UA part 6, 5.3.1.11), since the index of a namespace may differ
from server to server and after each start; identifiers that are texts are case-sensitive. A point of a companion model has no
fixed node: it is named by the type of the object that has it, and the path from there.

>>> node_of("nsu=SinumerikVarProvider;s=/Channel/State/actTNumber[u1,1]")
NodeName(namespace='SinumerikVarProvider', kind='s', identifier='/Channel/State/actTNumber[u1,1]')
"""

import re
import tomllib
from functools import cache
from pathlib import Path
from typing import NamedTuple

from pydantic import BaseModel, ConfigDict, Field, field_validator, model_validator

from edge.errors import ConfigError

TOOL = "tool"  # the pseudo signal of a point that belongs to one of many tools, see edge.controls.opcua.spindle_tool
UNIT = "unit."  # before the signal, in the key of a fact that tells the unit which the server states
_NODE = re.compile(r"(?:nsu=(?P<uri>[^;]+);)?(?P<kind>[sigb])=(?P<identifier>.+)", re.DOTALL)
_GUID = r"[0-9a-fA-F]{8}(-[0-9a-fA-F]{4}){3}-[0-9a-fA-F]{12}"
_BY_KIND = {"i": r"\d{1,10}", "g": _GUID, "b": r"[A-Za-z0-9+/]+={0,2}", "s": r"(?s).{1,4096}"}


class NodeName(NamedTuple):
    """A node; namespace "" is the standard's own. `kind` is s, i, g or b: text, number, GUID, bytes in base 64."""

    namespace: str
    kind: str
    identifier: str


def node_of(text: str) -> NodeName:
    """Read a node's name; ConfigError where it is none."""
    found = _NODE.fullmatch(text)
    if found is None or not re.fullmatch(_BY_KIND[found["kind"]], found["identifier"]):
        way_out = "write nsu=<namespace URI>;s=<identifier> (or i=, g=, b=); an index like ns=2 differs from start to start"
        raise ConfigError(f"node {text!r} is no node; {way_out}")
    return NodeName(found["uri"] or "", found["kind"], found["identifier"])


class _Frozen(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True)


class Point(_Frozen):
    """One value to read.

    signal: a canonical name; {name} stands for the name of the object that has it
    node: its name, in which {tool} stands for the number of the tool in the spindle; or else `of`, the type of the objects that
    have it, and `path` from there (browse names, "/" between)
    only_if, only_if_not: a flag beside it that decides whether it is read at all
    element: which element of an array is meant
    counts_down_from: the signal of the limit, where the value is what is left of it and not what was used
    words: canonical words, or texts, by native value; prefix: a text that is taken off the front of the value
    seen: on what it rests; "" = nothing that we have read says so
    """

    signal: str
    node: str = ""
    of: str = ""
    path: str = ""
    each: bool = False
    only_if: str = ""
    only_if_not: str = ""
    element: int | None = None
    native_unit: str = ""
    scale: float = 1.0
    words: dict[str, str] = Field(default_factory=dict)
    prefix: str = ""
    counts_down_from: str = ""
    seen: str = ""

    @field_validator("node")
    @classmethod
    def _is_node(cls, text: str) -> str:
        if text:
            node_of(text)
        return text

    @model_validator(mode="after")
    def _is_named(self) -> "Point":
        if bool(self.node) == bool(self.of and self.path):
            raise ValueError(f"point {self.signal!r} needs a node, or of and path")
        return self

    @property
    def follows_tool(self) -> bool:
        """Return True if the node is another one for each tool."""
        return "{tool}" in self.node

    def node_for(self, tool: int) -> str:
        """Return the node of this tool."""
        return self.node.replace("{tool}", str(tool))

    @property
    def label(self) -> str:
        """Return what people call it."""
        return self.node or f"{self.of}/{self.path}"


class PointMap(_Frozen):
    """A file of points. `namespace` is the model's: a server that lists it follows this map.

    events: the node whose events are the alarms; "" = the Server object, which has those of all
    """

    title: str
    namespace: str
    events: str = ""
    points: tuple[Point, ...]

    @property
    def is_native(self) -> bool:
        """Return True for the map of one make of control, which names nodes; a companion model names types."""
        return all(point.node for point in self.points)


@cache
def maps() -> dict[str, PointMap]:
    """The ready maps by name."""
    folder = Path(__file__).with_name("maps")
    return {path.stem: PointMap.model_validate(tomllib.loads(path.read_text(encoding="utf-8"))) for path in folder.glob("*.toml")}
