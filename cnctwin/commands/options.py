"""Options that several commands have."""

from pathlib import Path
from typing import Annotated

import typer

AsJson = Annotated[bool, typer.Option("--json", help="For a program to read")]
Broker = Annotated[str | None, typer.Option(help="mqtt[s]://[user@]host[:port]; else $CNCTWIN_BROKER", show_default=False)]
Group = Annotated[str, typer.Option(help="Sparkplug group: the plant")]
Kafka = Annotated[
    str | None,
    typer.Option("--kafka", help="Bootstrap servers; else of --kafka-config or $CNCTWIN_KAFKA_BOOTSTRAP", show_default=False),
]
KafkaConfig = Annotated[
    Path | None, typer.Option("--kafka-config", help="TOML with the cluster and its topics", show_default=False)
]
Machines = Annotated[
    Path | None,
    typer.Option(
        "--machines",
        help="Folder of descriptions; else machines beside --config, $CNCTWIN_MACHINES, ./machines",
        show_default=False,
    ),
]
StorePlace = Annotated[str | None, typer.Option("--store", help="Folder or address; else $CNCTWIN_STORE", show_default=False)]
Wait = Annotated[float, typer.Option("--wait", help="Seconds to wait for an answer", min=0.5, max=600.0)]


def file_or_class(given: Path) -> Path:
    """Return the machine.toml that was given, or that of the class of machine that was named in its place."""
    from cnctwin.machines.starters import CLASSES, machine_classes

    return CLASSES / f"{given}.toml" if not given.exists() and str(given) in machine_classes() else given
