"""The descriptions of machines in one process: heard from the broker, handed to its processors, published out of its folder.

A file that is new goes out as a retained message, and is taken up when it comes back, as by all other processes: so all take it
up at the same place in the order of messages. What changes nothing is not published: each process of a plant may look at the
folder. A folder never speaks for a machine that it says nothing about.
"""

import json
import logging
import time
from collections.abc import Iterator, Sequence

from processors.description import Description, Role, machine_and_role, read_message, topic_of
from processors.description_folder import DescriptionFolder, FileNews, Key
from processors.running.containment import one_line
from processors.running.ports import HostPort
from processors.running.worker import Worker
from sparkplug.host_event import HostEvent
from twin.errors import MachineError
from twin.vocabulary import topics

FAULT = "fault"
HEARD_MAX = 5000  # descriptions and faults
_log = logging.getLogger(__name__)


class Descriptions:
    """See the module. All of it happens in the thread of its Runner."""

    def __init__(self, host: HostPort, workers: Sequence[Worker], folder: DescriptionFolder | None = None) -> None:
        self._host, self._folder = host, folder
        self._workers = tuple(worker for worker in workers if worker.engine.is_described)
        self._is_wanted = folder is not None or bool(self._workers) or any(worker.records for worker in workers)
        self._versions: dict[Key, str] = {}  # the editions that the broker told
        self._fault_topics: set[str] = set()  # that hold something
        self._file_faults: dict[Key, str] = {}
        self._outbox: dict[str, bytes] = {}  # by topic, until the broker has taken them
        self._written: dict[Key, bytes] = {}  # what the folder holds, as messages
        self._heard: set[Key] = set()  # since the broker was there last
        self._is_compared = False  # the folder with what the broker retained
        self._reconnects: int | None = None

    def plain_filters(self) -> Iterator[str]:
        """The plain topics that it reads; none where nothing of this process asks for a description."""
        if self._is_wanted:
            yield topics.DESCRIPTION + "#"

    # What the broker says.

    def take(self, event: HostEvent, now_s: float) -> str | None:
        """Take a message below cnctwin/description/; return the machine that is described again, if one is."""
        key = machine_and_role(event.topic)
        if key is None:
            self._hear_fault(event)
            return None
        self._heard.add(key)
        machine, role = key
        if not event.payload:
            return self._hand_on(event, machine, role, None, now_s)
        try:
            description = read_message(event.payload, machine).description(machine)
        except MachineError as error:
            _log.warning("the %s description of %s is not taken up: %s", role, machine, error)
            return None
        return self._hand_on(event, machine, role, description, now_s)

    def _hand_on(self, event: HostEvent, machine: str, role: Role, description: Description | None, now_s: float) -> str | None:
        version = "" if description is None else description.edition
        if self._versions.get((machine, role), "") == version:
            return None
        if version and (machine, role) not in self._versions and len(self._versions) >= HEARD_MAX:
            _log.warning("more than %d descriptions; that of %s is not taken up", HEARD_MAX, machine)
            return None
        if version:
            self._versions[machine, role] = version
        else:
            del self._versions[machine, role]
        _log.info("%s: the %s description is %s now", machine, role, version or "none")
        for worker in self._workers:
            fault = ""
            try:
                actions = worker.engine.describe(machine, role, description)
            except Exception as error:  # the one before goes on
                fault = f"{worker.name} cannot take up the {role} description {version}: {one_line(error)}"
                _log.warning("%s: %s", machine, fault)
            else:
                worker.send(actions, event, now_s)
            self._tell_fault(f"{_fault_topic(machine)}/{worker.name}/{role}", fault)
        return machine

    def _hear_fault(self, event: HostEvent) -> None:
        """Remember which faults are retained, so that they can be taken back once they are mended."""
        if event.payload and len(self._fault_topics) < HEARD_MAX:
            self._fault_topics.add(event.topic)
        elif not event.payload:
            self._fault_topics.discard(event.topic)

    # What the folder says.

    def look(self) -> None:
        """Look into the folder, and publish what is new there. Call it once a second, once all that is retained has come."""
        for news in () if self._folder is None else self._folder.look():
            self._read(news)
        if self._reconnects is None:
            self._reconnects = self._host.reconnects
        if self._host.reconnects != self._reconnects:  # what is retained comes again, before the next look
            self._reconnects = self._host.reconnects
            self._heard.clear()
            self._is_compared = False
        elif not self._is_compared:
            self._is_compared = True
            self._compare()
        for topic, payload in list(self._outbox.items()):
            if self._host.publish_plain(topic, payload, qos=1, retain=True):
                del self._outbox[topic]

    def _read(self, news: FileNews) -> None:
        """Have a file published that says something new, and what is wrong with one."""
        key = machine, role = news.machine, news.role
        self._file_faults.pop(key, None)
        if news.fault:
            self._file_faults[key] = news.fault
            _log.warning("%s; the %s description of %s stays what it was", news.fault, role, machine)
        elif news.message is None:
            self._written.pop(key, None)
            if key in self._versions:
                self._outbox[topic_of(machine, role)] = b""
        else:
            self._written[key] = news.message.payload()
            if self._versions.get(key) != news.message.edition:
                self._outbox[topic_of(machine, role)] = self._written[key]
        self._tell_fault(
            _fault_topic(machine), "; ".join(self._file_faults[machine, r] for r in Role if (machine, r) in self._file_faults)
        )

    def _compare(self) -> None:
        """Publish what the broker does not have, as after a crash of it; take back a challenger that went while nobody looked,
        and faults that are mended."""
        described = {machine for machine, _ in self._written}
        for key, payload in self._written.items():
            if key not in self._heard:
                self._outbox[topic_of(*key)] = payload
        for machine, role in list(self._versions):
            key = machine, role
            if role is Role.CHALLENGER and machine in described and key not in self._written and key not in self._file_faults:
                self._outbox[topic_of(*key)] = b""
        faulty = {machine for machine, _ in self._file_faults}
        for machine in described - faulty:
            self._tell_fault(_fault_topic(machine), "")

    def _tell_fault(self, topic: str, text: str) -> None:
        """Publish a fault, retained; take it back where `text` is empty and one is retained."""
        if text:
            self._fault_topics.add(topic)
            document = {"t": time.time_ns() // 1_000_000, "text": text}
            self._outbox[topic] = json.dumps(document, ensure_ascii=False).encode()
        elif topic in self._fault_topics:
            self._fault_topics.discard(topic)
            self._outbox[topic] = b""


def _fault_topic(machine: str) -> str:
    """Return the topic on which the fault of a machine's file is retained."""
    return f"{topics.DESCRIPTION}{machine}/{FAULT}"
