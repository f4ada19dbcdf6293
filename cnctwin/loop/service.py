"""The loop of a plant: one host session, a keeper for each machine that the folder describes, and the work that they share.

It listens to the gap of each machine, to jobs and to what people ask, and retains a document for each machine on
`cnctwin/loop/<machine>`. All that matters is on the disk: it may be killed anywhere and started again.
"""

import fcntl
import json
import logging
import time
from collections import deque
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from threading import Event
from typing import IO, Any

from cnctwin.errors import ApplicationError, UsageError
from cnctwin.loop.config import LoopConfiguration
from cnctwin.loop.keeper import Heard, Keeper
from cnctwin.loop.listening import GAP, TOOL_WEAR
from cnctwin.loop.request import Request, RequestError, read_request
from cnctwin.loop.standing import standing_of
from cnctwin.loop.workshop import Places, Workshop
from cnctwin.machines.folder import MachineFolder, described
from cnctwin.processes import published_state
from sparkplug.broker import BrokerAddress
from sparkplug.clock import now_ms
from sparkplug.host import EventKind, HostApplication, HostEvent
from sparkplug.metric import NodeId, Reading
from sparkplug.topics import NAMESPACE
from twin.errors import TwinError
from twin.vocabulary import topics
from twin.vocabulary.twin_signals import MACHINE_DRIFT, MACHINE_DRIFT_BASIS

LOOK_S = 1.0
POLL_S = 0.1
REQUESTS_MAX = 200
_LOCK = ".loop.lock"
_JOB = topics.state_of_job("{}").split("{}")
_log = logging.getLogger(__name__)


@dataclass(slots=True)
class _Clock:
    """A machine's own time: the newest that was heard, and what has gone by since then while it is online."""

    newest_ms: int = 0
    heard_s: float = 0.0

    def at_ms(self, newest_ms: int, now_s: float, *, online: bool) -> int:
        """Return the time by now."""
        if newest_ms != self.newest_ms:
            ahead = self.newest_ms + round(1000.0 * (now_s - self.heard_s)) if self.newest_ms else 0
            self.newest_ms, self.heard_s = max(newest_ms, ahead), now_s
        return self.newest_ms + (round(1000.0 * (now_s - self.heard_s)) if online and self.newest_ms else 0)


class LoopService:
    """See the module. Raises UsageError where another one runs in the same folder."""

    def __init__(
        self, machines: Path, broker: BrokerAddress, configuration: LoopConfiguration, places: Places, group: str = "cnc"
    ) -> None:
        if not machines.is_dir():
            raise UsageError(
                f"{machines}: is no folder of descriptions; make it, with <machine>.toml in it (docs/how-to/loop.md)"
            )
        self._folder, self._configuration, self._group = machines, configuration, group
        self._lock = _locked(machines)
        self._host = HostApplication(
            broker,
            f"twin-loop-{machines.resolve().name}"[:40],
            tuple(f"{NAMESPACE}/{group}/+/{node}/#" for node in (GAP, TOOL_WEAR)),
            publish_state=False,
            wanted=lambda node: node.node in {GAP, TOOL_WEAR},
            trusted=lambda _: True,
        )
        self._workshop = Workshop(places, self._ask, self._cancel, configuration.healthy_ms)
        self._keepers: dict[str, Keeper] = {}
        self._clocks: dict[str, _Clock] = {}
        self._requests: deque[Request] = deque(maxlen=REQUESTS_MAX)
        self._told: dict[str, bytes] = {}
        self._outbox: dict[str, bytes] = {}
        self._looked_s = 0.0
        self._reconnects = -1

    def run(self, stop: Event) -> None:
        """Work until `stop` is set."""
        for topic in (f"{topics.LOOP_REQUEST}+", topics.state_of_job("+"), f"{topics.JOB_REPLY}+", f"{topics.LOOP}+"):
            self._host.subscribe_plain(topic)
        self._host.start()
        try:
            while not stop.is_set():
                self.turn()
        finally:
            self._workshop.stop()
            self._host.stop()
            self._lock.close()

    def turn(self) -> None:
        """One round."""
        for event in self._host.poll(POLL_S):
            if event.kind is EventKind.PLAIN:
                self._hear(event)
        now_s = time.monotonic()
        while self._requests:
            request = self._requests.popleft()
            if request.machine in self._names():
                self._look(request.machine, now_s, request)
            else:
                _log.warning("%s: %r has no description, so the request is ignored", request.word, request.machine[:80])
        if now_s - self._looked_s >= LOOK_S:
            self._looked_s = now_s
            for machine in self._names():
                self._look(machine, now_s)
        self._send()

    # What is said to us.

    def _hear(self, event: HostEvent) -> None:
        if event.topic.startswith(topics.LOOP_REQUEST):
            try:
                self._requests.append(read_request(event.topic, event.payload))
            except RequestError as error:
                _log.warning("a request is refused: %s", error)
        elif event.topic.startswith(topics.JOB_REPLY):
            self._workshop.answers[event.topic.removeprefix(topics.JOB_REPLY)] = published_state.parsed(event.payload)
        elif event.topic.startswith(_JOB[0]) and event.topic.endswith(_JOB[1]):
            case = event.topic.removeprefix(_JOB[0]).removesuffix(_JOB[1])
            if not event.payload:
                self._workshop.jobs.pop(case, None)
            elif case.startswith("loop-"):
                self._workshop.jobs[case] = published_state.parsed(event.payload)
        elif event.payload and event.topic.startswith(topics.LOOP):
            machine = event.topic.removeprefix(topics.LOOP)
            if machine not in self._names():
                self._outbox[event.topic] = b""  # of a machine that is not described any more

    def _heard(self, machine: str, now_s: float) -> Heard:
        picture = self._host.picture(NodeId(self._group, GAP))
        device = None if picture is None else picture.devices.get(machine)
        clock = self._clocks.setdefault(machine, _Clock())
        if picture is None or device is None:
            return Heard(at_ms=clock.at_ms(clock.newest_ms, now_s, online=False))
        standing = standing_of((*device.readings.values(), *self._drift(machine)))
        return Heard(standing, clock.at_ms(max(standing.at_ms, clock.newest_ms), now_s, online=picture.online and device.online))

    def _drift(self, machine: str) -> tuple[Reading, ...]:
        """Return what is told of the drift of a machine, whose time is not that of its gap."""
        picture = self._host.picture(NodeId(self._group, TOOL_WEAR))
        device = None if picture is None else picture.devices.get(machine)
        if device is None:
            return ()
        return tuple(one for name, one in device.readings.items() if name in {MACHINE_DRIFT, MACHINE_DRIFT_BASIS})

    # What we do and say.

    def _names(self) -> tuple[str, ...]:
        return tuple(name for name in described(self._folder) if (self._folder / f"{name}.toml").is_file())

    def _look(self, machine: str, now_s: float, request: Request | None = None) -> None:
        """A fault of one machine costs its look, and is said in its document."""
        document: Mapping[str, Any]
        try:
            keeper = self._keepers.get(machine)
            if keeper is None:
                own = MachineFolder(self._folder, machine)
                keeper = self._keepers[machine] = Keeper(own, self._configuration.of(machine), self._workshop)
            document = keeper.look(now_ms(), self._heard(machine, now_s), request)
        except (ApplicationError, TwinError, OSError) as error:
            _log.warning("%s: %s", machine, error)
            return
        except Exception:
            _log.exception("%s: the loop failed at a look; it goes on with the next", machine)
            return
        payload = json.dumps(document, ensure_ascii=False, sort_keys=True).encode()
        if self._told.get(machine) != payload:
            self._told[machine] = self._outbox[topics.LOOP + machine] = payload

    def _send(self) -> None:
        if self._host.online and self._host.reconnects != self._reconnects:
            self._reconnects = self._host.reconnects
            for node in (GAP, TOOL_WEAR):
                self._host.request_rebirth(NodeId(self._group, node))  # what stands there is not told again by itself
            self._outbox = {topics.LOOP + machine: payload for machine, payload in self._told.items()} | self._outbox
        for topic, payload in list(self._outbox.items()):
            if self._host.publish_plain(topic, payload, qos=1, retain=True):
                del self._outbox[topic]

    def _ask(self, document: Mapping[str, Any]) -> bool:
        return self._host.publish_plain(topics.JOB_REQUEST, json.dumps(document).encode(), qos=1)

    def _cancel(self, job_id: str) -> bool:
        return self._host.publish_plain(topics.JOB_CANCEL, json.dumps({"id": job_id, "by": "loop"}).encode(), qos=1)


def _locked(machines: Path) -> IO[bytes]:
    try:
        lock = (machines / _LOCK).open("ab")
    except OSError as error:
        raise UsageError(f"{machines}: cannot be written: {error.strerror or error}; the loop keeps its steps there") from None
    try:
        fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError:
        lock.close()
        raise UsageError(f"{machines}: another loop runs for this folder already; end that one first") from None
    return lock
