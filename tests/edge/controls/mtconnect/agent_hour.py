"""An hour of a machine in seconds: the real agent behind a real HTTP socket, the real connection, parser and pipeline, and a link
between them that does wrong at moments that a seed decides.

The machine's time passes when lines are handed to the agent. Where the link is well, each stretch of them has arrived before
the next begins; while it is not, the machine goes on.
"""

import random
import re
import threading
import time
from collections import Counter
from dataclasses import dataclass, field

from cnctwin.standins.mtconnect_agent.agent import Agent
from cnctwin.standins.mtconnect_agent.device_model import read_device_model
from cnctwin.standins.mtconnect_agent.dialect import dialect
from cnctwin.standins.mtconnect_agent.observation import Observation
from cnctwin.standins.mtconnect_agent.server import AgentServer
from cnctwin.standins.mtconnect_agent.shdr import parse_line
from cnctwin.standins.simulated_control.state import production_moments
from cnctwin.standins.simulated_machine.description import DEVICES
from cnctwin.standins.simulated_machine.moment import Adapter, Moment
from edge.config import EdgeConfig
from edge.controls.mtconnect.config import MtconnectConfig
from edge.controls.mtconnect.connection import MtconnectConnection
from edge.controls.mtconnect.cursor import Config, parse, start
from edge.controls.mtconnect.state import Phase
from edge.running.ledger import Ledger
from edge.running.pipeline import Pipeline
from edge.sample import Drop, EdgeSample, Gap
from tests.edge.controls.mtconnect.faulty_link import FaultyLink
from tests.edge.controls.mtconnect.mischief import Episode, episodes
from tests.wire.mosquitto import free_port

SWITCHED_ON_S = 1_767_225_600.0
BUFFER_SIZE = 1024  # of the agent: about half a minute of this machine
FASTER = 25.0  # so much shorter than in a plant the pauses of the connection are
ARRIVAL_S_MAX = 20.0
STRETCH_S = (0.3, 6.0)
_SEQUENCE = re.compile(rb' sequence="(\d+)"')


@dataclass(frozen=True, slots=True)
class Hole:
    """A hole as stated, and in which instance's numbers."""

    instance: str
    gap: Gap


@dataclass
class Hour:
    """What was told, what became of it, and what was wrong meanwhile. Times in seconds since the machine was switched on."""

    moments: list[Moment]
    observations: dict[str, dict[int, Observation]] = field(default_factory=dict)
    joined: tuple[str, int] = ("", 0)
    taken: list[tuple[str, EdgeSample]] = field(default_factory=list)
    documented: dict[str, set[int]] = field(default_factory=dict)
    published: list[EdgeSample] = field(default_factory=list)
    holes: list[Hole] = field(default_factory=list)
    episodes: list[Episode] = field(default_factory=list)
    without_adapter: list[tuple[float, float]] = field(default_factory=list)
    errors: Counter[str] = field(default_factory=Counter)
    dropped: Counter[Drop] = field(default_factory=Counter)
    ledger: dict[str, int] = field(default_factory=dict)
    differences: set[int] = field(default_factory=set)
    unaccounted: int = 0
    frames: int = 0
    reconnects: int = 0

    def kinds(self) -> Counter[str]:
        """Return how many episodes there were of each kind."""
        return Counter(episode.name.partition(":")[0] for episode in self.episodes)


class Watch:
    """The edge: reads in a thread of its own what `EdgeRuntime` would, with nobody to publish to."""

    def __init__(self, config: Config, hour: Hour, seed: int) -> None:
        self.settled_s = 0.0  # up to here all that was told has arrived
        self.cursor = start(config)
        self.error: BaseException | None = None
        self._config, self._hour = config, hour
        self.connection = MtconnectConnection(config, wait=lambda s: time.sleep(s / FASTER), chance=random.Random(seed))
        self._thread = threading.Thread(target=self._run, name="hour-edge")

    def start(self) -> None:
        """Begin to read."""
        self._thread.start()

    def close(self) -> None:
        """End the edge."""
        self.connection.close()
        self._thread.join(10.0)
        assert not self._thread.is_alive()
        self._hour.reconnects = self.connection.reconnects
        if self.error is not None:
            raise self.error

    def _run(self) -> None:
        try:
            self._read()
        except BaseException as error:
            self.error = error

    def _read(self) -> None:
        hour, pipeline, ledger, newest_s = self._hour, Pipeline(self._config), Ledger(), 0.0
        self.connection.follow(self.cursor)
        for raw in self.connection.frames():
            cursor, given = parse(self._config, self.cursor, raw)
            self.connection.follow(cursor)
            ledger.queue(given.received)
            if given.newest_ms is not None:
                newest_s = max(newest_s, given.newest_ms / 1000 - SWITCHED_ON_S)
            outcome = pipeline.take(given, max(self.settled_s, newest_s))
            emitted = [sample for row in outcome.rows for sample in row]
            count = sum(sample.observations for sample in emitted)
            ledger.settle(taken=given.received, emitted=count, dropped=outcome.dropped, held=pipeline.held)
            hour.ledger = ledger.snapshot()
            hour.differences.add(Ledger.difference(hour.ledger))
            hour.unaccounted += not given.accounted()
            hour.frames += 1
            hour.dropped += outcome.dropped
            hour.errors[given.error or ""] += 1
            hour.published += emitted
            hour.taken += [(cursor.instance_id, sample) for sample in given.samples]
            hour.holes += [Hole(cursor.instance_id, gap) for gap in given.gaps]
            if given.error is None and given.received:
                hour.documented.setdefault(cursor.instance_id, set()).update(map(int, _SEQUENCE.findall(raw)))
            if cursor.phase is Phase.SAMPLE and not hour.joined[0]:
                hour.joined = cursor.instance_id, cursor.next_sequence
            self.cursor = cursor


class Shop:
    """The machine, its agent, and the one who plays tricks on them."""

    def __init__(self, seconds: float, seed: int, *, pause_s: float, is_polled: bool, is_well: bool) -> None:
        self.chance, self.now_s = random.Random(seed), 0.0
        self.hour = Hour(list(production_moments(seconds)))
        self._pause_s, self._is_well, self._until_s = pause_s, is_well, seconds
        self._adapter, self._told = Adapter(SWITCHED_ON_S), 0
        spoken = dialect("1.4" if seed % 2 else "2.3")
        model = read_device_model(DEVICES.read_text(encoding="utf-8"), spoken.schema)
        self.agent = Agent(model, model.devices[0], spoken, buffer_size=BUFFER_SIZE, assets_max=4, now=self._wall_s)
        self._port = free_port()
        self._server: AgentServer | None = AgentServer(self.agent, port=self._port, clients_max=8)
        self._server.start()
        self.link = FaultyLink(self._port, is_polled=is_polled)
        source = {"url": self.link.url, "interval_ms": 1, "heartbeat_ms": 100, "timeout_s": 0.3, "poll_ms": 50}
        self._watch = Watch(EdgeConfig(source=MtconnectConfig.model_validate(source)), self.hour, seed)

    def __enter__(self) -> "Shop":
        self.link.start()
        self._watch.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._watch.close()
        self.stop()
        self.link.close()

    def _wall_s(self) -> float:
        return SWITCHED_ON_S + self.now_s

    def work(self) -> None:
        """Until the time is over."""
        plan = episodes(self.chance)
        self._advance(2.0)
        self.arrived()
        while self.now_s < self._until_s - 5.0:
            due_s = self.now_s + self._pause_s * self.chance.uniform(0.5, 1.5)
            while self.now_s < min(due_s, self._until_s):
                self._advance(self.chance.uniform(*STRETCH_S))
                self.arrived()
            episode = next(plan)
            if self._is_well or self.now_s + episode.lasts_s > self._until_s - 20.0:
                continue
            self.hour.episodes.append(episode)
            episode.begin(self)
            ends_s, until_s = self.now_s + episode.lasts_s, time.monotonic() + episode.real_s
            while self.now_s < ends_s:
                self._advance(self.chance.uniform(*STRETCH_S))
                time.sleep(0.002)
            time.sleep(max(until_s - time.monotonic(), 0.0))
            episode.end(self)
            self.arrived()
        self._advance(self._until_s - self.now_s + 1.0)
        self.arrived()
        time.sleep(0.25)  # heartbeats: time passes
        self._collect()

    def _advance(self, seconds: float) -> None:
        """The machine works for so long."""
        self.now_s += seconds
        with self.agent.changed:
            while self._told < len(self.hour.moments) and self.hour.moments[self._told].at_s <= self.now_s:
                line = self._adapter.line(self.hour.moments[self._told])
                if line is not None:
                    self.agent.receive(parse_line(line))
                self._told += 1
            self._collect()

    def _collect(self) -> None:
        """Keep what the agent has stored; a stretch is shorter than its buffer."""
        buffer = self.agent.buffer
        known = self.hour.observations.setdefault(str(self.agent.instance_id), {})
        new, _ = buffer.since(len(known) + 1, BUFFER_SIZE)
        known.update((observation.sequence, observation) for observation in new)

    def arrived(self) -> None:
        """Wait until the edge has all that there is."""
        until = time.monotonic() + ARRIVAL_S_MAX
        watch = self._watch
        while not (
            watch.cursor.phase is Phase.SAMPLE
            and watch.cursor.instance_id == str(self.agent.instance_id)
            and watch.cursor.next_sequence == self.agent.buffer.next_sequence
        ):
            if watch.error is not None:
                raise watch.error
            place = (
                watch.cursor.phase,
                watch.cursor.instance_id,
                watch.cursor.next_sequence,
                watch.cursor.attempt,
                watch.cursor.hole,
            )
            told = f"{place}, the agent {self.agent.instance_id} {self.agent.buffer.next_sequence}; {watch.connection.last_error}"
            assert time.monotonic() < until, f"at {self.now_s:.1f} s, {self.hour.episodes[-1:]}: {told}"
            time.sleep(0.001)
        watch.settled_s = self.now_s

    # What the episodes do

    def stop(self) -> None:
        """The agent's server is gone."""
        if self._server is not None:
            self._server.stop()
            self._server = None

    def go(self) -> None:
        """It is there again, at the same port."""
        if self._server is None:
            self._server = AgentServer(self.agent, port=self._port, clients_max=8)
            self._server.start()

    def restart(self) -> None:
        """The agent begins again, as another instance."""
        with self.agent.changed:
            self._collect()
            self.agent.restart()
            self._collect()

    def lose_adapter(self) -> None:
        """The adapter's connection to the agent breaks."""
        with self.agent.changed:
            self.agent.adapter_lost()
            self._collect()
        self.hour.without_adapter.append((self.now_s, float("inf")))

    def find_adapter(self) -> None:
        """It is there again, and sends what it knows."""
        with self.agent.changed:
            self.agent.adapter_back()
            self._collect()
        self.hour.without_adapter[-1] = (self.hour.without_adapter[-1][0], self.now_s)


def run(seconds: float, seed: int, *, pause_s: float = 25.0, is_polled: bool = False, is_well: bool = False) -> Hour:
    """So many seconds of production, read by the edge, with faults unless all is well. Odd seeds: agent 1.4, even: 2.3."""
    with Shop(seconds, seed, pause_s=pause_s, is_polled=is_polled, is_well=is_well) as shop:
        shop.work()
    return shop.hour
