"""`cnctwin doctor`: is everything connected, in order and accounted for?"""

import time
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass
from typing import Any

from cnctwin.plant.described import DescribedMachine, described_machines, sentences
from cnctwin.plant.descriptions import LiveDescriptions
from cnctwin.plant.finding import Finding
from cnctwin.plant.gone import FILTERS, LastWords
from cnctwin.plant.lags import lag_reports
from cnctwin.plant.on_log import FirstLook, of_log
from cnctwin.plant.quarantine import refused_lines
from cnctwin.plant.view import StageLedger, health, ledgers, machines, own_values
from cnctwin.plant.watch import viewer
from edge.running.awaited import LATE_S, NO_HISTORIAN
from edge.sample import Drop
from processors.lag_report import BEHIND_S, LagReport
from sparkplug.broker import BrokerAddress
from sparkplug.host import EventKind, HostApplication
from sparkplug.metric import Reading
from sparkplug.quality import Quality
from twin.vocabulary.nodes import VALIDATION_NODE
from twin.vocabulary.signals import ADDED

_SLOPPY = {
    "sloppy_births": "births left out what Sparkplug demands (bdSeq, Node Control/Rebirth, a time stamp)",
    "sloppy_sequence": "messages came with a wrong sequence number",
    "sloppy_aliases": "aliases stood for a metric of a node and one of its device (as Tahu Java gives them)",
}
_COUNTED = {
    "holes": ("gap in the data", "gaps in the data"),
    "dead_letters": ("message that could not be used (dead letter)", "messages that could not be used (dead letters)"),
}
NAMED_MAX = 8
COME_AND_GO = (VALIDATION_NODE,)  # nodes that tell what they have found, and end


@dataclass(frozen=True, slots=True)
class Report:
    """All findings, the ledgers and the descriptions behind them."""

    findings: tuple[Finding, ...]
    ledgers: tuple[StageLedger, ...]
    machines: tuple[DescribedMachine, ...] = ()

    @property
    def good(self) -> bool:
        """True if every finding is good."""
        return all(finding.good for finding in self.findings)

    def as_json(self) -> dict[str, Any]:
        """For a program to read."""
        stages = [{**asdict(ledger), "balances": ledger.balances} for ledger in self.ledgers]
        findings, machines = ([asdict(one) for one in each] for each in (self.findings, self.machines))
        return {"good": self.good, "findings": findings, "ledgers": stages, "machines": machines}


def examine(broker: BrokerAddress, group: str, seconds: float) -> Report:
    """Listen to a broker for a while and report; asks nodes for their births where it has to."""
    host, descriptions, first, last = viewer(broker, group), LiveDescriptions(), FirstLook(), LastWords()
    for topic in (*descriptions.filters, *FILTERS):
        host.subscribe_plain(topic)
    host.on_state = last.take_state
    host.start()
    try:
        deadline_s = time.monotonic() + seconds
        while time.monotonic() < deadline_s:
            for event in host.poll(0.1):
                if event.kind is EventKind.PLAIN:
                    descriptions.take(event.topic, event.payload)
                    last.take(event.topic, event.payload)
            first.take(host)
        return diagnose(host, broker.url, descriptions, first, last)
    finally:
        host.stop()


def in_sums(ledger: StageLedger) -> str:
    """Return what became of what a stage received; what only repeats a value is no loss and stands apart.

    >>> in_sums(StageLedger("edge-vmc", True, 70, 5, 1, 64, {"unchanged": 60, "late": 4}))
    '70 = 5 emitted + 60 unchanged + 4 dropped + 1 buffered'
    """
    unchanged = ledger.reasons.get(Drop.UNCHANGED, 0)
    repeats = f" + {unchanged} unchanged" if unchanged else ""
    dropped = ledger.dropped - unchanged
    return f"{ledger.received} = {ledger.emitted} emitted{repeats} + {dropped} dropped + {ledger.buffered} buffered"


def counted_signals(measured: Mapping[str, Reading]) -> str:
    """Return how many signals there are, how many are not good, and which: the first eight by name.

    >>> fine = Reading("program", "O1", 1, Quality.GOOD, None, None, False)
    >>> counted_signals({"program": fine, "alarm": fine._replace(value=None, quality=Quality.BAD)})
    '2 signals, 1 not good: alarm'
    >>> counted_signals({"program": fine, "stamp_clock": fine})
    '2 signals (1 added by the edge), 0 not good'
    """
    bad = [name for name, reading in measured.items() if reading.quality is not Quality.GOOD]
    named = f": {', '.join(bad[:NAMED_MAX])}{', …' if len(bad) > NAMED_MAX else ''}" if bad else ""
    added = len(ADDED & measured.keys())
    signals = f"{len(measured)} signal{'' if len(measured) == 1 else 's'}{f' ({added} added by the edge)' if added else ''}"
    return f"{signals}, {len(bad)} not good{named}"


def diagnose(host: HostApplication, url: str, descriptions: LiveDescriptions, first: FirstLook, last: LastWords) -> Report:
    """Return what a host application that has listened for a while can say.

    first: how nodes were when it began; last: what processors have left behind
    """
    if not host.online:
        return Report((Finding(False, host.last_error or f"no connection to {url}"),), ())
    findings = [Finding(True, f"{url} answers")]
    stages = ledgers(host)
    for node in host.nodes():
        picture = host.picture(node)
        online = picture is not None and picture.online
        if not online and node.node in COME_AND_GO:
            findings.append(Finding(True, f"{node} has told what it had to tell, and is gone"))
        else:
            findings.append(Finding(online, f"{node} is {'online' if online else 'offline, or gives no birth'}"))
    if not host.nodes():
        findings.append(Finding(False, "no edge node was heard of; start one with `cnctwin edge run CONFIG`"))
    findings += [Finding(False, sentence) for sentence in last.gone(host)]
    for machine in machines(host):
        state = "its control is connected" if machine.online else "its control is not connected; its values are stale"
        findings.append(Finding(machine.online, f"{machine.name}: {state}; {counted_signals(machine.measured)}"))
    described = described_machines(descriptions, [machine.name for machine in machines(host)])
    findings += [said for one in described for said in sentences(one)]
    for ledger in stages:
        sums = in_sums(ledger)
        findings.append(Finding(ledger.balances, f"{ledger.node}: {sums}" if ledger.balances else f"{ledger.node}: not {sums}"))
    for node_id, metrics in health(host).items():
        connected, why = metrics.get("control_online"), metrics.get("last_error")
        if connected is not None and connected.value is False:
            reason = f": {why.value}" if why is not None and isinstance(why.value, str) and why.value else ""
            findings.append(Finding(False, f"{node_id} has no control{reason}"))
        findings += of_counts(node_id, metrics)
        findings += of_store(node_id, metrics)
        findings += of_edge_store(node_id, metrics)
        findings += of_awaited(node_id, metrics)
        findings += of_sequence_holes(node_id, metrics)
        findings += of_faults(node_id, metrics)
    findings += of_history(health(host).values())
    findings += [Finding(False, line) for line in refused_lines(host.quarantine, own_values(host))]
    findings += of_overload(health(host).values())
    findings += [Finding(said.good, said.text) for said in of_log(host, first)]
    findings += of_lags(lag_reports(own_values(host)))
    counts = host.counts
    findings += of_sloppy_peers(counts)
    order = f"{counts.get('lost', 0)} messages lost, {counts.get('malformed', 0)} malformed while listening"
    findings.append(Finding(not counts.get("lost") and not counts.get("malformed"), order))
    return Report(tuple(findings), tuple(stages), described)


def of_counts(node_id: str, metrics: Mapping[str, Reading]) -> list[Finding]:
    """Return a note on each kind of thing that a node has counted, and that is no fault of the plant as it is now."""
    found = []
    for name, (one, many) in _COUNTED.items():
        count = metrics[name].value if name in metrics else 0
        if isinstance(count, int) and count:
            found.append(Finding(True, f"{node_id}: {count} {one if count == 1 else many} so far", note=True))
    return found


def of_sloppy_peers(counts: Mapping[str, int]) -> list[Finding]:
    """Return a finding for each rule of Sparkplug that a peer has not kept; what it sent is read all the same."""
    return [
        Finding(True, f"{counts[name]} {what}; read all the same", note=True)
        for name, what in _SLOPPY.items()
        if counts.get(name)
    ]


def of_lags(reports: Sequence[LagReport]) -> list[Finding]:
    """Return a finding for each process of processors: how far it is behind, or that it is in time."""
    return [
        Finding(False, report.sentence)
        if report.lag_s >= BEHIND_S
        else Finding(
            True,
            f"processors are in time: {report.lag_s:.1f} s behind, {report.load} ({', '.join(report.processors)})",
        )
        for report in reports
    ]


def of_edge_store(node_id: str, metrics: Mapping[str, Reading]) -> list[Finding]:
    """Return the finding that an edge has rows in its store that it has not sent yet; nothing where they are of this moment."""
    waiting, age = (metrics[name].value if name in metrics else None for name in ("store_waiting_rows", "store_age_s"))
    if not isinstance(waiting, int) or not isinstance(age, float) or not waiting or age < BEHIND_S:
        return []
    return [
        Finding(False, f"{node_id} is {age:.0f} s behind: {waiting} rows of its store are not sent yet; they follow as history")
    ]


def of_awaited(node_id: str, metrics: Mapping[str, Reading]) -> list[Finding]:
    """Return the finding that the historian an edge waits for gives no receipts; nothing where it does."""
    silent_s, told = (metrics[name].value if name in metrics else None for name in ("awaited_s", "history"))
    is_late = isinstance(silent_s, float) and silent_s >= LATE_S
    return [Finding(False, f"{node_id}: {told}")] if is_late and isinstance(told, str) else []


def of_history(every: Iterable[Mapping[str, Reading]]) -> list[Finding]:
    """Return the finding that edges have heard of no historian; nothing where each has."""
    without = sum(metrics["history"].value == NO_HISTORIAN for metrics in every if "history" in metrics)
    how = "start `cnctwin process historian` to keep it"
    text = f"{without} edge{'s' if without > 1 else ''}: {NO_HISTORIAN}; {how}"
    return [Finding(True, text, note=True)] if without else []


def of_sequence_holes(node_id: str, metrics: Mapping[str, Reading]) -> list[Finding]:
    """Return a historian's finding that rows of edges are missing in its store; nothing where none are."""
    count, named = (metrics[name].value if name in metrics else None for name in ("sequence_holes", "sequence_hole"))
    return [Finding(False, f"{node_id}: rows of edges are missing: {named!s}")] if isinstance(count, int) and count else []


def of_faults(node_id: str, metrics: Mapping[str, Reading]) -> list[Finding]:
    """Return the finding that a processor has contained faults; nothing where there were none."""
    faults, restarts, last = (metrics[name].value if name in metrics else None for name in ("faults", "restarts", "fault"))
    if not isinstance(faults, int) or not faults:
        return []
    times = f", restarted {restarts!s} times" if restarts else ""
    contained = "1 fault" if faults == 1 else f"{faults} faults"
    return [Finding(True, f"{node_id}: {contained} contained{times}; the last: {last!s}", note=True)]


def of_overload(every: Iterable[Mapping[str, Reading]]) -> list[Finding]:
    """Return a finding for each process that more comes to than it can fold; nothing where all keep up."""
    told = {str(metrics["overloaded_by"].value) for metrics in every if "overloaded_by" in metrics}
    return [Finding(False, f"more comes than can be folded, the newest values win: {who}") for who in sorted(told - {"", "None"})]


def of_store(node_id: str, metrics: Mapping[str, Reading]) -> list[Finding]:
    """Return a historian's findings on its store; nothing of any other node."""
    if not {"store_samples", "store_dropped", "store_trouble"} <= metrics.keys():
        return []
    counts = [metrics[f"store_{name}"].value if f"store_{name}" in metrics else 0 for name in ("samples", "waiting", "dropped")]
    stored, waiting, dropped = (count if isinstance(count, int) else 0 for count in counts)
    told = metrics["store_trouble"].value
    trouble = f"; {told}" if isinstance(told, str) and told else ""
    text = f"{node_id}: {stored} samples stored, {waiting} waiting, {dropped} messages without room{trouble}"
    return [Finding(not trouble and not dropped, text)]
