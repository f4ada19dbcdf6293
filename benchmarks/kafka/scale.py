"""The speed of several runners on one log, and how long no results are committed while a runner joins or leaves."""

import json
import subprocess
import sys
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import asdict, replace
from pathlib import Path

from confluent_kafka import Consumer, KafkaException, TopicPartition

from benchmarks.hall.machine import GROUP
from benchmarks.hall.usage import usage_of
from benchmarks.kafka.fold import Task
from benchmarks.kafka.plant import Plant
from cnctwin.kafka.settings import KafkaSettings
from cnctwin.kafka.topics import Topics

LOOK_S = 0.02
LIMIT_S = 300.0
BEGIN_SHARE, END_SHARE = 0.3, 0.9
"""The stretch of the log that is timed: all runners have started, and none has run out of records."""


class Committed:
    """The positions that a consumer group has committed on the readings."""

    def __init__(self, settings: KafkaSettings, group: str) -> None:
        self._consumer = Consumer(settings.client() | {"group.id": group, "enable.auto.commit": False})
        self._places = [TopicPartition(Topics(GROUP).readings, number) for number in range(settings.partitions)]

    def now(self) -> list[int]:
        """Return the position of each partition; while the group's coordinator is away, nothing."""
        try:
            return [max(one.offset, 0) for one in self._consumer.committed(self._places, 5.0)]
        except KafkaException:
            return []

    def close(self) -> None:
        """Leave."""
        self._consumer.close()


def caught_up(task: Task, settings: KafkaSettings, processors: Sequence[str], runners: int) -> tuple[float, float, float]:
    """Return records a second by which so many runners catch up together, CPU µs a record, and their cores while they did."""
    folds = [replace(task, kind="member", member=f"r{number}", processors=list(processors)) for number in range(runners)]
    started = [subprocess.Popen([sys.executable, "-m", "benchmarks.kafka.fold", json.dumps(asdict(one))]) for one in folds]
    committed = Committed(settings, Topics(task.run).runners(processors))
    try:
        until_s = time.monotonic() + LIMIT_S
        first = _reached(committed, BEGIN_SHARE * task.records, until_s)
        began_s, before = time.monotonic(), sum(usage_of(one.pid).cpu_s for one in started)
        last = _reached(committed, END_SHARE * task.records, until_s)
        wall_s, spent_s = time.monotonic() - began_s, sum(usage_of(one.pid).cpu_s for one in started) - before
    finally:
        committed.close()
        for one in started:
            one.terminate()
        for one in started:
            one.wait(60.0)
    return (last - first) / wall_s, spent_s / (last - first) * 1e6, spent_s / wall_s


def _reached(committed: Committed, records: float, until_s: float) -> int:
    """Wait until so many records are committed, and return how many are."""
    done = 0
    while done < records and time.monotonic() < until_s:
        time.sleep(LOOK_S)
        done = sum(committed.now()) or done
    return done


@contextmanager
def runner_of(plant: Plant, name: str, processors: Sequence[str]) -> Iterator[None]:
    """Have a runner until the block ends; then it leaves in order."""
    plant.runner(name, processors)
    try:
        yield
    finally:
        plant.children.pop(name).stop()


def pauses(plant: Plant, processors: Sequence[str], seconds: float) -> dict[str, tuple[float, float]]:
    """Return for each change the longest pause of a partition and of all of them, s, while machines send; one runner is there."""
    committed = Committed(plant.settings, Topics(GROUP).runners(processors))
    found: dict[str, tuple[float, float]] = {}
    try:
        found["nothing changes"] = _pause(committed, seconds)
        plant.runner("r1", processors)
        found["a second runner joins"] = _pause(committed, seconds)
        child = plant.children.pop("r1")
        assert child.pid is not None
        subprocess.run(["kill", "-TERM", str(child.pid)], check=True)
        found["it leaves in order"] = _pause(committed, seconds)
        child.stop()
    finally:
        committed.close()
    return found


def _pause(committed: Committed, seconds: float) -> tuple[float, float]:
    until_s = time.monotonic() + seconds
    before = committed.now()
    since = [time.monotonic()] * len(before)
    longest, longest_of_all = 0.0, 0.0
    while (now_s := time.monotonic()) < until_s:
        at = committed.now() or before
        longest_of_all = max(longest_of_all, now_s - max(since))
        for number, offset in enumerate(at):
            if offset != before[number]:
                longest = max(longest, now_s - since[number])
                since[number] = now_s
        before = at
        time.sleep(LOOK_S)
    return max(longest, until_s - min(since)), longest_of_all


def settings_on(bootstrap: str, partitions: int) -> KafkaSettings:
    """Return the settings of one broker."""
    return KafkaSettings(bootstrap=bootstrap, partitions=partitions, replication_factor=1, session_s=10.0)


def home_of(folder: Path, name: str) -> Path:
    """Return a new folder."""
    home = folder / name
    home.mkdir(parents=True)
    return home
