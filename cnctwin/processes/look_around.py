"""A look around the broker before a process connects under its names: does another one, elsewhere, have them already?

On one machine a locked file tells (`sparkplug.session_files.session_lock`). From another machine the broker knows: the newcomer
connects under a name of chance and asks the nodes that it wants to be for their births. Who answers is alive, which a retained
state does not prove, so a process that was killed, or whose machine lost its power, keeps nobody waiting for longer than this
look.
"""

import logging
import threading
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from uuid import uuid4

from sparkplug.broker import BrokerAddress
from sparkplug.errors import AnotherRunsError
from sparkplug.host import EventKind, HostApplication, HostEvent
from sparkplug.metric import NodeId
from sparkplug.topics import Topic, Verb

LOOK_S = 1.0  # a node answers at once; one that was just born, within REBIRTH_INTERVAL_MS_MIN
CONNECT_S_MAX = 1.5  # a broker that is away keeps nobody from beginning: then nobody is there either
_PROCESS = "health/process"


def refuse_second(broker: BrokerAddress, nodes: Sequence[NodeId], way_out: str) -> None:
    """Raise AnotherRunsError where one of these nodes is alive on the broker; it takes LOOK_S where none is."""
    if not nodes:
        return
    logger = logging.getLogger("sparkplug")
    filters = [str(Topic(Verb.NBIRTH, node)) for node in nodes]
    host = HostApplication(broker, f"look-{uuid4().hex[:12]}", filters, publish_state=False, wanted=frozenset(nodes).__contains__)
    level = logger.level
    logger.setLevel(logging.ERROR)  # what is wrong with the broker is said by whoever stays there
    host.start()
    try:
        asked, until_s = False, time.monotonic() + CONNECT_S_MAX
        while time.monotonic() < until_s:
            for event in host.poll(0.05):
                if event.kind is EventKind.BIRTH and event.device is None:
                    raise AnotherRunsError(_told(event, broker, way_out))
            if host.online and not asked:
                asked, until_s = True, time.monotonic() + LOOK_S
                for node in nodes:
                    host.request_rebirth(node)
    finally:
        host.stop(1.0)
        logger.setLevel(level)


@contextmanager
def refused_second(broker: BrokerAddress, nodes: Sequence[NodeId], way_out: str) -> Iterator[Callable[[], None]]:
    """Look around in a thread, while this process makes itself ready; call what is yielded before connecting under these names.

    Raises what `refuse_second` raises, there.
    """
    errors: list[Exception] = []

    def look() -> None:
        try:
            refuse_second(broker, nodes, way_out)
        except Exception as error:
            errors.append(error)

    def settled() -> None:
        thread.join()
        if errors:
            raise errors[0]

    thread = threading.Thread(target=look, name="look-around", daemon=True)
    thread.start()
    try:
        yield settled
    finally:
        thread.join()


def _told(birth: HostEvent, broker: BrokerAddress, way_out: str) -> str:
    process = next((str(reading.value) for reading in birth.readings if reading.name == _PROCESS and reading.value), "")
    where = "".join(letter for letter in process if letter.isprintable())[:100]
    node = f"{birth.node.group}/{birth.node.node}"
    return f"another one runs: {where or 'a process elsewhere'} is the node {node} on {broker.url} already; {way_out}"
