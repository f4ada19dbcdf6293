"""A viewer's picture of the broker: machines, what the twin says of them, and the ledger of each stage."""

from dataclasses import dataclass
from typing import Protocol

from sparkplug.metric import NodeId, Reading, is_command_metric
from sparkplug.node_picture import NodePicture
from sparkplug.quality import Quality
from sparkplug.values import Value
from twin.vocabulary.node_ledger import BUFFERED, DROPPED, DROPPED_PREFIX, EMITTED, LEDGER_PREFIX, RECEIVED
from twin.vocabulary.nodes import JOBS_NODE, is_twin_node
from twin.vocabulary.twin_signals import TWIN_PREFIX


class Pictures(Protocol):
    """The source of pictures of edge nodes: a `HostApplication`."""

    def nodes(self) -> tuple[NodeId, ...]:
        """All nodes that were heard of."""

    def picture(self, node: NodeId) -> NodePicture | None:
        """Return the picture of one."""


@dataclass(frozen=True, slots=True)
class MachineView:
    """One machine: what its control says, what the twin says, and whether the control is connected."""

    name: str
    online: bool
    measured: dict[str, Reading]
    twin: dict[str, Reading]


@dataclass(frozen=True, slots=True)
class StageLedger:
    """received = emitted + dropped + buffered, as one stage published it in one message."""

    node: str
    online: bool
    received: int
    emitted: int
    buffered: int
    dropped: int
    reasons: dict[str, int]

    @property
    def missing(self) -> int:
        """The difference that the stage cannot account for; 0 when its ledger balances."""
        return self.received - self.emitted - self.dropped - self.buffered

    @property
    def balances(self) -> bool:
        """True if everything is accounted for, reasons included."""
        return self.missing == 0 and sum(self.reasons.values()) == self.dropped


def machines(pictures: Pictures) -> list[MachineView]:
    """All machines, by name. A device whose metrics carry the twin's prefix adds to the machine of the same name."""
    online: dict[str, bool] = {}
    measured: dict[str, dict[str, Reading]] = {}
    twin: dict[str, dict[str, Reading]] = {}
    for picture in _pictures(pictures):
        if picture.node.node == JOBS_NODE:
            continue  # a job is no machine, nor is each machine that a job is about one of the plant
        for device, owner in picture.devices.items():
            for name, reading in owner.readings.items():
                if is_command_metric(name):
                    continue
                side = twin if name.startswith(TWIN_PREFIX) else measured
                side.setdefault(device, {})[name] = reading
                if side is measured:
                    online[device] = owner.online
    names = sorted({*measured, *twin})
    return [MachineView(name, online.get(name, False), measured.get(name, {}), twin.get(name, {})) for name in names]


def ledgers(pictures: Pictures) -> list[StageLedger]:
    """The ledger of each node that publishes one; edges first, then the processors."""
    found = []
    for picture in _pictures(pictures):
        values = {name: reading.value for name, reading in picture.own.readings.items() if name.startswith(LEDGER_PREFIX)}
        if RECEIVED not in values:
            continue
        counts = {name: value if isinstance(value, int) else 0 for name, value in values.items()}
        found.append(
            StageLedger(
                node=picture.node.node,
                online=picture.online,
                received=counts[RECEIVED],
                emitted=counts.get(EMITTED, 0),
                buffered=counts.get(BUFFERED, 0),
                dropped=counts.get(DROPPED, 0),
                reasons={
                    name.removeprefix(DROPPED_PREFIX): n for name, n in counts.items() if name.startswith(DROPPED_PREFIX) and n
                },
            )
        )
    return sorted(found, key=lambda ledger: (is_twin_node(ledger.node), ledger.node))


def health(pictures: Pictures) -> dict[str, dict[str, Reading]]:
    """The `health/` metrics of each node, by node."""
    return {
        picture.node.node: {n.removeprefix("health/"): r for n, r in picture.own.readings.items() if n.startswith("health/")}
        for picture in _pictures(pictures)
    }


def own_values(pictures: Pictures) -> list[tuple[str, dict[str, Value]]]:
    """Each node that is online, with the values of its own metrics."""
    return [
        (picture.node.node, {name: reading.value for name, reading in picture.own.readings.items()})
        for picture in _pictures(pictures)
        if picture.online
    ]


def text(reading: Reading | None) -> str:
    """A value as a person reads it: rounded, with what is wrong with it.

    >>> text(Reading("spindle_load_pct", 37.25001, 0, Quality.GOOD, "%", None, False))
    '37.25 %'
    >>> text(Reading("spindle_load_pct", None, 0, Quality.BAD, "%", "outside 0 to 200 %: 950", False))
    '– (outside 0 to 200 %: 950)'
    """
    if reading is None:
        return ""
    value = reading.value
    if value is None:
        shown = "–"
    elif isinstance(value, bool):
        shown = "yes" if value else "no"
    elif isinstance(value, float):
        shown = f"{value:.6g}"
    else:
        shown = str(value)
    if reading.unit and value is not None:
        shown += f" {reading.unit}"
    notes = [reading.reason] if reading.reason else []
    if reading.quality is Quality.STALE:
        notes = ["stale"]
    elif reading.quality is Quality.BAD and not notes:
        notes = ["bad"]
    return f"{shown} ({'; '.join(notes)})" if notes else shown


def _pictures(pictures: Pictures) -> list[NodePicture]:
    return [picture for node in pictures.nodes() if (picture := pictures.picture(node)) is not None]
