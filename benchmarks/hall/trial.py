"""One trial: a broker of its own, machines, processors as a user starts them, a reader; and what all of it took."""

import contextlib
import json
import multiprocessing
import sys
import time
from array import array
from collections.abc import Iterator, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, field
from multiprocessing.connection import Connection
from pathlib import Path
from typing import Any

from benchmarks.hall import load, reader
from benchmarks.hall.load import Order, Tally
from benchmarks.hall.machine import name_of
from benchmarks.hall.reader import Seen
from benchmarks.hall.usage import Usage, busy_s, pss_mb, usage_of
from cnctwin.processes.child import Child
from cnctwin.processes.port import free_port
from cnctwin.processes.private_broker import PrivateBroker
from twin.vocabulary.node_ledger import BUFFERED, DROPPED, DROPPED_PREFIX, EMITTED, RECEIVED
from twin.vocabulary.nodes import twin_node

OWN = Path(__file__).parents[2]
OBSERVED_MAX = 10
MACHINES_A_PROCESS = 500
LATE_MS_MAX = 50.0
"""A load whose slots are later than this at 99 % was not the load that was asked for."""
_SPAWN = multiprocessing.get_context("spawn")


@dataclass(frozen=True, slots=True)
class Setup:
    """The setup of a trial: a tree of the project, which processors, how many machines, how fast."""

    tree: Path
    processors: Sequence[Sequence[str]]
    machines: int
    hz: float
    seconds: float = 60.0
    settle_s: float = 10.0
    outage_every_s: float = 15.0
    is_idle: bool = False
    everyone: bool = False
    config: str = ""
    live_s_max: float = 60.0
    is_preferred: bool = False


@dataclass(slots=True)
class Part:
    """A process of ours that is asked by a pipe."""

    pipe: Connection
    pid: int


@dataclass(slots=True)
class Running:
    """A trial that runs."""

    setup: Setup
    folder: Path
    broker: PrivateBroker
    processors: list[Child] = field(default_factory=list)
    loads: list[Part] = field(default_factory=list)
    reader: Part | None = None

    def seen(self) -> Seen:
        """Return what the reader has seen so far."""
        assert self.reader is not None
        self.reader.pipe.send(("report", None))
        found: Seen = self.reader.pipe.recv()
        return found

    def tallies(self) -> tuple[list[Tally], float]:
        """Return what the load has sent, and when the births began."""
        for part in self.loads:
            part.pipe.send(("report", None))
        answers = [part.pipe.recv() for part in self.loads]
        return [tally for tally, _ in answers], min(begun_s for _, begun_s in answers)

    def open(self, begin_s: float, end_s: float) -> None:
        """Open the window of the load and of the reader."""
        assert self.reader is not None
        for part in self.loads:
            part.pipe.send(("window", (round(begin_s * 1000), round(end_s * 1000))))
        self.reader.pipe.send(("window", (begin_s, end_s)))

    def used(self) -> dict[str, Usage]:
        """Return the use of each part, processes of one kind together."""
        assert self.reader is not None and self.broker.child.pid is not None
        return {
            "processors": _together([usage_of(one.pid) for one in self.processors if one.pid is not None]),
            "broker": usage_of(self.broker.child.pid),
            "load": _together([usage_of(part.pid) for part in self.loads]),
            "reader": usage_of(self.reader.pid),
        }

    def is_running(self) -> bool:
        """Return True while no processor has ended."""
        return all(one.running for one in self.processors)

    def online(self) -> int:
        """Return how many machines the processor that knows the fewest has online."""
        nodes, names = self.seen().nodes, [name for names in self.setup.processors for name in names]
        return min((nodes.get(twin_node(name), {}).get("health/machines", 0) for name in names), default=0)


def _together(parts: Sequence[Usage]) -> Usage:
    return Usage(
        sum(one.cpu_s for one in parts),
        sum(one.rss_mb for one in parts),
        sum(one.threads for one in parts),
        sum(one.switches for one in parts),
    )


def observed(machines: int) -> list[int]:
    """Return the machines whose mirror is read, spread over all."""
    count = min(machines, OBSERVED_MAX)
    return sorted({index * machines // count for index in range(count)})


def _part(stack: ExitStack, target: Any, *arguments: Any) -> Part:
    ours, theirs = _SPAWN.Pipe()
    process = _SPAWN.Process(target=target, args=(*arguments, theirs), daemon=True)
    process.start()
    theirs.close()

    def end() -> None:
        with contextlib.suppress(OSError):
            ours.send(None)
        process.join(5.0)
        if process.is_alive():
            process.terminate()
            process.join(5.0)

    stack.callback(end)
    assert process.pid is not None
    return Part(ours, process.pid)


def _awaited(part: Part, who: str) -> None:
    if not part.pipe.poll(120.0):
        raise SystemExit(f"the {who} does not start")
    part.pipe.recv()


@contextmanager
def started(setup: Setup, folder: Path) -> Iterator[Running]:
    """Start broker, reader, processors and load; the machines are connected, none is born yet."""
    with ExitStack() as stack:
        broker = PrivateBroker(folder / "broker", free_port())
        broker.start()
        stack.callback(broker.stop)
        running = Running(setup, folder, broker)
        watched = observed(setup.machines)
        running.reader = _part(stack, reader.serve, broker.port, [name_of(number) for number in watched], setup.everyone)
        processes = max(1, -(-setup.machines // MACHINES_A_PROCESS))
        for index in range(processes):
            numbers = tuple(range(index, setup.machines, processes))
            order = Order(broker.port, numbers, setup.hz, setup.outage_every_s, frozenset(watched), setup.is_idle)
            running.loads.append(_part(stack, load.serve, order))
        _awaited(running.reader, "reader")
        for index, names in enumerate(setup.processors):
            child = _process(setup, folder, broker, names, index)
            running.processors.append(child)
            stack.callback(child.stop)
        for part in running.loads:
            _awaited(part, "load")
        _await_nodes(running)
        for one in (broker.child, *running.processors) if setup.is_preferred else ():
            assert one.pid is not None
            load.prefer(one.pid)
        yield running


def _process(setup: Setup, folder: Path, broker: PrivateBroker, names: Sequence[str], index: int) -> Child:
    """Start `cnctwin process` of the tree, as a user does."""
    settings, state = folder / f"processors-{index}.toml", folder / f"state-{index}"
    state.mkdir()
    text = setup.config
    if "historian" in names:
        text += f"\n[historian]\nstore = {json.dumps(str(folder / 'store'))}\n"
    settings.write_text(text)
    own = setup.tree / ".venv" / "bin" / "python"
    python = str(own) if own.exists() else sys.executable
    given = ["--config", str(settings), "--broker", broker.address.url, "--state-dir", str(state)]
    # The tree's own packages come first on the path of `-m` in its folder, whatever is installed.
    command = ["env", "-C", str(setup.tree), python, "-m", "cnctwin", "process", *names, *given]
    child = Child("processors", command, folder / f"processors-{index}.log")
    child.start()
    return child


def _await_nodes(running: Running, seconds: float = 60.0) -> None:
    """Wait until each processor is born on the broker."""
    wanted = {twin_node(name) for names in running.setup.processors for name in names}
    deadline_s = time.monotonic() + seconds
    while not wanted <= running.seen().nodes.keys():
        if not running.is_running():
            words = " / ".join(one.last_words() for one in running.processors)
            raise SystemExit(f"the processors have ended: {words}")
        if time.monotonic() > deadline_s:
            raise SystemExit(f"{', '.join(sorted(wanted - running.seen().nodes.keys()))}: not born within {seconds:g} s")
        time.sleep(0.2)


def bear(running: Running) -> None:
    """Have all machines born."""
    for part in running.loads:
        part.pipe.send("go")


def await_live(running: Running) -> bool:
    """Wait until every processor knows every machine; False where that takes too long."""
    deadline_s = time.monotonic() + running.setup.live_s_max
    while running.online() < running.setup.machines:
        if time.monotonic() > deadline_s or not running.is_running():
            return False
        time.sleep(0.5)
    return True


def measured(running: Running) -> dict[str, Any]:
    """Return the figures of a window of `seconds`."""
    setup = running.setup
    begin_s = time.time() + 0.2
    end_s = begin_s + setup.seconds
    running.open(begin_s, end_s)
    time.sleep(0.2)
    before, busy_before_s, nodes_before = running.used(), busy_s(), _received(running.seen())
    began_s = time.monotonic()
    while time.time() < end_s:
        time.sleep(min(1.0, max(0.0, end_s - time.time())))
        if not running.is_running():
            words = " / ".join(one.last_words() for one in running.processors)
            raise SystemExit(f"the processors have ended: {words}")
    after, busy_after_s, wall_s = running.used(), busy_s(), time.monotonic() - began_s
    memory = sum(pss_mb(one.pid) for one in running.processors if one.pid is not None)
    folded = {node: count - nodes_before.get(node, 0) for node, count in _received(running.seen()).items()}
    time.sleep(1.5)  # what was sent at the end of the window has so long to come
    seen, (tallies, _) = running.seen(), running.tallies()
    return figures(setup, before, after, wall_s, busy_after_s - busy_before_s, memory, seen, tallies, folded)


def figures(  # noqa: PLR0917
    setup: Setup,
    before: dict[str, Usage],
    after: dict[str, Usage],
    wall_s: float,
    busy: float,
    memory_mb: float,
    seen: Seen,
    tallies: Sequence[Tally],
    folded: dict[str, int],
) -> dict[str, Any]:
    """Return the figures of a window as one JSON object."""
    sent, late = sum(tally.sent for tally in tallies), sorted(ms for tally in tallies for ms in tally.late_ms)
    whole = sum(tally.whole.get(name_of(number), 0) for tally in tallies for number in observed(setup.machines))
    mirrors = any("mirror" in names for names in setup.processors)
    used = {name: _share(before[name], after[name], wall_s, sent) for name in before}
    used["processors"]["pss_mb"] = round(memory_mb, 1)
    planned = setup.machines * setup.hz * setup.seconds
    result: dict[str, Any] = {
        "processors": [list(names) for names in setup.processors],
        "machines": setup.machines,
        "hz": setup.hz,
        "seconds": round(wall_s, 1),
        "messages": sent,
        "used": used,
        "elsewhere_cores": round(max(0.0, busy / wall_s - sum(part["cores"] for part in used.values())), 3),
        "age_ms": quantiles(seen.mirror_s),
        "result_age_ms": quantiles(seen.results_s),
        "in_time_pct": round(min(100.0, 100.0 * seen.in_time / whole), 2) if whole and mirrors else None,
        "late_ms_99": round(late[len(late) * 99 // 100], 1) if late else 0.0,
        "late_ms_max": round(late[-1], 1) if late else 0.0,
        "outages": sum(tally.outages for tally in tallies),
        "rebirths": sum(tally.rebirths for tally in tallies),
        "nodes": health(seen),
    }
    result["folded_share"] = round(min(folded.values()) / sent, 3) if sent and folded else None
    # What falls behind has not yet spent what the messages cost that wait: it is judged by those it has dealt with.
    spent_s = after["processors"].cpu_s - before["processors"].cpu_s
    done = min(folded.values(), default=0)
    used["processors"]["us_a_folded"] = round(spent_s / done * 1e6, 1) if done > 0 else None
    complaints = []
    if late and result["late_ms_99"] > LATE_MS_MAX:
        complaints.append(f"the load was late: {result['late_ms_99']:.0f} ms at 99 %")
    if not setup.is_idle and sent < 0.85 * planned:  # machines that stand send less: 4 % of the time
        complaints.append(f"the load sent {sent} messages of {planned:.0f}")
    result["complaints"] = complaints
    return result


def _share(before: Usage, after: Usage, wall_s: float, messages: int) -> dict[str, Any]:
    spent_s = after.cpu_s - before.cpu_s
    return {
        "us_a_message": round(spent_s / messages * 1e6, 1) if messages else None,
        "cores": round(spent_s / wall_s, 4),
        "rss_mb": round(after.rss_mb, 1),
        "threads": after.threads,
        "switches_a_message": round((after.switches - before.switches) / messages, 3) if messages else None,
        "switches_a_second": round((after.switches - before.switches) / wall_s, 1),
    }


def quantiles(ages_s: "array[float]") -> dict[str, float] | None:
    """Return the ages' median, 95 % and 99 %, ms, and how many there are; None where nothing came."""
    if not ages_s:
        return None
    ordered = sorted(ages_s)
    at = {f"p{share}": round(1000.0 * ordered[min(len(ordered) - 1, len(ordered) * share // 100)], 1) for share in (50, 95, 99)}
    return {**at, "max": round(1000.0 * ordered[-1], 1), "count": len(ordered)}


def _received(seen: Seen) -> dict[str, int]:
    """Return how many messages of devices each processor has dealt with, those of other processors too."""
    return {node: values.get(EMITTED, 0) for node, values in seen.nodes.items() if EMITTED in values}


def health(seen: Seen) -> dict[str, dict[str, Any]]:
    """Return what each processor says of itself, and what its ledger misses."""
    told: dict[str, dict[str, Any]] = {}
    for node, values in sorted(seen.nodes.items()):
        own = {name.removeprefix("health/"): value for name, value in values.items() if name.startswith("health/")}
        if RECEIVED in values:
            own["received"], own["dropped"] = values[RECEIVED], values[DROPPED]
            own["reasons"] = {
                name.removeprefix(DROPPED_PREFIX): n for name, n in values.items() if name.startswith(DROPPED_PREFIX) and n
            }
            own["missing"] = values[RECEIVED] - values[EMITTED] - values[DROPPED] - values[BUFFERED]
        told[node] = own
    return told
