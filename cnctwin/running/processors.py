"""Processors at work: beside `alerts` the courier that sends what its receivers are to be told, and beside
`historian` the store that it keeps."""

import sys
import threading
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

from cnctwin.processes.look_around import refuse_second
from processors.errors import ConfigurationError
from processors.running.ports import Recorder
from processors.running.runtime import Configured, run
from sparkplug.admission.limits import DEFAULTS, Limits
from sparkplug.broker import BrokerAddress
from sparkplug.metric import NodeId
from sparkplug.session_files.session_lock import SessionLock
from sparkplug.topics import NAMESPACE

if TYPE_CHECKING:
    from processors.alerts.courier.thread import Courier

ALERTS = "alerts"


def process(
    pairs: Sequence[Configured],
    broker: BrokerAddress,
    stop: threading.Event,
    *,
    group: str,
    state_dir: Path,
    limits: Limits = DEFAULTS,
    machines: Path | None = None,
) -> None:
    """Run configured processors until `stop` is set. Raises ConfigurationError where a secret is missing, StoreError where the
    store cannot be used, AnotherRunsError where another process has one of them.

    machines: the folder that describes the machines
    """
    nodes = [NodeId(group, processor.node) for processor, _ in pairs]
    with ExitStack() as stack:
        for node in nodes:  # before anything connects under a name that may be another's
            stack.callback(SessionLock(state_dir / f"{node.node}.json", f"{node.group}/{node.node}").release)
        refuse_second(broker, nodes, "end that one first, or give this one other processors or another --group")
        recorder = stack.enter_context(_recorder(pairs, group))
        stack.enter_context(courier_of(pairs, broker, group))
        print(started([processor.name for processor, _ in pairs], broker.url, group, machines), file=sys.stderr, flush=True)
        run(pairs, broker, stop, group=group, session_dir=state_dir, recorder=recorder, limits=limits, machines=machines)


def started(names: Sequence[str], url: str, group: str, machines: Path | None = None) -> str:
    """Return the line that says what runs, what it listens to, and which descriptions it has.

    >>> started(["thermal", "gap"], "mqtt://127.0.0.1:1883", "cnc")
    'started thermal, gap: they listen to the machines of group cnc (spBv1.0/cnc/#) on mqtt://127.0.0.1:1883; Ctrl-C ends them'
    """
    they, them = ("they listen", "them") if len(names) > 1 else ("it listens", "it")
    described = "" if machines is None else f", described in {machines}"
    where = f"the machines of group {group} ({NAMESPACE}/{group}/#) on {url}{described}"
    return f"started {', '.join(names)}: {they} to {where}; Ctrl-C ends {them}"


@contextmanager
def _recorder(pairs: Sequence[Configured], group: str) -> Iterator[Recorder | None]:
    """The store's recorder, where the historian runs; else nothing, and no store is loaded."""
    config = next((one.default for processor, one in pairs if processor.records), None)
    if config is None:
        yield None
        return
    from cnctwin.memory.historian import StoreRecorder, store_of  # noqa: PLC0415  only what runs is loaded
    from processors.historian import HistorianConfig  # noqa: PLC0415

    assert isinstance(config, HistorianConfig)
    recorder = StoreRecorder(store_of(config), group, config.hole_s)
    recorder.start()
    try:
        yield recorder
    finally:
        recorder.stop()


@contextmanager
def courier_of(pairs: Sequence[Configured], broker: BrokerAddress | None, group: str) -> Iterator[None]:
    """The courier, where alerts run and somebody is to be told; else nothing. Raises ConfigurationError as `new_courier`."""
    new = new_courier(pairs, broker, group)
    if new is None:
        yield
        return
    courier = new()
    courier.start()
    try:
        yield
    finally:
        courier.stop()


def new_courier(
    pairs: Sequence[Configured], broker: BrokerAddress | None, group: str, member: str = ""
) -> "Callable[[], Courier] | None":
    """Return what makes a courier, which raises ConfigurationError where a secret is missing; None where alerts do not run or
    nobody is to be told, and httpx is not loaded. Raises ConfigurationError where there is no broker from which a courier could
    learn what is to be sent.

    member: of those between which the courier moves
    """
    config = next((one.default for processor, one in pairs if processor.name == ALERTS), None)
    if config is None:
        return None
    from processors.alerts.config import AlertsConfig  # noqa: PLC0415  only what runs is loaded

    assert isinstance(config, AlertsConfig)
    if not config.receivers:
        return None
    if broker is None:
        raise ConfigurationError("alerts: notifications are sent by way of the broker; give --broker or CNCTWIN_BROKER")
    from processors.alerts.courier.thread import Courier  # noqa: PLC0415

    return lambda: Courier(broker, config, group, member)
