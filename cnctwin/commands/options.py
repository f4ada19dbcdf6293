"""Options that several commands have: the same thing has one name, one meaning and one default everywhere.

`tests/cnctwin/commands/test_options.py` reads the options of all commands as a table and holds them to it.
"""

from pathlib import Path
from typing import Annotated

import typer

WHEN = "2026-11-22T06:00 (UTC unless it names a zone), ms since 1970, or -8h for eight hours ago"
FROM = f"Start of the stretch: {WHEN}"


def file_or_class(given: Path) -> Path:
    """Return the machine.toml that was given, or that of the class of machine that was named in its place."""
    from cnctwin.machines.starters import CLASSES, machine_classes

    return CLASSES / f"{given}.toml" if not given.exists() and str(given) in machine_classes() else given


AsJson = Annotated[bool, typer.Option("--json", help="Print JSON, for a program to read")]
Broker = Annotated[str | None, typer.Option(help="mqtt[s]://[user@]host[:port]; else $CNCTWIN_BROKER", show_default=False)]
Config = Annotated[Path | None, typer.Option(help="TOML file with a table for each processor", show_default=False)]
Dask = Annotated[
    str | None,
    typer.Option(help="Spread over a Dask cluster: tcp://host:8786 or tls://… (docs/how-to/jobs.md)", show_default=False),
]
Device = Annotated[str | None, typer.Option(help="Which device of the device model, where there are several", show_default=False)]
Devices = Annotated[
    Path | None, typer.Option(help="The Devices.xml (device model) that belongs to the recording", show_default=False)
]
From = Annotated[str | None, typer.Option("--from", help=f"{FROM}; else from the beginning", show_default=False)]
FromNeeded = Annotated[str, typer.Option("--from", help=FROM)]
Group = Annotated[str, typer.Option(help="Sparkplug group: the plant")]
Kafka = Annotated[
    str | None,
    typer.Option("--kafka", help="Bootstrap servers; else of --kafka-config or $CNCTWIN_KAFKA_BOOTSTRAP", show_default=False),
]
KafkaConfig = Annotated[
    Path | None, typer.Option("--kafka-config", help="TOML with the cluster and its topics", show_default=False)
]
MachineDescription = Annotated[
    Path,
    typer.Option(
        "--machine",
        "--machine-file",
        callback=file_or_class,
        help="Description: machine.toml, the twin.toml of a diagnosis, or a class, as vmc-40",
    ),
]
Machines = Annotated[
    Path | None,
    typer.Option(
        "--machines",
        help="Folder of descriptions; else machines beside --config, $CNCTWIN_MACHINES, ./machines",
        show_default=False,
    ),
]
Programs = Annotated[Path | None, typer.Option(help="Folder with the NC files that the machine runs", show_default=False)]
Seed = Annotated[int, typer.Option(help="Seed of the random numbers: the same seed, the same result", min=0)]
Speed = Annotated[float, typer.Option(help="How many times faster than real time, or than recorded")]
StateDir = Annotated[
    Path | None,
    typer.Option(help="State folder; else $CNCTWIN_STATE_DIR or ~/.local/state/cnctwin", show_default=False),
]
StateFile = Annotated[Path | None, typer.Option(help="Keep address and state in this JSON file", hidden=True)]
StockBox = Annotated[
    str | None,
    typer.Option(
        "--stock",
        help="The block that is cut from, X0:X1,Y0:Y1,Z0:Z1, mm in machine coordinates, as 0:80,0:60,-20:0; else \\[stock]",
        show_default=False,
    ),
]
StorePlace = Annotated[
    str | None, typer.Option("--store", help="Folder or address of the store; else $CNCTWIN_STORE", show_default=False)
]
To = Annotated[str | None, typer.Option("--to", help="End of the stretch, in the same forms; else now", show_default=False)]
Wait = Annotated[float, typer.Option("--wait", help="Seconds to wait for an answer", min=0.5, max=600.0)]
