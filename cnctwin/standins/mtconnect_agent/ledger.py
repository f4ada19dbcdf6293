"""The account of each entry of the recording: accepted + dropped by reason = entries, at any time."""

from collections import Counter
from dataclasses import dataclass, field


@dataclass
class ReplayLedger:
    """Counts of a replay. An entry is one key with its values, an asset command, or a line that can't be taken apart.

    `observations` counts what the agent stored: it also holds what no line says (initial UNAVAILABLE values, asset
    counts, lost adapters).
    """

    lines: int = 0
    commands: int = 0
    entries: int = 0
    accepted: int = 0
    observations: int = 0
    loops: int = 0
    dropped: Counter[str] = field(default_factory=Counter)

    def accept(self) -> None:
        self.entries += 1
        self.accepted += 1

    def drop(self, reason: str) -> None:
        self.entries += 1
        self.dropped[reason] += 1

    @property
    def balances(self) -> bool:
        """Nothing vanished: entries = accepted + dropped."""
        return self.entries == self.accepted + self.dropped.total()

    def copy(self) -> "ReplayLedger":
        """Return a snapshot that no longer changes with the replay."""
        return ReplayLedger(
            self.lines,
            self.commands,
            self.entries,
            self.accepted,
            self.observations,
            self.loops,
            Counter(self.dropped),
        )

    def as_dict(self) -> dict[str, int]:
        """Return the counts flat, reasons as `dropped/<reason>`."""
        counts = {
            "lines": self.lines,
            "commands": self.commands,
            "entries": self.entries,
            "accepted": self.accepted,
            "observations": self.observations,
            "loops": self.loops,
            "dropped": self.dropped.total(),
        }
        return counts | {f"dropped/{reason}": n for reason, n in sorted(self.dropped.items())}
