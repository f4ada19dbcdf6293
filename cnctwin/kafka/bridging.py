"""A bridge from its options: the host session and the edge nodes of the processors that it publishes."""

import fnmatch
from collections.abc import Callable, Collection, Sequence
from contextlib import ExitStack
from pathlib import Path
from threading import Event

from cnctwin.kafka.bridge.bridge import Bridge
from cnctwin.kafka.settings import KafkaSettings
from cnctwin.kafka.topics import Topics, cell_processors, ensure
from processors.running.health import node_metrics
from processors.running.runtime import Configured
from sparkplug.admission.limits import DEFAULTS, Limits
from sparkplug.broker import BrokerAddress
from sparkplug.edge_node import EdgeNode
from sparkplug.host import HostApplication
from sparkplug.metric import NodeId
from sparkplug.session_files.session_lock import SessionLock
from sparkplug.topics import uncommanded_filters
from sparkplug.transport.loop import Loop
from twin.vocabulary.nodes import is_twin_node
from twin.vocabulary.topics import RESERVED_MACHINES


def bridge(
    settings: KafkaSettings,
    pairs: Sequence[Configured],
    broker: BrokerAddress,
    stop: Event,
    *,
    name: str,
    group: str,
    nodes: Sequence[str],
    results: Sequence[str],
    state_dir: Path,
    is_alone: Callable[[], None],
    limits: Limits = DEFAULTS,
    machines: Path | None = None,
    keep_s: int = 0,
) -> None:
    """Run a bridge until `stop` is set. `pairs`: the processors that run on the log; `nodes`: patterns of the edge nodes that
    this bridge reads; `results`: the processors whose results it publishes; `is_alone`: raises where another process has their
    nodes, called before this one connects; `keep_s`: for how long the broker keeps what it could not deliver to this bridge.
    Raises ConfigurationError, AnotherRunsError.
    """
    topics = Topics(group)
    own = [NodeId(group, processor.node) for processor, _ in pairs if processor.name in results]
    on_log = frozenset(processor.node for processor, _ in pairs)
    with ExitStack() as stack:
        lock = NodeId(group, f"bridge-{name}")
        for node in (lock, *own):
            stack.callback(SessionLock(state_dir / f"{node.node}.json", f"{node.group}/{node.node}").release)
        ensure(settings, topics, cell_processors(pairs), without=(topics.deadletters,))
        loop = Loop("bridge")
        host = HostApplication(
            broker,
            f"bridge-{name}",
            uncommanded_filters(group),
            publish_state=False,  # no edge waits for it: who wants a host to be there names the historian
            wanted=lambda node: _is_read(node, nodes, own, on_log),
            loop=loop,
            limits=limits,
            reserved=RESERVED_MACHINES,
            trusted=lambda node: is_twin_node(node.node),
            keep_s=keep_s,
            packs=True,
        )
        edges = {
            processor.name: EdgeNode(
                broker,
                NodeId(group, processor.node),
                node_metrics(on_log=True),
                session_file=state_dir / f"{processor.node}.json",
                loop=loop,
            )
            for processor, _ in pairs
            if processor.name in results
        }
        made = Bridge(settings, topics, name, pairs, host=host, nodes=edges, machines=machines, keeps_session=keep_s > 0)
        made.prepare()
        is_alone()
        made.run(stop)


def _is_read(node: NodeId, patterns: Sequence[str], own: Sequence[NodeId], on_log: Collection[str]) -> bool:
    """Return True for a node of this bridge's share: a processor's node is read by the bridge that publishes it, and one of a
    processor that does not run on the log by whoever publishes any."""
    if is_twin_node(node.node):
        return node in own or (bool(own) and node.node not in on_log)
    return any(fnmatch.fnmatchcase(node.node, pattern) for pattern in patterns)
