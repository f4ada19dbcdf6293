"""The cost of the folds on Kafka: a runner against a plain loop, the bridge, several runners, a rebalance. Prints Markdown.

    .venv/bin/python -m benchmarks.kafka                             # all of it, some ten minutes
    .venv/bin/python -m benchmarks.kafka --only runner --messages 30000 --rounds 1
    .venv/bin/python -m benchmarks.kafka --only bridge --machines 20,100,200 --prefer

One Kafka (tests/kafka/kafka_server.py) and one Mosquitto on this computer. The runner and its peer, a plain loop of
confluent-kafka that does the same without guarantees (benchmarks/kafka/fold.py), take turns on one log; medians are told.
CPU time is what the kernel counts for the whole process, all threads. On two cores Kafka, broker, load and runners are in
each other's way: figures beyond two runners say how well they share, not how far they scale.
"""

import argparse
import json
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import asdict
from itertools import count
from pathlib import Path
from statistics import median

from benchmarks.hall.machine import GROUP
from benchmarks.hall.usage import busy_s
from benchmarks.kafka.fold import Spent, Task
from benchmarks.kafka.log import Filled, fill
from benchmarks.kafka.plant import Live, plant
from benchmarks.kafka.scale import caught_up, home_of, pauses, settings_on
from cnctwin.kafka.assigned import by_topic
from cnctwin.kafka.topics import Topics, ensure
from processors.discovery import discover
from processors.running.runtime import configured
from tests.kafka.kafka_server import KafkaServer

PARTITIONS = 12
ALL = tuple(name for name in discover() if name != "historian")
"""All processors of a fleet but the historian, whose work is in its store."""
SETS: dict[str, tuple[str, ...]] = {
    "thermal": ("thermal",),
    "all but mirror": tuple(name for name in ALL if name != "mirror"),
    "all": ALL,
}
SCALED = ("cutting_force", "events", "gap", "rules", "thermal")
_names = (f"run{number}" for number in count(1))


def cells_of(names: Sequence[str]) -> list[str]:
    """Return the processors that read cells."""
    return [name for name in names if discover()[name].is_of_cells]


def table(head: Sequence[str], rows: Sequence[Sequence[str]]) -> None:
    """Print a table."""
    print("| " + " | ".join(head) + " |\n|" + "---|" * len(head))
    for row in rows:
        print("| " + " | ".join(row) + " |")
    print(flush=True)


class Log:
    """A log on a Kafka, to be folded again and again."""

    def __init__(self, kafka: KafkaServer, machines: int, messages: int) -> None:
        self.kafka, self.settings = kafka, settings_on(kafka.bootstrap, PARTITIONS)
        ensure(self.settings, Topics(GROUP), cells_of(ALL))
        self.filled: Filled = fill(self.settings, configured(ALL, None), machines, messages)

    def task(self, kind: str, names: Sequence[str], snapshot_s: float = 5.0) -> Task:
        """Return the task to fold it once more."""
        records = self.filled.records(by_topic(Topics(GROUP), configured(names, None)))
        return Task(kind, self.kafka.bootstrap, PARTITIONS, list(names), next(_names), records, snapshot_s)

    def folded(self, kind: str, names: Sequence[str], snapshot_s: float = 5.0) -> Spent:
        """Fold it in a process of its own."""
        task = json.dumps(asdict(self.task(kind, names, snapshot_s)))
        done = subprocess.run([sys.executable, "-m", "benchmarks.kafka.fold", task], capture_output=True, text=True, check=False)
        if done.returncode:
            raise SystemExit(f"{kind} of {', '.join(names)} failed: {done.stderr[-1000:]}")
        return Spent(**json.loads(done.stdout.splitlines()[-1]))

    def us(self, spent: Sequence[Spent]) -> float:
        """Return the CPU time of a machine's message, µs: the median of runs."""
        return median(one.cpu_s for one in spent) / self.filled.messages * 1e6


def runner(log: Log, options: argparse.Namespace) -> None:
    """Fold by the runner and by the plain loop in turns."""
    rows = []
    for told, names in SETS.items():
        spent: dict[str, list[Spent]] = {"plain": [], "runner": []}
        for _ in range(options.rounds):
            for kind, runs in spent.items():
                runs.append(log.folded(kind, names))
        own, peer = log.us(spent["runner"]), log.us(spent["plain"])
        last = spent["runner"][-1]
        results = f"{last.results / log.filled.messages:.2f}"
        rows.append(
            [told, f"{peer:.1f}", f"{own:.1f}", f"{own / peer:.2f} ×", results, str(last.committed), f"{last.rss_mb:.0f} MB"]
        )
    print(f"### Runner: CPU µs a message of a machine, {log.filled.messages} messages, medians of {options.rounds}\n")
    table(["processors", "plain loop", "runner", "", "results a message", "transactions", "memory"], rows)


def each(log: Log, options: argparse.Namespace) -> None:
    """Fold by a runner of every processor alone, then of all: the figures that `cnctwin plan fleet` rests on."""
    alone = {name: log.us([log.folded("runner", (name,)) for _ in range(options.rounds)]) for name in ALL}
    together = log.us([log.folded("runner", ALL) for _ in range(options.rounds)])
    # Alone, each pays what is shared; together it is paid once.
    shared = min(max(0.0, (sum(alone.values()) - together) / (len(alone) - 1)), *alone.values())
    print(f"read_us={shared:.1f}\nfold_us={ {name: round(us - shared, 1) for name, us in alone.items()} }")
    print(f"sum {shared + sum(us - shared for us in alone.values()):.0f} us, together {together:.0f} us\n", flush=True)


def snapshots(log: Log, options: argparse.Namespace) -> None:
    """Fold with states cut often and seldom."""
    spent: dict[float, list[Spent]] = {1.0: [], 5.0: [], 30.0: []}
    names = SETS["all but mirror"]
    for _ in range(options.rounds):
        for snapshot_s, runs in spent.items():
            runs.append(log.folded("runner", names, snapshot_s))
    rows = []
    for snapshot_s, runs in spent.items():
        states, size = median(one.snapshots for one in runs), median(one.snapshot_bytes / max(one.snapshots, 1) for one in runs)
        rows.append([f"{snapshot_s:g} s", f"{log.us(runs):.1f}", f"{states:.0f}", f"{size:.0f}"])
    print("### States, cut every so often: CPU µs a message while the log is caught up with, all processors but mirror\n")
    table(["snapshot_s", "µs a message", "states saved", "bytes of one"], rows)
    often, seldom = spent[1.0], spent[30.0]
    more = median(one.snapshots for one in often) - median(one.snapshots for one in seldom)
    if more > 0:
        us = (median(one.cpu_s for one in often) - median(one.cpu_s for one in seldom)) / more * 1e6
        print(f"One state costs about {us:.0f} µs.\n", flush=True)


def lived(options: argparse.Namespace, folder: Path, machines: int, names: Sequence[str]) -> Live:
    """Return the figures of a plant that runs."""
    with plant(folder, cells=cells_of(names), prefer=options.prefer) as running:
        running.bridge(names or ("thermal",), results="all" if names else "none")
        time.sleep(3.0)
        if names:
            running.runner("r0", names)
            time.sleep(4.0)
        running.bear(machines, 10.0)
        time.sleep(6.0)
        return running.look(options.seconds)


def bridge(options: argparse.Namespace, folder: Path) -> None:
    """Measure bridge, runner, Kafka and Mosquitto under the load of machines at 10 Hz."""
    rows, homes = [], count()
    wanted = [(int(one), ()) for one in options.machines.split(",")]
    folded = [(100, SETS["thermal"]), (20, SETS["all but mirror"]), (100, SETS["all but mirror"]), (20, SETS["all"])]
    for machines, names in [*wanted, *folded]:
        live = lived(options, folder / f"live{next(homes)}", machines, names)
        told = next((label for label, one in SETS.items() if one == names), "nobody")
        parts = [f"{live.us[name]:.0f}" if name in live.us else "–" for name in ("bridge", "r0", "kafka", "mosquitto")]
        size = " + ".join(f"{live.kafka_bytes.get(name, 0.0):.0f}" for name in ("readings", "results", "snapshots"))
        busy = [f"{live.lag_s:.2f} s", f"{live.elsewhere:.2f}", f"{live.late_ms:.0f} ms"]
        rows.append([str(machines), told, *parts, size, *busy])
    print(f"### Plant at 10 Hz: CPU µs a message of a machine, windows of {options.seconds:g} s\n")
    head = ["machines", "folded by", "bridge", "runner", "Kafka", "Mosquitto", "B a message: readings + results + states"]
    table([*head, "lag", "cores elsewhere", "load late, 99 %"], rows)


def scale(log: Log, _: argparse.Namespace) -> None:
    """Catch up with the log by several runners."""
    rows = []
    for runners in (1, 2, 4):
        rate, us, cores = caught_up(log.task("member", SCALED), log.settings, SCALED, runners)
        rows.append([str(runners), f"{rate:.0f}", f"{us:.0f}", f"{cores:.2f}"])
    print(f"### Several runners of {', '.join(SCALED)} on one log; Kafka is on the same two cores\n")
    table(["runners", "records a second", "CPU µs a record, all together", "cores"], rows)


def rebalance(options: argparse.Namespace, folder: Path) -> None:
    """Let a runner join and leave while machines send."""
    names = SETS["thermal"]
    with plant(folder / "rebalance", prefer=options.prefer) as running:
        running.bridge(names, results="all")
        time.sleep(3.0)
        running.runner("r0", names)
        time.sleep(4.0)
        running.bear(20, 10.0)
        time.sleep(5.0)
        found = pauses(running, names, 12.0)
    print("### Rebalance: longest time without a commit, 20 machines at 10 Hz, thermal, 12 partitions\n")
    table(["", "of one partition", "of all"], [[told, f"{one:.2f} s", f"{whole:.2f} s"] for told, (one, whole) in found.items()])


def parts(options: argparse.Namespace, folder: Path) -> Iterator[tuple[str, Callable[[], None]]]:
    """Yield what is to be measured, by name; those that fold a log share one Kafka."""
    on_log = {"runner": runner, "snapshots": snapshots, "scale": scale, "each": each}
    wanted = [name for name in on_log if options.only in ("", name)]
    if wanted:
        with KafkaServer(home_of(folder, "log")) as kafka:
            log = Log(kafka, 100, options.messages)
            for name in wanted:
                yield name, lambda name=name: on_log[name](log, options)  # type: ignore[misc]
    for name, measure in {"bridge": bridge, "rebalance": rebalance}.items():
        if options.only in ("", name):
            yield name, lambda measure=measure: measure(options, folder)  # type: ignore[misc]


def main() -> None:
    """Measure, and print what was found."""
    parser = argparse.ArgumentParser(description="The cost of the folds on Kafka")
    parser.add_argument("--only", default="", choices=["", "runner", "snapshots", "scale", "each", "bridge", "rebalance"])
    parser.add_argument("--messages", type=int, default=100_000, help="of 100 machines, in the log that is folded")
    parser.add_argument("--rounds", type=int, default=3)
    parser.add_argument("--machines", default="20,100,200", help="of the bridge's trials, with commas")
    parser.add_argument("--seconds", type=float, default=15.0, help="of the bridge's windows")
    parser.add_argument(
        "--prefer", action="store_true", help="give what is measured precedence on a computer that others use (root)"
    )
    options = parser.parse_args()
    with tempfile.TemporaryDirectory(prefix="cnctwin-kafka-") as folder:
        for name, measure in parts(options, Path(folder)):
            began_s, busy = time.monotonic(), busy_s()
            measure()
            wall_s = time.monotonic() - began_s
            print(f"({name}: {wall_s:.0f} s, {(busy_s() - busy) / wall_s:.2f} cores busy, this run included)\n", flush=True)


if __name__ == "__main__":
    main()
