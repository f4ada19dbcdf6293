"""The connection to an OPC UA server: a thread with a loop of its own, and frames from a bounded queue.

    own thread: connect → resolve → subscribe → deliveries, and the server's status once a second ─► queue ─► frames()

The library's own reconnect is not used: it goes on without telling what was lost. Here each session is built again, and begins
with the hole since the last one was heard. Silence is found by a watchdog: keep-alives and status reads have to come in time.
"""

import asyncio
import queue
import random
import secrets
import threading
import time
from collections import deque
from collections.abc import Callable, Iterator, Mapping, Sequence
from itertools import pairwise
from typing import TYPE_CHECKING, NamedTuple

from edge.controls.opcua.config import Config, points_of
from edge.controls.opcua.cursor import Cursor
from edge.controls.opcua.delivery import Delivery, Load, Notification
from edge.controls.opcua.event import EVENT, EVENTS, Event, Kind
from edge.controls.opcua.library import require
from edge.controls.opcua.spindle_tool import index_in_spindle
from edge.errors import ConnectionLostError, EdgeError
from edge.sample import ClockReading
from edge.sweep import Fact, Hole, Sweep

if TYPE_CHECKING:
    from asyncua import ua
    from asyncua.client.client import Client

    from edge.controls.opcua.event_session import EventWatch
    from edge.controls.opcua.life_reader import LifeReader
    from edge.controls.opcua.resolve import Resolved
    from edge.controls.opcua.session import ServerStatus, Watched
    from edge.controls.opcua.tool_reader import ToolReader

BACKOFF_S = 0.25
BACKOFF_S_MAX = 30.0
FRAMES_MAX = 256
FACTS_AT_ONCE = 5_000
KEEP_ALIVES_MISSED = 3.0
STAMPS_APART_MS_MAX = 2_000  # source stamps that are never closer to the server's clock are those of another clock
CLOCKS_COMPARED = 8
STEADY_S = 10.0  # a session that has lasted for so long ends the series of failures


class _Lost(NamedTuple):
    """Facts that found no room in the queue."""

    from_ms: int
    facts: int


class OpcUaConnection:
    """Frames of one server, reconnecting by itself.

    watch_s: how often the server's status is read; keep_alive_s: how long a subscription without news may be silent
    """

    def __init__(
        self,
        config: Config,
        *,
        clock: Callable[[], float] = time.monotonic,
        wall_s: Callable[[], float] = time.time,
        chance: random.Random | None = None,
        watch_s: float = 1.0,
        keep_alive_s: float = 1.0,
        backoff_s_max: float = BACKOFF_S_MAX,
        frames_max: int = FRAMES_MAX,
    ) -> None:
        require()
        points_of(config)
        self._config = config
        self._clock, self._wall_s = clock, wall_s
        self._chance = chance or random.Random()  # noqa: S311  jitter, not a secret
        self._watch_s, self._keep_alive_s, self._backoff_s_max = watch_s, keep_alive_s, backoff_s_max
        self._life, self._number = secrets.token_hex(8), 0
        self._frames: queue.Queue[bytes] = queue.Queue(frames_max)
        self._overflow: _Lost | None = None
        self._closed = threading.Event()
        self._stop: Callable[[], None] | None = None
        self._crash: BaseException | None = None
        self._heard_s = clock()
        self._failures = 0
        self._delivery: Delivery | None = None
        self._events: EventWatch | None = None
        self._tools: ToolReader | None = None
        self._life_reader: LifeReader | None = None
        self._tool_index: int | None = None
        self._outage: tuple[str, int] | None = None
        self._started_ms = 0
        self._stamps_apart_ms: int | None = None
        self._clocks: deque[tuple[int, int]] = deque(maxlen=CLOCKS_COMPARED)
        self.reconnects = 0
        self.last_error = _unsafe(config)

    def follow(self, cursor: Cursor) -> None:
        """Hear where the parser stands: which of the tools is in the spindle, where it is found from their places."""
        self._tool_index = index_in_spindle(cursor.tools, self._config.source.spindle_place)

    def silent_s(self) -> float:
        """Seconds since the server was heard."""
        return self._clock() - self._heard_s

    def close(self) -> None:
        """End `frames`, from any thread."""
        self._closed.set()
        stop, self._stop = self._stop, None  # once: what is told twice does not get to close its socket
        if stop is not None:
            stop()

    def frames(self) -> Iterator[bytes]:
        """Sweeps until `close`."""
        worker = threading.Thread(target=self._work, name="opcua", daemon=True)
        worker.start()
        try:
            while not self._closed.is_set():
                try:
                    yield self._frames.get(timeout=0.2)
                except queue.Empty:
                    if not worker.is_alive():
                        break
        finally:
            self.close()
            worker.join(timeout=2.0)
        if self._crash is not None:
            raise self._crash

    def _work(self) -> None:
        try:
            asyncio.run(self._run())
        except BaseException as error:
            self._crash = error

    async def _run(self) -> None:
        loop, task = asyncio.get_running_loop(), asyncio.current_task()
        assert task is not None

        def stop() -> None:
            if not loop.is_closed():
                loop.call_soon_threadsafe(task.cancel)

        self._stop = stop
        try:
            await self._again_and_again()
        except asyncio.CancelledError:
            if not self._closed.is_set():
                raise

    async def _again_and_again(self) -> None:
        while not self._closed.is_set():
            begun_s = self._clock()
            try:
                await self._live()
            except EdgeError as error:
                self._lost(error)
            if self._clock() - begun_s > STEADY_S:
                self._failures = 1
            await asyncio.sleep(self._backoff_s())

    def _lost(self, error: EdgeError) -> None:
        self.reconnects += 1
        self._failures += 1
        self.last_error = str(error)
        delivery, self._delivery, self._events = self._delivery, None, None
        self._tools = self._life_reader = None
        if delivery is not None and self._outage is None:
            self._outage = "session lost", delivery.heard_ms

    def _backoff_s(self) -> float:
        longest = min(self._backoff_s_max, BACKOFF_S * 2.0 ** min(self._failures - 1, 16))
        return longest * self._chance.uniform(0.5, 1.0)

    async def _live(self) -> None:
        """One session, until it is lost."""
        from edge.controls.opcua import resolve, session  # noqa: PLC0415  asyncua is an extra

        async with session.opened(self._config) as client:
            try:
                nodes = await resolve.resolve(self._config, client)
                status, reading = await self._status(client)
                await self._subscribe(client, nodes, status)
                self.last_error = _unsafe(self._config)
                while True:
                    self._check_silence()
                    status, reading = await self._status(client)
                    assert self._delivery is not None
                    self._hand_on(self._delivery.tick(self._now_ms(), self._clock()))
                    if self._delivery.is_open:
                        await self._ask()
                        self._emit(Load(()), reading, status)
                    await asyncio.sleep(self._watch_s * self._chance.uniform(0.7, 1.0))  # never at one phase of its clock
            except session.FAILURES as error:
                raise ConnectionLostError(session.one_line(self._config, error)) from error

    async def _status(self, client: "Client") -> "tuple[ServerStatus, ClockReading | None]":
        from edge.controls.opcua import session  # noqa: PLC0415  asyncua is an extra

        asked_s = self._clock()
        status = await session.read_status(client)
        round_trip_s = self._clock() - asked_s
        self._heard_s = self._clock()
        if self._started_ms and status.started_ms != self._started_ms and self._outage is not None:
            self._outage = "server restarted", self._outage[1]
        self._started_ms = status.started_ms
        if status.current_ms is None:
            return status, None
        edge_ms = round((self._wall_s() - round_trip_s / 2) * 1000)
        apart_ms = self._stamps_apart_ms
        stamps_samples = apart_ms is not None and apart_ms <= STAMPS_APART_MS_MAX
        self._clocks.append((status.current_ms, edge_ms))
        round_trip_ms = round(round_trip_s * 1000)
        return status, ClockReading(
            status.current_ms, edge_ms, round_trip_ms, resolution_ms(self._clocks), stamps_samples=stamps_samples
        )

    async def _subscribe(self, client: "Client", nodes: "list[Resolved]", _status: "ServerStatus") -> None:
        from edge.controls.opcua import event_session, life_reader, session, tool_reader  # noqa: PLC0415  asyncua is an extra

        early: list[ua.PublishResult] = []
        there = [(one.key, one.node) for one in nodes if one.node is not None]
        elements = {one.key: one.point.element for one in nodes}
        watched: Watched | None = None

        def heard(result: "ua.PublishResult") -> None:
            if watched is None or self._delivery is None:
                early.append(result)  # before its handles are known
            else:
                self._published(result, watched, elements)

        watched = await session.watch(self._config, client, there, self._keep_alive_s, heard)
        faults = {one.key: one.fault for one in nodes if one.node is None} | watched.refused
        facts = await session.unit_facts(self._config, client, there)
        facts += [Fact(key, fault=fault) for key, fault in faults.items()]
        told = await event_session.listen(self._config, client, watched.subscription)
        if told is not None:
            self._events = event_session.EventWatch(client, watched.subscription, told, self._clock)
            facts += filter(None, (self._events.about, await self._events.tick()))
        namespaces = await client.get_namespace_array()
        self._tools = tool_reader.ToolReader(self._config, client, namespaces, self._clock)
        self._life_reader = life_reader.LifeReader(client, nodes, namespaces, self._clock)
        self._tools.heard(await self._found(client, [one for one in nodes if one.key == tool_reader.TOOL_NUMBER]))
        facts += await self._tools.tick()
        keep_alive_s = max(self._keep_alive_s, watched.publishing_ms / 1000)
        self._delivery = Delivery(
            items=frozenset(watched.keys.values()),
            publishing_ms=watched.publishing_ms,
            sampled_ms=watched.sampled_ms,
            queue_size=watched.queue_size,
            silent_s_max=KEEP_ALIVES_MISSED * keep_alive_s,
            began_ms=self._now_ms(),
            began_s=self._clock(),
            faults=tuple(facts),
            outage=self._outage,
            awaits_refresh=self._events is not None and self._events.is_waiting,
        )
        self._hand_on(self._delivery.tick(self._now_ms(), self._clock()))
        for result in early:
            heard(result)

    async def _found(self, client: "Client", nodes: "list[Resolved]") -> list[Fact]:
        """Return the present values of these nodes."""
        from edge.controls.opcua import plain, session  # noqa: PLC0415  asyncua is an extra

        there = [(one, one.node) for one in nodes if one.node is not None]
        values = await session.read_values(client, [node for _, node in there]) if there else []
        return [plain.as_fact(one.key, value, element=one.point.element) for (one, _), value in zip(there, values, strict=True)]

    def _published(self, result: "ua.PublishResult", watched: "Watched", elements: "Mapping[str, int | None]") -> None:
        from edge.controls.opcua import plain  # noqa: PLC0415  asyncua is an extra

        parts = result.NotificationMessage.NotificationData or ()
        items = [item for part in parts for item in getattr(part, "MonitoredItems", ())]
        values = [(watched.keys.get(int(item.ClientHandle)), item.Value) for item in items]
        known = [(key, value) for key, value in values if key is not None and value is not None]
        stamps = self._config.source.timestamps
        facts = [plain.as_fact(key, value, element=elements[key], stamps=stamps) for key, value in known]
        facts += [] if self._events is None else self._events.facts(parts)
        if self._tools is not None:
            self._tools.heard(facts)
        self._compare([plain.stamps_apart_ms(value) for _, value in known])
        overflowed = [key for key, value in known if plain.overflowed(value)]
        overflowed += [EVENTS for fact in facts if fact.key == EVENT and Event.kind_of(fact) is Kind.OVERFLOW]
        self._heard(Notification(int(result.NotificationMessage.SequenceNumber), tuple(facts), tuple(overflowed), not parts))

    async def _ask(self) -> None:
        """Have the alarms repeated, and read what belongs to the tool in the spindle, where that is due."""
        fault = None if self._events is None else await self._events.tick()
        of_tool = [] if self._tools is None else await self._tools.tick()
        of_tool += [] if self._life_reader is None else await self._life_reader.tick(self._tool_index)
        if fault is not None or of_tool:
            self._emit(Load((*([] if fault is None else [fault]), *of_tool)))

    def _compare(self, apart_ms: list[int | None]) -> None:
        """Note how close the samples' stamps ever come to the server's clock; an old value may be far from it."""
        for each in apart_ms:
            if each is not None and (self._stamps_apart_ms is None or each < self._stamps_apart_ms):
                self._stamps_apart_ms = each

    def _heard(self, told: Notification) -> None:
        assert self._delivery is not None
        self._heard_s, was_open = self._clock(), self._delivery.is_open
        loads = self._delivery.take(told, self._now_ms(), self._clock())
        if was_open and self._events is not None and any(load.holes for load in loads):
            self._events.missed()
        self._hand_on(loads)

    def _check_silence(self) -> None:
        """A server that answers reads but publishes nothing, not even keep-alives, has lost the subscription."""
        delivery = self._delivery
        assert delivery is not None
        longest_s = delivery.silent_s_max + self._config.source.timeout_s
        if self._clock() - delivery.heard_s > longest_s:
            raise ConnectionLostError(f"{self._config.source.url}: no publish within {longest_s:g} s")

    def _hand_on(self, loads: list[Load]) -> None:
        for load in loads:
            for begin in range(0, max(len(load.facts), 1), FACTS_AT_ONCE):
                self._emit(Load(load.facts[begin : begin + FACTS_AT_ONCE], load.holes if begin == 0 else ()))
        if self._delivery is not None and self._delivery.is_open:
            self._outage = None

    def _emit(self, load: Load, clock: ClockReading | None = None, status: "ServerStatus | None" = None) -> None:
        """Into the queue; where that is full, it is the reader that is too slow, and the loss becomes a hole of its own."""
        now_ms, lost = self._now_ms(), self._overflow
        holes = load.holes if lost is None else (Hole("this edge was too slow", lost.from_ms, now_ms, lost.facts), *load.holes)
        available = None if status is None else status.state == "Running"
        error = None if available is not False or status is None else f"the server's state is {status.state}"
        sweep = Sweep(self._life, self._number, now_ms, load.facts, holes, clock=clock, available=available, error=error)
        try:
            self._frames.put_nowait(sweep.encode())
        except queue.Full:
            facts = len(load.facts) + sum(hole.lost for hole in load.holes)
            since_ms = min((hole.from_ms for hole in load.holes), default=now_ms)
            if self._events is not None:
                self._events.missed()
            self._overflow = _Lost(since_ms, facts) if lost is None else _Lost(min(lost.from_ms, since_ms), lost.facts + facts)
        else:
            self._number += 1
            self._overflow = None

    def _now_ms(self) -> int:
        return round(self._wall_s() * 1000)


def resolution_ms(clocks: Sequence[tuple[int, int]]) -> int:
    """Return how coarse a server's clock is, by what it and ours went on between readings; many are set forward once a second.

    >>> resolution_ms([(0, 0), (1000, 700), (1000, 1500), (2000, 2200)])
    800
    """
    apart = (abs((after[0] - before[0]) - (after[1] - before[1])) for before, after in pairwise(clocks))
    return max(1, min(5_000, max(apart, default=1)))


def _unsafe(config: Config) -> str:
    """Return what health says as long as the connection is open for all to read."""
    source = config.source
    return f'{source.url}: not encrypted, not authenticated: opcua.security = "none"' if source.security == "none" else ""
