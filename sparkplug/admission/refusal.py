"""Refusals, and the table of the nodes and devices of which something is refused now."""

from dataclasses import dataclass
from enum import Enum
from typing import NamedTuple

from sparkplug.topics import NodeId

ROWS_MAX = 4096
ROWS_A_NODE_MAX = 64
FORGET_MS = 3_600_000
SHOWN_MAX = 60
_KEY_MAX = 255


class Refusal(Enum):
    """The reason why something is not let in."""

    NAME = "name"  # a group, node, device or metric that cannot be a level of a topic
    RESERVED = "reserved"  # a device with a name that the host uses itself
    STAMP = "stamp"  # a time stamp that no clock has
    SIZE = "size"  # a value or a message that is too long
    QUOTA = "quota"  # more metrics, devices or nodes than are allowed
    RATE = "rate"  # more messages or bytes a second than are allowed


class Quarantined(NamedTuple):
    """A node (device None) or a device of which something is refused.

    is_whole: all that it says is refused, until its next good birth or its death; else single readings or messages are
    """

    node: NodeId
    device: str | None
    reason: Refusal
    text: str
    since_ms: int
    times: int
    is_whole: bool


@dataclass(slots=True)
class _Row:
    reason: Refusal
    text: str
    since_ms: int
    count: int
    last_ms: int
    is_whole: bool


class Quarantine:
    """The table. It is bounded: of a node that would fill it only `ROWS_A_NODE_MAX` rows are kept, of all `ROWS_MAX`; a row that
    nothing is added to for `FORGET_MS` goes."""

    def __init__(self) -> None:
        self._rows: dict[tuple[NodeId, str | None], _Row] = {}
        self._of_node: dict[NodeId, int] = {}

    def __len__(self) -> int:
        return len(self._rows)

    def table(self) -> tuple[Quarantined, ...]:
        """The rows, oldest first."""
        rows = sorted(self._rows.items(), key=lambda item: item[1].since_ms)
        return tuple(
            Quarantined(
                node, None if device is None else shown(device), row.reason, row.text, row.since_ms, row.count, row.is_whole
            )
            for (node, device), row in rows
        )

    def of(self, node: NodeId, device: str | None) -> Refusal | None:
        """Return why all that a node or device says is refused; None where it is not."""
        row = self._rows.get(_key(node, device))
        return row.reason if row is not None and row.is_whole else None

    def is_full(self, node: NodeId) -> bool:
        """Return True where no more devices of a node are remembered one by one."""
        return self._of_node.get(node, 0) >= ROWS_A_NODE_MAX

    def note(
        self, node: NodeId, device: str | None, reason: Refusal, text: str, now_ms: int, *, is_whole: bool = False, count: int = 1
    ) -> None:
        """Note that something was refused."""
        key = _key(node, device)
        row = self._rows.get(key)
        if row is None:
            if self.is_full(node) and device is not None:
                key = (node, None)
                row, is_whole = self._rows.get(key), False
            if row is None:
                if len(self._rows) >= ROWS_MAX:
                    self._drop(next(iter(self._rows)))
                row = self._rows[key] = _Row(reason, text, now_ms, 0, now_ms, is_whole)
                self._of_node[node] = self._of_node.get(node, 0) + 1
        row.count += count
        row.last_ms = now_ms
        if is_whole or not row.is_whole:
            row.reason, row.text, row.is_whole = reason, text, is_whole

    def again(self, node: NodeId, device: str | None, now_ms: int) -> None:
        """Count a message of what is refused as a whole."""
        row = self._rows.get(_key(node, device))
        if row is not None:
            row.count += 1
            row.last_ms = now_ms

    def release(self, node: NodeId, device: str | None) -> None:
        """A good birth has come, or a death: let it in again."""
        if self._rows and (key := _key(node, device)) in self._rows:
            self._drop(key)

    def sweep(self, now_ms: int) -> None:
        """Forget the rows to which nothing was added for long."""
        for key in [key for key, row in self._rows.items() if now_ms - row.last_ms >= FORGET_MS]:
            self._drop(key)

    def _drop(self, key: tuple[NodeId, str | None]) -> None:
        del self._rows[key]
        left = self._of_node[key[0]] - 1
        if left:
            self._of_node[key[0]] = left
        else:
            del self._of_node[key[0]]


def _key(node: NodeId, device: str | None) -> tuple[NodeId, str | None]:
    """Return the key of a row. A name that is longer is refused in any case, and nobody is to fill the memory with it."""
    return node, None if device is None else device[:_KEY_MAX]


def shown(text: str) -> str:
    """Return a name as a person can read it: printable, and short.

    >>> shown("spindle"), shown("a" + chr(7) + "b"), shown("%" * 30_000)[-4:]
    ('spindle', 'a\\\\x07b', '%%%…')
    """
    cut = text[:SHOWN_MAX]
    printable = cut if cut.isprintable() else cut.encode("unicode_escape").decode()
    return printable[:SHOWN_MAX] + ("…" if len(text) > SHOWN_MAX or len(printable) > SHOWN_MAX else "")
