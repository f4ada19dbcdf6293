"""`cnctwin bridge`: between the broker and Kafka, until it is stopped."""

import socket
from collections.abc import Sequence
from typing import Annotated

import typer

from cnctwin.commands.options import Broker, Config, Group, Kafka, KafkaConfig, Machines, StateDir
from cnctwin.machines.place import machines_folder
from cnctwin.processes.given_broker import address, broker_or_own
from cnctwin.processes.stopping import stopped_by_signals
from edge.state_dir import state_dir as folder_for_state


def bridge(
    kafka: Kafka = None,
    kafka_config: KafkaConfig = None,
    config: Config = None,
    broker: Broker = None,
    group: Group = "cnc",
    name: Annotated[
        str, typer.Option("--name", "--member", help="Name of this bridge, the same at each start; else the computer's name")
    ] = "",
    nodes: Annotated[str, typer.Option(help="Edge nodes to read: patterns, separated by commas")] = "*",
    results: Annotated[str, typer.Option(help="Processors whose results it publishes: names, all or none")] = "all",
    processors: Annotated[str, typer.Option(help="Processors that run on Kafka: names; else all but the historian")] = "",
    state_dir: StateDir = None,
    machines: Machines = None,
    keep_session: Annotated[
        float,
        typer.Option(help="Hours for which the broker keeps what it cannot deliver; 0 = none (docs/how-to/kafka.md)", min=0.0),
    ] = 0.0,
) -> None:
    """Write what machines send to Kafka, and publish what processors on Kafka compute (docs/how-to/kafka.md)."""
    from cnctwin.kafka.settings import settings_of
    from cnctwin.processes.extras import needed_by

    with needed_by("cnctwin bridge", "kafka"):
        import confluent_kafka  # noqa: F401
    from cnctwin.processes.look_around import refused_second
    from processors.discovery import modules
    from sparkplug.metric import NodeId
    from twin.vocabulary.nodes import twin_node

    settings = settings_of(kafka, kafka_config)
    names = list_of(processors) or [one for one in modules() if one != "historian"]
    published = published_by(results, names)
    way_out = "end that one first, or give this bridge other --results"
    own = [NodeId(group, twin_node(one)) for one in published]
    with (
        stopped_by_signals() as stop,
        broker_or_own(address(broker)) as where,
        refused_second(where, own, way_out) as is_alone,
    ):
        from cnctwin.kafka.bridging import bridge as run_bridge  # while the broker is looked around
        from processors.running.limits import limits_of
        from processors.running.runtime import configured

        run_bridge(
            settings,
            configured(names, config),
            where,
            stop,
            name=name or socket.gethostname(),
            group=group,
            nodes=list_of(nodes),
            results=published,
            state_dir=folder_for_state(state_dir),
            is_alone=is_alone,
            limits=limits_of(config),
            machines=machines_folder(machines, config),
            keep_s=round(keep_session * 3600),
        )


def list_of(text: str) -> list[str]:
    """Return the names in a text, with commas between."""
    return [name.strip() for name in text.split(",") if name.strip()]


def published_by(results: str, names: Sequence[str]) -> list[str]:
    """Return the processors whose results a bridge publishes: all that run on the log, none, or those named.

    Raises UnknownProcessorError for a name that no processor has.
    """
    from processors.discovery import module_of

    if results in ("", "all"):
        return list(names)
    chosen = [] if results == "none" else list_of(results)
    for name in chosen:
        module_of(name)
    return chosen
