"""The layouts that are remembered of one edge node's or device's data messages."""

from dataclasses import dataclass, field

from sparkplug.layouts.layout import Columns, Layout

LENGTHS_MAX = 32
LAYOUTS_A_LENGTH_MAX = 4
AT_ONCE_MAX = 8
HITS_A_LAYOUT = 4
MISSES_A_LAYOUT = 64


@dataclass(slots=True)
class Room:
    """The memory that all layouts of a host may still take, bytes."""

    left: int = 64 * 1024 * 1024


@dataclass(slots=True)
class Memory:
    """Layouts by the length of the message, in each length the one first that matched last.

    To learn a layout takes as long as to read a message or two. It pays where layouts come again, so that after the first
    `AT_ONCE_MAX` each has to be earned by `HITS_A_LAYOUT` messages; where none comes again one of `MISSES_A_LAYOUT` is learnt.
    """

    room: Room
    _by_length: dict[int, list[Layout]] = field(default_factory=dict)
    _hits: int = 0
    _misses: int = 0
    _learnt: int = 0

    def read(self, payload: bytes) -> tuple[Layout, Columns] | None:
        """Return the layout of a message and what it says; None where no remembered layout is its own."""
        layouts = self._by_length.get(len(payload))
        if layouts is None:
            return None
        whole = int.from_bytes(payload, "little")
        for layout in layouts:
            columns = layout.columns(payload, whole)
            if columns is not None:
                if layout is not layouts[0]:
                    layouts.remove(layout)
                    layouts.insert(0, layout)
                self._hits += 1
                return layout, columns
        return None

    def may_learn(self) -> bool:
        """Count a message that was read the long way; True where its layout should be learnt."""
        self._misses += 1
        earned = self._learnt < AT_ONCE_MAX + self._hits // HITS_A_LAYOUT
        return self.room.left > 0 and (earned or self._misses % MISSES_A_LAYOUT == 0)

    def keep(self, layout: Layout) -> None:
        """Remember a layout; of too many, the one that was not met for the longest time is forgotten."""
        self._learnt += 1
        if layout.length not in self._by_length and len(self._by_length) >= LENGTHS_MAX:
            self._give_back(self._by_length.pop(next(iter(self._by_length))))
        layouts = self._by_length.setdefault(layout.length, [])
        if len(layouts) >= LAYOUTS_A_LENGTH_MAX:
            self._give_back([layouts.pop()])
        layouts.insert(0, layout)
        self.room.left -= layout.size

    def forget(self) -> None:
        """Forget all layouts: a birth may have given aliases and names another meaning."""
        for layouts in self._by_length.values():
            self._give_back(layouts)
        self._by_length.clear()
        self._hits = self._misses = self._learnt = 0

    def _give_back(self, layouts: list[Layout]) -> None:
        self.room.left += sum(layout.size for layout in layouts)
