"""Drops what a log holds twice: messages of a device, named by their node's life and number (`record.Origin`).

Two writers of one log see the same messages while one takes over from the other, and each writes them in order. Of their
records the first of each number counts. A number is behind where it is at most 128 below the newest one, and its message is no
newer: some peers count sloppily (`sparkplug/sequence.py`). After a hole any number may come.

>>> lives = Lives()
>>> [lives.is_new("cnc/e", Origin(0, 1000, seq), stamp_ms) for seq, stamp_ms in ((7, 70), (7, 70), (8, 80), (7, 70), (9, 90))]
[True, False, True, False, True]
"""

from sparkplug.records.record import Origin

PAST_MAX = 4
ANY = -1


class Lives:
    """The lives of the nodes that speak for one device."""

    __slots__ = ("_nodes",)

    def __init__(self, known: dict[str, list[int]] | None = None) -> None:
        """`known`: what `kept` returned."""
        self._nodes: dict[str, list[int]] = {} if known is None else {node: list(one) for node, one in known.items()}

    @property
    def kept(self) -> dict[str, list[int]]:
        """Return all that is known, as plain values: of each node number and stamp of the newest message, its NBIRTH, and those
        before it."""
        return self._nodes

    def is_new(self, node: str, origin: Origin, stamp_ms: int, *, is_hole: bool = False) -> bool:
        """Return True for a record that was not there before, and note it. One without a number is new while its life lasts."""
        _, birth_ms, seq = origin
        life = self._nodes.get(node)
        if life is None:
            self._nodes[node] = [ANY if is_hole else seq, stamp_ms, birth_ms]
            return True
        if birth_ms != life[2]:
            if birth_ms in life[3:]:
                return False
            life[0:2] = [ANY if is_hole else seq, stamp_ms, birth_ms]
            del life[PAST_MAX + 2 :]
            return True
        if is_hole:
            life[0] = ANY
        elif seq >= 0:
            ahead = (seq - life[0]) % 256
            if life[0] != ANY and (ahead == 0 or ahead > 127) and stamp_ms <= life[1]:
                return False
            life[0:2] = [seq, max(stamp_ms, life[1])]
        return True
