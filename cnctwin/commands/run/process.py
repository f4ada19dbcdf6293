"""`cnctwin process`: processors until they are stopped."""

import socket
from pathlib import Path
from typing import Annotated

import typer

from cnctwin.commands.options import Broker, Config, Group, Kafka, KafkaConfig, Machines, StateDir
from cnctwin.machines.place import machines_folder
from cnctwin.processes.given_broker import address, broker_or_own
from cnctwin.processes.stopping import stopped_by_signals
from edge.state_dir import state_dir as folder_for_state


def process(
    names: Annotated[list[str], typer.Argument(help="thermal, cutting_force, mirror, …")],
    config: Config = None,
    broker: Broker = None,
    group: Group = "cnc",
    state_dir: StateDir = None,
    machines: Machines = None,
    kafka: Kafka = None,
    kafka_config: KafkaConfig = None,
    member: Annotated[
        str,
        typer.Option("--member", "--name", help="With Kafka: name of this runner, the same at each start; else the computer's"),
    ] = "",
) -> None:
    """Run processors until SIGTERM or Ctrl-C; alerts also sends its notifications, historian keeps a store."""
    if kafka or kafka_config is not None:
        _over_kafka(names, config, broker, group, kafka, kafka_config, member)
        return
    from cnctwin.running.processors import process as run_processors
    from processors.running.limits import limits_of
    from processors.running.runtime import configured

    pairs, limits = configured(names, config), limits_of(config)
    with stopped_by_signals() as stop, broker_or_own(address(broker)) as where:
        run_processors(
            pairs,
            where,
            stop,
            group=group,
            state_dir=folder_for_state(state_dir),
            limits=limits,
            machines=machines_folder(machines, config),
        )


def _over_kafka(
    names: list[str],
    config: Path | None,
    broker: str | None,
    group: str,
    kafka: str | None,
    kafka_config: Path | None,
    member: str,
) -> None:
    """Run processors as the members of a consumer group; only alerts needs a broker, to send its notifications."""
    from cnctwin.kafka.settings import settings_of
    from cnctwin.processes.extras import needed_by

    with needed_by("cnctwin process --kafka", "kafka"):
        from cnctwin.kafka.claim import claim
    settings, name = settings_of(kafka, kafka_config), member or socket.gethostname().partition(".")[0]
    with stopped_by_signals() as stop:
        claimed = claim(settings, group, names, name, stop)
        from cnctwin.kafka.running import run_over_kafka  # while the cluster answers
        from processors.running.runtime import configured

        run_over_kafka(
            settings, configured(names, config), stop, group=group, member=name, claimed=claimed, broker=address(broker)
        )
