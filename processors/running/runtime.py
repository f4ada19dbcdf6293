"""Running processors against a broker: one thread each, until they are stopped."""

import threading
from collections.abc import Sequence
from pathlib import Path

from processors.config import Configuration, ProcessorConfig, read_tables
from processors.discovery import AnyProcessor, find, module_of
from processors.errors import ConfigurationError, UnknownProcessorError
from processors.running.health import node_metrics
from processors.running.ports import Recorder
from processors.running.worker import Worker
from sparkplug.broker import BrokerAddress
from sparkplug.edge_node import EdgeNode
from sparkplug.host import HostApplication
from sparkplug.metric import NodeId
from sparkplug.topics import group_filter

JOIN_S_MAX = 15.0
OTHERS = ("validation",)  # tables of the same file that are for no processor
Configured = tuple[AnyProcessor, Configuration[ProcessorConfig]]


def run(
    pairs: Sequence[Configured],
    broker: BrokerAddress,
    stop: threading.Event,
    *,
    group: str = "cnc",
    session_dir: Path | None = None,
    recorder: Recorder | None = None,
) -> None:
    """Run processors whose configuration has been checked until `stop` is set, or one of them fails, which ends all.

    session_dir: keeps the birth/death sequence numbers over restarts; all other state is kept on the broker
    recorder: for the processor that `records`
    """
    workers = [
        _worker(processor, configuration, broker, group, session_dir, recorder=recorder) for processor, configuration in pairs
    ]
    failures: list[BaseException] = []
    threads = [
        threading.Thread(target=_guarded, args=(worker, stop, failures), name=pair[0].name, daemon=True)
        for worker, pair in zip(workers, pairs, strict=True)
    ]
    for thread in threads:
        thread.start()
    while not stop.wait(0.5):
        pass
    for thread in threads:
        thread.join(JOIN_S_MAX)
    if failures:
        raise failures[0]


def configured(names: Sequence[str], config_path: Path | None = None) -> list[Configured]:
    """The processors with their configuration, checked. Raises UnknownProcessorError, ConfigurationError."""
    tables = {} if config_path is None else read_tables(config_path)
    for table in tables:
        if table not in OTHERS:
            _check_table(table, config_path)
    processors = [find(name) for name in dict.fromkeys(names)]
    try:
        return [(processor, processor.configured(tables.get(processor.name))) for processor in processors]
    except ConfigurationError as error:
        raise ConfigurationError(f"{config_path}: {error}") from error


def _check_table(table: str, config_path: Path | None) -> None:
    """Refuse a table that is for no processor; one that does not run is not imported. Raises ConfigurationError."""
    try:
        module_of(table)
    except UnknownProcessorError as error:
        raise ConfigurationError(f"{config_path}: [{table}]: {error}") from error


def _worker(
    processor: AnyProcessor,
    configuration: Configuration[ProcessorConfig],
    broker: BrokerAddress,
    group: str,
    session_dir: Path | None,
    *,
    recorder: Recorder | None,
) -> Worker:
    host = HostApplication(broker, processor.node, (group_filter(group),), wanted=lambda node: processor.listens_to(node.node))
    session_file = None if session_dir is None else session_dir / f"{processor.node}.json"
    edge = EdgeNode(broker, NodeId(group, processor.node), node_metrics(records=processor.records), session_file=session_file)
    return Worker(processor, configuration, host, edge, recorder if processor.records else None)


def _guarded(worker: Worker, stop: threading.Event, failures: list[BaseException]) -> None:
    """A thread that fails ends all: half a set of processors is worse than none, and a supervisor can start anew."""
    try:
        worker.run(stop)
    except BaseException as error:
        failures.append(error)
        stop.set()
        raise
