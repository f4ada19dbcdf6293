"""`cnctwin bridge`: between the broker and Kafka, until it is stopped."""

import socket
from pathlib import Path
from typing import Annotated

import typer

from cnctwin.commands.options import Broker, Group, Kafka, KafkaConfig, Machines
from cnctwin.machines.place import machines_folder
from cnctwin.processes.given_broker import address, broker_or_own
from cnctwin.processes.stopping import stopped_by_signals
from edge.state_dir import state_dir as folder_for_state


def bridge(
    kafka: Kafka = None,
    kafka_config: KafkaConfig = None,
    config: Annotated[Path | None, typer.Option(help="TOML with a table for each processor")] = None,
    broker: Broker = None,
    group: Group = "cnc",
    name: Annotated[str, typer.Option(help="Of this bridge, the same at each start; else the computer's name")] = "",
    nodes: Annotated[str, typer.Option(help="Edge nodes that it reads: patterns, with commas between")] = "*",
    results: Annotated[str, typer.Option(help="Processors whose results it publishes: names, all or none")] = "all",
    processors: Annotated[str, typer.Option(help="Processors that run on Kafka; else all but the historian")] = "",
    state_dir: Annotated[
        Path | None, typer.Option(help="Keeps birth/death numbers; else $CNCTWIN_STATE_DIR or ~/.local/state/cnctwin")
    ] = None,
    machines: Machines = None,
    keep_session: Annotated[
        float, typer.Option(help="Hours for which the broker keeps what it cannot deliver; 0 = none (docs/kafka.md)", min=0.0)
    ] = 0.0,
) -> None:
    """Hand what machines say to Kafka, and publish what processors on Kafka say (docs/kafka.md)."""
    from cnctwin.commands.extras import needed_by
    from cnctwin.kafka.settings import settings_of

    with needed_by("cnctwin bridge", "kafka"):
        from cnctwin.kafka.bridging import bridge as run_bridge
        from cnctwin.kafka.bridging import published_by
    from processors.discovery import discover
    from processors.running.limits import limits_of
    from processors.running.runtime import configured

    settings = settings_of(kafka, kafka_config)
    names = [one.strip() for one in processors.split(",") if one.strip()] or [one for one in discover() if one != "historian"]
    pairs, limits = configured(names, config), limits_of(config)
    with stopped_by_signals() as stop, broker_or_own(address(broker)) as where:
        run_bridge(
            settings,
            pairs,
            where,
            stop,
            name=name or socket.gethostname(),
            group=group,
            nodes=[one.strip() for one in nodes.split(",") if one.strip()],
            results=published_by(results, names),
            state_dir=folder_for_state(state_dir),
            limits=limits,
            machines=machines_folder(machines, config),
            keep_s=round(keep_session * 3600),
        )
