"""The kill run: bridge, runner and Kafka are killed in turn while machines talk, and nothing may be lost, doubled or different.

    scripts/kill-run                                   # 100 machines at 10 Hz, 15 minutes, a kill every 30 s
    python -m benchmarks.kafka.kill_run --minutes 2 --machines 10 --every 10
    python -m benchmarks.kafka.kill_run --kills kafka --away 600 --minutes 1.5 --machines 20
    python -m benchmarks.kafka.kill_run --takeover --machines 20 --minutes 5 --every 60
    python -m benchmarks.kafka.kill_run --keep-session --machines 50 --minutes 2 --processors thermal,rules,alerts,mirror

Real Kafka and Mosquitto, `cnctwin bridge` and `cnctwin process` as processes; each is killed by -9 and begun again at once, as a
supervisor would. At the end all records of the log are folded again by this process alone, and compared with the states and the
results that the run has left. With --takeover there are two runners, and only they are killed, each for 20 s. With --keep-session
the MQTT broker, which is not killed, keeps what it cannot deliver to the bridge, and no message at all may be missing.

Needs Java 17 and Maven for Kafka, Mosquitto, and the extra `kafka`. Exits with 1 where anything is lost, doubled or different.
"""

import argparse
import os
import shutil
import sys
import tempfile
import time
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from statistics import median

from confluent_kafka.admin import AdminClient

from benchmarks.hall.machine import GROUP, name_of
from benchmarks.kafka.inputs import Inputs, Kill, Missing
from benchmarks.kafka.notices import Notices, judged
from benchmarks.kafka.replay import Difference, Found, Replay, Stood
from benchmarks.kafka.supervised import PROCESSORS, Plant, Setup
from benchmarks.kafka.watcher import Awaited, Watcher
from benchmarks.kafka.webhook import Webhook
from benchmarks.kafka.whole_log import behind
from benchmarks.kafka.witness import Witness
from cnctwin.kafka.topics import Topics, cell_processors
from processors.running.runtime import configured

UP_S_MAX = 60.0
SETTLE_S = 8.0
DRAIN_S_MAX = 600.0
AWAY_S = 20.0
AIM_S = {"runner": 2.0, "takeover": 12.0}


@dataclass(slots=True)
class Course:
    """The course of a run: what was waited for after each kill, and when the bridge was away."""

    awaited: dict[str, list[Awaited]] = field(default_factory=dict)
    kafka_up_s: list[float] = field(default_factory=list)
    bridge_kills: list[Kill] = field(default_factory=list)
    counts: dict[str, int] = field(default_factory=dict)
    results: int = 0
    lag_s: float = 0.0
    statuses: dict[str, int] = field(default_factory=dict)
    left: int = 0

    def note(self, name: str, *awaited: Awaited) -> None:
        """Keep what is waited for under a name."""
        self.awaited.setdefault(name, []).extend(awaited)


class KillRun:
    """See the module."""

    def __init__(self, setup: Setup, home: Path) -> None:
        self.setup, self.course, self.webhook = setup, Course(), Webhook()
        self.plant = Plant(setup, home, self.webhook.url)
        self.pairs = configured(setup.processors, self.plant.config)
        self.topics = Topics(GROUP)
        self.read = [self.topics.readings, *map(self.topics.cells, cell_processors(self.pairs))]
        self._turn = 0

    def run(self) -> bool:
        """Run, compare and tell; return True where all is as it should be."""
        try:
            self.plant.start()
            self._await_topics()
            self.watcher = Watcher(
                self.plant.kafka.bootstrap, self.topics, self.setup.partitions, frozenset(cell_processors(self.pairs))
            )
            self.witness = Witness(self.plant.mqtt.port, [name_of(number) for number in range(self.setup.machines)])
            self._until("the bridge is on the broker", lambda: self.watcher.readings > 0)
            began_s = time.time()
            self.plant.bear()
            first = self.watcher.first_result(began_s)
            self._until("a result stands in the log", lambda: first.came_s is not None)
            self._kill_in_turn()
            self._drain()
            return self._judge()
        finally:
            if hasattr(self, "witness"):
                self.witness.stop()
            self.plant.stop()
            self.webhook.stop()

    def _await_topics(self) -> None:
        admin = AdminClient({"bootstrap.servers": self.plant.kafka.bootstrap, "log_level": 0})
        wanted = set(self.topics.all(cell_processors(self.pairs)))
        self._until("the topics are there", lambda: wanted <= admin.list_topics(timeout=10.0).topics.keys())

    def _until(self, what: str, is_so: Callable[[], bool], most_s: float = UP_S_MAX) -> None:
        until_s = time.monotonic() + most_s
        while not is_so():
            if time.monotonic() > until_s:
                raise SystemExit(f"after {most_s:g} s it is not so that {what}: {self.plant.bridge.last_words()}")
            self.plant.watch()
            time.sleep(0.05)

    # The kills.

    def _kill_in_turn(self) -> None:
        """Kill one after the other; the last one has as much time as the others."""
        setup = self.setup
        ways = {"bridge": self._kill_bridge, "runner": self._kill_runner, "kafka": self._kill_kafka, "takeover": self._takeover}
        kills = [ways[name] for name in setup.kills]
        began_s = time.monotonic()
        due_s = began_s + setup.every_s
        while due_s + setup.every_s <= began_s + setup.minutes * 60.0 + 1.0:
            self._rest(due_s)
            kills[self._turn % len(kills)]()
            self._turn += 1
            self._say()
            due_s = max(due_s + setup.every_s, time.monotonic() + setup.every_s / 2)
        self._rest(max(began_s + setup.minutes * 60.0, time.monotonic() + setup.every_s / 2))

    def _rest(self, until_s: float) -> None:
        while (left_s := until_s - time.monotonic()) > 0:
            self.plant.watch()
            self.course.lag_s = max(self.course.lag_s, self.watcher.lag_s)
            time.sleep(min(left_s, 0.5))

    def _kill_bridge(self) -> None:
        killed_ms = time.time_ns() // 1_000_000
        self.plant.bridge.kill()
        began_s = self.plant.bridge.start()
        self.course.bridge_kills.append(Kill(killed_ms, round(began_s * 1000)))
        self.course.note("bridge", self.watcher.first_data(began_s))
        self._count("bridge")

    def _kill_runner(self) -> None:
        runner = self.plant.runners[self.setup.members[0]]
        runner.kill()
        began_s = runner.start()
        self.course.note("runner", self.watcher.first_result(began_s))
        self.course.note("runner, live again", self.watcher.first_result(began_s, is_fresh=True))
        self._count("runner")

    def _kill_kafka(self) -> None:
        self.plant.kill_kafka()
        self._rest(time.monotonic() + self.setup.away_s)
        began_s = time.time()  # what stands in the log by now was there before
        awaited = self.watcher.first_result(began_s), self.watcher.first_data(began_s)
        self.plant.start_kafka()
        self.course.kafka_up_s.append(time.time() - began_s)
        self.course.note("kafka", awaited[0])
        self.course.note("kafka, bridge's data", awaited[1])
        self._count("kafka")

    def _takeover(self) -> None:
        member = self.setup.members[self._turn % 2]
        places = self.watcher.places_of(member)
        self.plant.runners[member].kill()
        killed_s = time.time()
        for awaited in self.watcher.results_of(places, killed_s, but=member).values():
            self.course.note("takeover", awaited)
        print(f"killed {member}, which had {len(places)} partitions", flush=True)
        time.sleep(AWAY_S)
        self.plant.runners[member].start()
        self._count("runner, for 20 s")

    def _count(self, name: str) -> None:
        self.course.counts[name] = self.course.counts.get(name, 0) + 1

    def _say(self) -> None:
        lag_s = self.watcher.lag_s
        print(f"{time.strftime('%H:%M:%S')} kill {self._turn}: {self.watcher.results} results, lag {lag_s:.2f} s", flush=True)

    # The end.

    def _drain(self) -> None:
        """Let everything come to its end, then stop: load, bridge, runners."""
        self.plant.end_load()
        group = self.topics.runners(self.setup.processors)
        until_s, quiet_s, before = time.monotonic() + DRAIN_S_MAX, time.monotonic(), (0, 0)
        while time.monotonic() < until_s and time.monotonic() - quiet_s < SETTLE_S:
            self.plant.watch()
            now = len(self.watcher.emitted), len(self.webhook.received)
            if now != before or self.watcher.lag_s > SETTLE_S:
                before, quiet_s = now, time.monotonic()
            time.sleep(0.2)
        course = self.course
        course.statuses["bridge"] = self.plant.bridge.stop()
        while (
            left := behind(self.plant.kafka.bootstrap, group, self.read, self.setup.partitions)
        ) and time.monotonic() < until_s:
            time.sleep(0.5)
        course.left = left
        self.seconds, self.busy_pct = self.plant.busy()
        for member, runner in self.plant.runners.items():
            course.statuses[member] = runner.stop()
        course.results = self.watcher.results
        self.watcher.stop()

    def _judge(self) -> bool:
        noted = self.witness.noted()
        print("the log is read and folded again …", flush=True)
        stood, inputs = Stood(self.plant.kafka.bootstrap, self.topics, self.setup.partitions), Inputs()
        emitted = stood.emitted
        found = Replay(self.plant.kafka.bootstrap, self.topics, self.pairs, self.setup.partitions).compared(stood, inputs)
        missing = inputs.missing(noted, self.course.bridge_kills)
        notices = judged(emitted, self.webhook.received, noted.fates)
        table = Table(self, found, inputs, missing=missing, notices=notices, seen=noted.count)
        table.print()
        return table.is_well


class Table:
    """Return the outcome of a run, as Markdown."""

    def __init__(self, run: KillRun, found: Found, inputs: Inputs, *, missing: Missing, notices: Notices, seen: int) -> None:
        """`seen`: the data messages that the witness saw."""
        self.is_well = True
        self._run, self._found, self._inputs = run, found, inputs
        self._missing, self._notices, self._seen = missing, notices, seen
        self._faults: list[str] = []

    def print(self) -> None:
        """Print it, and what went wrong below it."""
        print("\n| what | figure | as it should be |\n|---|---|---|")
        self._of_run()
        self._of_folds()
        self._of_inputs()
        self._of_notices()
        self._of_recovery()
        for fault in self._faults:
            print(f"\n{fault}")
        print(f"\n{'nothing is lost, doubled or different' if self.is_well else 'FAILED'}", flush=True)

    def _row(self, what: str, figure: object, is_right: bool | None = None, why: str = "") -> None:
        mark = "" if is_right is None else "yes" if is_right else "**no**"
        print(f"| {what} | {figure} | {mark} |")
        if is_right is False:
            self.is_well = False
            if why:
                self._faults.append(f"{what}: {why}")

    def _of_run(self) -> None:
        run, course = self._run, self._run.course
        setup, plant = run.setup, run.plant
        kills = ", ".join(f"{name} {count} ×" for name, count in course.counts.items())
        kept = ", a session that the broker keeps" if setup.keeps_session else ""
        self._row("run", f"{setup.machines} machines, {setup.hz:g} Hz, {run.seconds / 60:.1f} min{kept}")
        self._row("killed by -9", kills or "nothing")
        self._row("computer", f"{os.cpu_count()} processors, {run.busy_pct:.0f} % busy (with whatever else ran)")
        use = [f"{one.name} {100 * one.cpu_s / run.seconds:.0f} %" for one in (plant.bridge, *plant.runners.values())]
        self._row("CPU of one processor", ", ".join(use))
        self._row("oldest result at its commit, between the kills", f"{course.lag_s:.1f} s")
        statuses = ", ".join(f"{name} {status}" for name, status in course.statuses.items())
        self._row("processes that ended by themselves", plant.ended.total(), plant.ended.total() == 0, str(dict(plant.ended)))
        self._row("exit at SIGTERM", statuses, not any(course.statuses.values()))
        self._row("records that the runners left", course.left, course.left == 0)

    def _of_folds(self) -> None:
        found = self._found
        self._row("records folded again", f"{found.records:,} in {found.took_s:.0f} s")
        self._row("unreadable records", found.unreadable, found.unreadable == 0)
        self._difference("states", found.states)
        counts = ", ".join(f"{name} {count:,}" for name, count in sorted(found.by_processor.items()))
        self._row("results of the replay", counts, found.results.expected > 0)
        self._difference("results", found.results)
        self._difference("dead letters", found.dead_letters)

    def _difference(self, what: str, one: Difference) -> None:
        self._row(f"{what} compared", f"{one.expected:,}")
        figure = f"{one.lost} lost, {one.extra} doubled or foreign, {one.different} different"
        self._row(f"{what} that differ", figure, one.total == 0, one.first)

    def _of_inputs(self) -> None:
        inputs, missing, seen = self._inputs, self._missing, self._seen
        self._row("records of the log that were there already, dropped", self._found.repeated)
        self._row("gaps in the numbers of a life without a hole", inputs.gaps, inputs.gaps == 0, inputs.first_gap)
        self._row("holes told", inputs.holes)
        is_kept = self._run.setup.keeps_session
        is_whole = seen > 0 and (not is_kept or inputs.data == seen)
        self._row("data messages: witness saw, log holds", f"{seen:,}, {inputs.data:,}", is_whole)
        away = "missing: bridge away, or births not asked for yet" + ("" if is_kept else " (QoS 0)")
        self._row(away, missing.unbridged, missing.unbridged == 0 if is_kept else None)
        on_its_way = "missing: on the way through a bridge that was killed"
        self._row(on_its_way, missing.in_memory, missing.in_memory == 0 if is_kept else None)
        self._row("missing otherwise", missing.otherwise, missing.otherwise == 0, missing.first)
        if missing.blind_s:
            figure = f"{median(missing.blind_s):.2f} s, at most {max(missing.blind_s):.2f} s"
            self._row("kill of a bridge to a machine's first data again, median", figure)

    def _of_notices(self) -> None:
        one = self._notices
        if "alerts" not in self._run.setup.processors:
            return
        self._row("notifications made", one.emitted, one.emitted > 0, "no alarm was raised: this run shows nothing about alerts")
        self._row("delivered; failed, of these came all the same", f"{one.delivered}; {one.failed}, {one.failed_yet_came}")
        self._row("alerts told as firing, as resolved", f"{one.firing}, {one.resolved}")
        figure = f"{one.left_out}; {one.unseen} for that or a failure, {one.passed} over before anybody was told"
        self._row("alerts that bodies left out; resolved without having been seen firing", figure)
        figure = f"{one.doubled} doubled, {one.lost} without a fate, {one.unknown} unknown, {one.disordered} out of order"
        self._row("notifications amiss", figure, one.faults == 0, one.first)

    def _of_recovery(self) -> None:
        names = {
            "runner": "runner: start of the same member to the first committed result",
            "runner, live again": "runner: start to the first result of an input after it",
            "bridge": "bridge: start to the first data in the log",
            "kafka": "Kafka: restart to the first committed result",
            "kafka, bridge's data": "Kafka: restart to the first data in the log",
            "takeover": "takeover: kill to committed results of each partition",
        }
        for name, awaited in self._run.course.awaited.items():
            times = [one.took_s for one in awaited if one.took_s is not None]
            never = len(awaited) - len(times)
            figure = f"median {median(times):.2f} s, at most {max(times):.2f} s of {len(times)}" if times else "never"
            aim = (
                f" (aim {AIM_S[name]:g} s: {'kept' if times and max(times) <= AIM_S[name] else 'missed'})"
                if name in AIM_S
                else ""
            )
            self._row(names[name], figure + aim, None if not never else False, f"{never} of {len(awaited)} never")
        if self._run.course.kafka_up_s:
            self._row("Kafka: restart until it answers", f"median {median(self._run.course.kafka_up_s):.2f} s")


def main() -> None:
    """Run as the options say; exits with 1 where anything is lost, doubled or different."""
    defaults = Setup()
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("--machines", type=int, default=defaults.machines)
    parser.add_argument("--hz", type=float, default=defaults.hz)
    parser.add_argument("--minutes", type=float, default=defaults.minutes)
    parser.add_argument("--every", type=float, default=defaults.every_s, help="seconds between two kills")
    parser.add_argument("--partitions", type=int, default=defaults.partitions)
    parser.add_argument("--processors", default=",".join(PROCESSORS), help="names, with commas between")
    # The one broker is the whole cluster: while it is away nobody can say that he lives, so a session outlasts its restart.
    parser.add_argument("--kills", default="bridge,runner,kafka", help="what is killed in turn")
    parser.add_argument("--takeover", action="store_true", help="two runners, of which one is killed for 20 s")
    parser.add_argument(
        "--keep-session", action="store_true", help="the broker keeps the bridge's session: nothing may be missing"
    )
    parser.add_argument("--away", type=float, default=defaults.away_s, help="seconds for which a killed Kafka stays away")
    parser.add_argument("--home", type=Path, help="where logs and data are kept, even where all is well")
    parser.add_argument("--session", type=float, help="session_s of the runners; else 30, and 6 with --takeover")
    given = parser.parse_args()
    setup = Setup(
        machines=given.machines,
        hz=given.hz,
        minutes=given.minutes,
        every_s=given.every,
        partitions=given.partitions,
        processors=tuple(one.strip() for one in given.processors.split(",") if one.strip()),
        members=("r0", "r1") if given.takeover else ("r0",),
        session_s=given.session or (6.0 if given.takeover else defaults.session_s),
        kills=("takeover",) if given.takeover else tuple(given.kills.split(",")),
        keeps_session=given.keep_session,
        away_s=given.away,
    )
    home = Path(tempfile.mkdtemp(prefix="cnctwin-kills-")) if given.home is None else given.home
    home.mkdir(parents=True, exist_ok=True)
    is_well = False
    try:
        is_well = KillRun(setup, home).run()
    finally:
        if given.home is None and is_well:
            shutil.rmtree(home)
        else:
            print(f"logs and data: {home}", flush=True)
    sys.exit(0 if is_well else 1)


if __name__ == "__main__":
    main()
