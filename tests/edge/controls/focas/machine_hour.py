"""An hour of a machine in seconds: the real server, the real connection over TCP, the real parser and pipeline, and a clock of
the machine's own that passes while the edge waits, while an answer is under way, and while one does not come.

Faults are switched at moments of the machine's time, from a seed. Everything happens in one thread but for the server's, so an
hour with the same seed is the same hour.
"""

import random
from bisect import bisect_right
from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from time import process_time, thread_time

from cnctwin.standins.focas_server.faults import Refusal, Wrong
from cnctwin.standins.focas_server.server import FocasServer
from cnctwin.standins.focas_server.shown import CodedState, ControlDescription, coded
from cnctwin.standins.simulated_control.control import SimulatedControl
from cnctwin.standins.simulated_control.state import production
from cnctwin.standins.simulated_machine.description import PROGRAM
from edge.config import EdgeConfig
from edge.controls.focas.calls import Answer, FocasBackend, Opened, Request
from edge.controls.focas.config import FocasConfig
from edge.controls.focas.connection import FocasConnection
from edge.controls.focas.cursor import parse, start
from edge.controls.focas.ethernet import EthernetBackend
from edge.controls.focas.policy import Policy, policy_of
from edge.running.ledger import Ledger
from edge.running.pipeline import Pipeline
from edge.sample import EdgeSample, Gap
from tests.wire.mosquitto import free_port

SWITCHED_ON_S = 1_767_225_600.0
CLOCK_OFFSET_S = 2.5
ROUND_TRIP_S = 0.03  # of an answer of a control that is well
TIMEOUT_S = 3.0  # of the machine's time
SOCKET_TIMEOUT_S = 0.2  # of ours: what a missing answer costs the test
QUIET_S = 20.0  # at the beginning and at the end


@dataclass
class MachineTime:
    """Passes when it is told to, and does on the way what is due."""

    now_s: float = 0.0
    due: list[tuple[float, Callable[[], None]]] = field(default_factory=list)

    def pass_(self, seconds: float) -> None:
        """So much time goes by."""
        until_s = self.now_s + max(seconds, 0.0)
        while self.due and self.due[0][0] <= until_s:
            self.now_s, act = self.due.pop(0)
            act()
        self.now_s = until_s

    def wall_s(self) -> float:
        """The edge's clock."""
        return SWITCHED_ON_S + self.now_s


@dataclass(frozen=True, slots=True)
class Look:
    """One question and its answer, in the machine's time; whether the handle was lost over it."""

    from_s: float
    to_s: float
    is_lost: bool


class TimedBackend:
    """The real backend; what it does takes its time on the machine's clock."""

    note = ""

    def __init__(self, inner: FocasBackend, time: MachineTime, chance: random.Random) -> None:
        self._inner, self._time, self._chance = inner, time, chance
        self.slow_s = 0.0
        self.looks: list[Look] = []

    def open(self) -> Opened:
        self._time.pass_(ROUND_TRIP_S)
        opened = self._inner.open()
        self._time.pass_(0.0 if policy_of(opened.code) is Policy.OK else TIMEOUT_S)
        return opened

    def ask(self, requests: Sequence[Request]) -> tuple[Answer, ...]:
        began_s, takes_s = self._time.now_s, ROUND_TRIP_S + self.slow_s
        before_s = takes_s * self._chance.random()
        self._time.pass_(before_s)
        answers = self._inner.ask(requests)
        is_lost = any(policy_of(answer.code) is Policy.RECONNECT for answer in answers)
        self._time.pass_(TIMEOUT_S if is_lost else takes_s - before_s)
        self.looks.append(Look(began_s, self._time.now_s, is_lost))
        return answers

    def close(self) -> None:
        self._inner.close()


FAILING = (
    {(1, 0x24)},  # feed
    {(1, 0x25), (1, 0x40)},  # spindle
    {(1, 0x26)},
    {(1, 0x56)},
    {(1, 0x20)},  # program text
    {(2, 0x8001)},  # the PMC: overrides, and what says best that a tool is changed
    {(1, 0x15)},  # modal codes
    {(1, 0x19)},  # status
    {(1, 0x1C), (1, 0x1D), (1, 0xFC), (1, 0xCF), (1, 0x23), (1, 0x96)},
)
CODES = (-2, -1, 1, 5, 6, 9, 13, 15)


@dataclass
class Hour:
    """What was shown, what became of it, and what was wrong meanwhile."""

    states: list[CodedState]
    looks: list[Look] = field(default_factory=list)
    sweep_s: list[float] = field(default_factory=list)
    samples: list[EdgeSample] = field(default_factory=list)
    gaps: list[Gap] = field(default_factory=list)
    episodes: list[tuple[float, float, str]] = field(default_factory=list)
    ledger: dict[str, int] = field(default_factory=dict)
    differences: set[int] = field(default_factory=set)
    unaccounted: int = 0
    clock_offsets_s: list[float] = field(default_factory=list)
    reconnects: int = 0
    server: dict[str, int] = field(default_factory=dict)
    server_balances: bool = False
    edge_cpu_s: float = 0.0
    server_cpu_s: float = 0.0

    def __post_init__(self) -> None:
        self._at_s = [state.at_s for state in self.states]
        self._look_s: list[float] = []

    def shown(self, from_s: float, to_s: float) -> list[CodedState]:
        """Return what the control showed between these times."""
        first = max(bisect_right(self._at_s, from_s) - 1, 0)
        return self.states[first : bisect_right(self._at_s, to_s) or 1]

    def take_looks(self, looks: list[Look]) -> None:
        """All looks that were made, in order."""
        self.looks, self._look_s = looks, [look.from_s for look in looks]

    def look_at(self, at_s: float) -> Look:
        """The look that was answered around this time."""
        return self.looks[max(bisect_right(self._look_s, at_s + 0.002) - 1, 0)]

    def kinds(self) -> Counter[str]:
        """Return how many episodes there were of each kind."""
        return Counter(kind.partition(":")[0] for _, _, kind in self.episodes)


class Mischief:
    """Puts faults into the machine's time, from a seed: one episode after the other, with pauses."""

    def __init__(self, seed: int, server: FocasServer, backend: TimedBackend, hour: Hour) -> None:
        self._chance = random.Random(seed)
        self._server, self._backend, self._hour = server, backend, hour

    def plan(self, time: MachineTime, until_s: float, pause_s: float) -> None:
        """All episodes of the hour, each kind equally often."""
        at_s, kinds = QUIET_S, list[Callable[[], tuple[str, float, Callable[[], None]]]]()
        while True:
            kinds = kinds or self._chance.sample(self._kinds(), len(self._kinds()))
            name, lasts_s, begin = kinds.pop()()
            if at_s + lasts_s > until_s - QUIET_S:
                break
            time.due += [(at_s, begin), (at_s + lasts_s, self._end)]
            self._hour.episodes.append((at_s, at_s + lasts_s, name))
            at_s += lasts_s + pause_s * self._chance.uniform(0.5, 1.5)

    def _end(self) -> None:
        self._server.faults.clear()
        self._backend.slow_s = 0.0
        if not self._server.is_listening:
            self._server.start()

    def _kinds(self) -> list[Callable[[], tuple[str, float, Callable[[], None]]]]:
        return [self._killed, self._hung, self._slow, self._wrong, self._dropped, self._refusing, self._partial, self._partial]

    def _killed(self) -> tuple[str, float, Callable[[], None]]:
        return "killed", self._chance.uniform(0.3, 20.0), self._server.stop

    def _hung(self) -> tuple[str, float, Callable[[], None]]:
        return "hung", self._chance.uniform(0.5, 15.0), lambda: setattr(self._server.faults, "hang", True)

    def _slow(self) -> tuple[str, float, Callable[[], None]]:
        slow_s = self._chance.uniform(0.1, 1.8)

        def begin() -> None:
            self._server.faults.delay_s, self._backend.slow_s = 0.001, slow_s

        return "slow", self._chance.uniform(5.0, 30.0), begin

    def _wrong(self) -> tuple[str, float, Callable[[], None]]:
        wrong = self._chance.choice(list(Wrong))
        return f"wrong: {wrong.value}", self._chance.uniform(0.5, 8.0), lambda: setattr(self._server.faults, "wrong", wrong)

    def _dropped(self) -> tuple[str, float, Callable[[], None]]:
        sent = self._chance.randrange(60)
        return "dropped", self._chance.uniform(0.3, 5.0), lambda: setattr(self._server.faults, "drop_after_bytes", sent)

    def _refusing(self) -> tuple[str, float, Callable[[], None]]:
        refusal = self._chance.choice(list(Refusal))

        def begin() -> None:
            self._server.stop()
            self._server.start()
            self._server.faults.refusal = refusal

        return "refusing", self._chance.uniform(0.5, 15.0), begin

    def _partial(self) -> tuple[str, float, Callable[[], None]]:
        functions, code = self._chance.choice(FAILING), self._chance.choice(CODES)

        def begin() -> None:
            self._server.faults.failing = dict.fromkeys(functions, code)

        named = "+".join(f"{function:02x}" for _, function in sorted(functions))
        return f"partial: {named} {code}", self._chance.uniform(2.0, 40.0), begin


def run(seconds: float, seed: int, *, pause_s: float = 25.0, is_well: bool = False, **options: str) -> Hour:
    """So many seconds of production, read by the edge, with faults unless the control is well. `options`: of [focas]."""
    states = [state for state in coded(production(seconds)) if isinstance(state, CodedState)]
    time, hour, chance = MachineTime(), Hour(states), random.Random(seed)
    control = SimulatedControl(states, machine_s=lambda: time.now_s, switched_on_s=SWITCHED_ON_S, clock_offset_s=CLOCK_OFFSET_S)
    lines = tuple(PROGRAM.read_text(encoding="utf-8").splitlines())
    with FocasServer(control, ControlDescription(program_lines=lines), port=free_port()) as server:
        source = FocasConfig.model_validate({"port": server.port, "timeout_s": SOCKET_TIMEOUT_S, **options})
        config = EdgeConfig(source=source)
        backend = TimedBackend(EthernetBackend(source), time, chance)
        if not is_well:
            Mischief(seed, server, backend, hour).plan(time, seconds, pause_s)
        connection = FocasConnection(
            config,
            backend=backend,
            clock=lambda: time.now_s,
            wall_s=time.wall_s,
            wait=time.pass_,
            chance=random.Random(seed),
        )
        began_s = thread_time(), process_time()
        _read(connection, config, time, seconds, hour)
        hour.edge_cpu_s = thread_time() - began_s[0]
        hour.server_cpu_s = process_time() - began_s[1] - hour.edge_cpu_s
        hour.server, hour.server_balances = server.ledger.as_dict(), server.ledger.balances
    hour.reconnects = connection.reconnects
    hour.take_looks(backend.looks)
    return hour


def _read(connection: FocasConnection, config: EdgeConfig[FocasConfig], time: MachineTime, seconds: float, hour: Hour) -> None:
    """What `EdgeRuntime` does with each frame, one after the other and with nobody to publish to."""
    cursor, pipeline, ledger = start(config), Pipeline(config), Ledger()
    for raw in connection.frames():
        cursor, given = parse(config, cursor, raw)
        hour.unaccounted += not given.accounted()
        ledger.queue(given.received)
        outcome = pipeline.take(given, time.now_s)
        emitted = [sample for row in outcome.rows for sample in row]
        ledger.settle(
            taken=given.received,
            emitted=sum(sample.observations for sample in emitted),
            dropped=outcome.dropped,
            held=pipeline.held,
        )
        hour.differences.add(Ledger.difference(ledger.snapshot()))
        hour.samples += emitted
        hour.gaps += given.gaps
        if given.newest_ms is not None:
            hour.sweep_s.append(given.newest_ms / 1000 - SWITCHED_ON_S)
        if given.clock is not None:
            hour.clock_offsets_s.append((given.clock.control_ms - given.clock.edge_ms) / 1000)
        if time.now_s >= seconds:
            connection.close()
    hour.ledger = ledger.snapshot()
