"""The sender that floods: whose messages were passed over, and how many."""

from collections import Counter

from sparkplug.metric import NodeId

TOLD_S = 60.0
NODES_MAX = 1000


class Overload:
    """Counts the messages that were passed over, by node. The clock is an argument."""

    def __init__(self) -> None:
        self._counts: Counter[str] = Counter()
        self._text, self._told_s = "", 0.0

    def passed_over(self, node: NodeId, count: int = 1) -> None:
        """Note messages that were passed over."""
        name = str(node)
        if name in self._counts or len(self._counts) < NODES_MAX:
            self._counts[name] += count

    def report(self, now_s: float) -> str:
        """Return who has flooded most since the last report, or within the last minute; empty where nobody did.

        >>> overload = Overload()
        >>> overload.report(0.0)
        ''
        """
        if self._counts:
            (node, count), others = self._counts.most_common(1)[0], len(self._counts) - 1
            also = f", and {others} others with fewer" if others else ""
            self._text, self._told_s = f"{node}: {count} messages passed over in a second{also}", now_s
            self._counts.clear()
        elif now_s - self._told_s > TOLD_S:
            self._text = ""
        return self._text
