"""Running processors against a broker until they are stopped: all of a process on one host session, in one loop."""

import logging
import threading
from collections.abc import Sequence
from functools import partial
from pathlib import Path

from processors.config import Configuration, ProcessorConfig, read_tables
from processors.description_folder import DescriptionFolder
from processors.discovery import AnyProcessor, find, modules
from processors.errors import ConfigurationError
from processors.running.health import node_metrics
from processors.running.ports import Recorder
from processors.running.runner import Runner
from processors.running.worker import Worker
from sparkplug.admission.limits import DEFAULTS, Limits
from sparkplug.broker import BrokerAddress
from sparkplug.edge_node import EdgeNode
from sparkplug.host import HostApplication
from sparkplug.metric import NodeId
from sparkplug.topics import uncommanded_filters
from sparkplug.transport.loop import Loop
from twin.vocabulary.faults import report, unknown
from twin.vocabulary.nodes import is_twin_node
from twin.vocabulary.topics import RESERVED_MACHINES

_log = logging.getLogger(__name__)
OTHERS = ("validation", "limits", "loop")  # tables of the same file that are for no processor
Configured = tuple[AnyProcessor, Configuration[ProcessorConfig]]


def run(
    pairs: Sequence[Configured],
    broker: BrokerAddress,
    stop: threading.Event,
    *,
    group: str = "cnc",
    session_dir: Path | None = None,
    recorder: Recorder | None = None,
    limits: Limits = DEFAULTS,
    machines: Path | None = None,
) -> None:
    """Run processors whose configuration has been checked until `stop` is set. A processor that fails is restarted by itself
    (processors/running/containment.py); raises ProcessorsFailedError where all of them go on failing, so that a supervisor can
    start the process again.

    session_dir: keeps the birth/death sequence numbers over restarts; all other state is kept on the broker
    recorder: for the processor that `records`
    machines: folder in which people describe the machines (processors/description_folder.py)
    """
    runner = runner_of(pairs, broker, group=group, session_dir=session_dir, recorder=recorder, limits=limits, machines=machines)
    runner.run(stop)


def runner_of(
    pairs: Sequence[Configured],
    broker: BrokerAddress,
    *,
    group: str = "cnc",
    session_dir: Path | None = None,
    recorder: Recorder | None = None,
    limits: Limits = DEFAULTS,
    machines: Path | None = None,
) -> Runner:
    """Return the loop of a process, not begun: one host session and an edge node for each processor, on one MQTT loop."""
    processors = [processor for processor, _ in pairs]
    loop = Loop("processors")
    host = HostApplication(
        broker,
        host_id(processors),
        uncommanded_filters(group),
        wanted=lambda node: any(processor.listens_to(node.node) for processor in processors),
        loop=loop,
        limits=limits,
        reserved=RESERVED_MACHINES,
        trusted=lambda node: is_twin_node(node.node),
    )
    workers = []
    for processor, configuration in pairs:
        new_edge = partial(
            EdgeNode,
            broker,
            NodeId(group, processor.node),
            node_metrics(records=processor.records),
            session_file=None if session_dir is None else session_dir / f"{processor.node}.json",
            loop=loop,
        )
        given = recorder if processor.records else None
        workers.append(Worker(processor, configuration, host, new_edge(), given, new_edge=new_edge))
    return Runner(host, workers, None if machines is None else DescriptionFolder(machines))


def host_id(processors: Sequence[AnyProcessor]) -> str:
    """Return the id of the host application that processors share: that of the one that records, which edges may wait for, else
    that of the first by name. No two processes have a processor in common, so no two have the same.

    >>> host_id([find("thermal"), find("mirror")]), host_id([find("alerts"), find("historian")])
    ('twin-mirror', 'twin-historian')
    """
    return min(processors, key=lambda processor: (not processor.records, processor.name)).node


def configured(names: Sequence[str], config_path: Path | None = None) -> list[Configured]:
    """The processors with their configuration, checked; a line in the log tells each value that describes the machine.

    Raises UnknownProcessorError, ConfigurationError.
    """
    tables = {} if config_path is None else read_tables(config_path)
    known = (*modules(), *OTHERS)
    # A table of a processor that does not run is known by its name, and not imported.
    faults = [unknown(f"[{table}]", table, known) for table in tables if table not in known]
    processors = [find(name) for name in dict.fromkeys(names)]
    found = []
    for processor in processors:
        try:
            found.append((processor, processor.configured(tables.get(processor.name))))
        except ConfigurationError as error:
            faults += str(error).split("\n")
    if faults:
        raise ConfigurationError(report(config_path, faults, "docs/reference/processors.md"))
    for _, configuration in found:
        for line in configuration.belongs_elsewhere():
            _log.warning("%s: %s", config_path, line)
    return found
