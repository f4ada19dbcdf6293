"""The findings on processors that are folded on a log: their runners, the bridges between broker and log, and what was lost.

Each runner group has a line for what is well, each trouble a line with the way out. Counts say what was; so that an old trouble
is told from one that lasts, they are looked at twice: when a node is first heard, and at the end.
"""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field

from cnctwin.plant.view import Pictures
from sparkplug.values import Value
from twin.vocabulary.nodes import TWIN_NODE_PREFIX, is_twin_node

WAITING_MANY = 10_000
"""Records of the bridge from here on are a backlog: 1 % of its room (1,000,000), and more than a second of a large plant."""
REPEATED_SHARE = 0.1
"""A bridge that begins again repeats the little that was on its way; two that read the same nodes repeat all."""
_HEALTH = "health/"


@dataclass(frozen=True, slots=True)
class Said:
    """One line: is it good, and what it says."""

    good: bool
    text: str


@dataclass(frozen=True, slots=True)
class _Seen:
    """The health of a processor's node now, and as it was first heard."""

    name: str
    online: bool
    now: Mapping[str, Value]
    first: Mapping[str, Value]

    def count(self, name: str) -> int:
        value = self.now.get(name)
        return value if isinstance(value, int) else 0

    def rise(self, name: str) -> int:
        before = self.first.get(name)
        return max(self.count(name) - before, 0) if isinstance(before, int) else 0

    def text(self, name: str) -> str:
        value = self.now.get(name)
        return value if isinstance(value, str) else ""


@dataclass(slots=True)
class FirstLook:
    """The health of nodes as it was when they were first heard, to tell what rises."""

    _values: dict[str, Mapping[str, Value]] = field(default_factory=dict)

    def take(self, pictures: Pictures) -> None:
        """Look at the nodes that were not seen yet."""
        for node in pictures.nodes():
            if node.node in self._values or not is_twin_node(node.node):
                continue
            picture = pictures.picture(node)
            if picture is None or not picture.online or not picture.own.readings:
                continue
            values = {name: reading.value for name, reading in picture.own.readings.items()}
            if f"{_HEALTH}runners" not in values or isinstance(values[f"{_HEALTH}runners"], int):
                self._values[node.node] = values

    def of(self, node: str) -> Mapping[str, Value]:
        """Return what a node said first."""
        return self._values.get(node, {})


def of_log(pictures: Pictures, first: FirstLook) -> list[Said]:
    """Return the findings; none where nothing is folded on a log."""
    seen = list(_seen(pictures, first))
    gone = [one.name for one in seen if not one.online]
    alive = [one for one in seen if one.online and isinstance(one.now.get("runners"), int)]
    found = []
    if gone:
        found.append(
            Said(
                False,
                f"the bridge of {_listed(gone)} is gone: their results wait in the log, and no readings come into it; start it "
                "again with its --name and --state-dir",
            )
        )
    if away := [one for one in alive if _is_away(one)]:
        found.append(
            Said(
                False,
                f"the log takes nothing: {away[0].count('bridge_waiting')} records wait at the bridge, none went out while "
                "listening, and no runner can report; bring the cluster back, or see in the bridge's log why it cannot come in",
            )
        )
        return found
    if alive:
        found += _of_bridges(alive)
        found += _of_silent(alive)
    groups: dict[str, list[_Seen]] = {}
    for one in alive:
        groups.setdefault(one.text("process") if one.count("runners") else "", []).append(one)
    for group in groups.values():
        found += _of_runners(_listed(one.name for one in group), group[0])
    return found


def _seen(pictures: Pictures, first: FirstLook) -> Iterable[_Seen]:
    for node in pictures.nodes():
        picture = pictures.picture(node)
        if picture is None or f"{_HEALTH}runners" not in picture.own.readings:
            continue
        now = {name.removeprefix(_HEALTH): reading.value for name, reading in picture.own.readings.items()}
        before = {name.removeprefix(_HEALTH): value for name, value in first.of(node.node).items()}
        yield _Seen(node.node.removeprefix(TWIN_NODE_PREFIX), picture.online, now, before)


def _is_away(one: _Seen) -> bool:
    """Return True if events came in while listening and no record went out, though each second has its watermarks."""
    return one.rise("bridge_events") > 0 and one.count("bridge_waiting") > 0 and not one.rise("bridge_delivered")


def _of_bridges(alive: list[_Seen]) -> list[Said]:
    """Return the findings on the bridges. Each node says the same of them, up to a second."""
    one = max(alive, key=lambda seen: (seen.rise("bridge_dropped"), seen.count("bridge_dropped"), seen.count("bridge_waiting")))
    waiting, dropped, rises = one.count("bridge_waiting"), one.count("bridge_dropped"), one.rise("bridge_dropped")
    bridges = max(one.count("bridges"), 1)
    who = "the bridge" if bridges == 1 else f"{bridges} bridges"
    found = []
    if waiting >= WAITING_MANY:
        found.append(
            Said(
                False,
                f"{who}: {waiting} records wait for the log, which takes them slower than they come, or not at all; look at the "
                "cluster and at the bridge's log, before its memory (buffer_mb) is full",
            )
        )
    if rises:
        found.append(
            Said(
                False,
                f"{who}: no room for {rises} records while listening, {dropped} so far; the hole "
                "is reported to the folds: bring the cluster back, then give buffer_mb more for its next outage",
            )
        )
    elif dropped:
        said = f"{who}: no room for {dropped} records so far, none while listening; reported to the folds as holes"
        found.append(Said(True, said))
    if not found:
        found.append(Said(True, f"{who} to the log: {one.count('bridge_delivered')} records delivered, {waiting} waiting"))
    return found


def _of_silent(alive: list[_Seen]) -> list[Said]:
    """Return the finding on members that have ended without a word; of bridges each node names them all."""
    names = sorted({name for one in alive for name in one.text("silent").split(", ") if name})
    if not names:
        return []
    return [
        Said(
            False,
            f"{', '.join(names)}: silent, and did not say goodbye; start it again under its name (what a silent bridge reads "
            "does not come into the log; the partitions of a silent runner go to the others); one that is gone for good is "
            "listed for a day",
        )
    ]


def _of_runners(who: str, one: _Seen) -> list[Said]:
    runners, partitions, waiting = one.count("runners"), one.count("partitions"), one.count("lag_records")
    if not runners:
        return [
            Said(
                False,
                f"{who}: no runner reports, so nothing is folded; start `cnctwin process … --kafka`, or look at its log (one "
                "that reads its states says nothing for up to 2 min)",
            )
        ]
    found = [
        Said(
            True, f"{who} on a log: {runners} runner{'s' if runners > 1 else ''}, {partitions} partitions, {waiting} records wait"
        )
    ]
    aborted, committed = one.rise("transactions_aborted"), one.rise("transactions")
    if aborted:
        found.append(
            Said(
                False,
                f"{who}: {aborted} transactions aborted while listening, {committed} committed; each is folded again from the "
                "last saved state: look at the runners' logs for the reason, and at the cluster's health",
            )
        )
    elif total := one.count("transactions_aborted"):
        found.append(Said(True, f"{who}: {total} transactions aborted so far, none while listening; folded again"))
    if lost := one.count("lost_by_retention"):
        found.append(
            Said(
                False,
                f"{who}: {lost} records were deleted before they were folded; raise retention_hours above the longest time that "
                "runners may be away or behind",
            )
        )
    repeated, events = one.rise("repeated"), one.rise("bridge_events")
    if repeated > REPEATED_SHARE * events:
        found.append(
            Said(
                False,
                f"{who}: {repeated} records came twice while listening, and were left out; two bridges read the same nodes: "
                "compare their --nodes",
            )
        )
    elif total := one.count("repeated"):
        found.append(Said(True, f"{who}: {total} records came twice so far, and were left out"))
    return found


def _listed(names: Iterable[str]) -> str:
    return ", ".join(sorted(names))
