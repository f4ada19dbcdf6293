"""The edge for MTConnect agents, 1.2 to 2.x.

`cursor` parses the documents and decides what to ask for next, `connection` asks, `mapping` and `names.toml` say which data item
is which signal.

Documentation: docs/how-to/edge-mtconnect.md. Every key of the configuration: mtconnect.toml beside this file, edge/edge.toml.
"""

from pathlib import Path

from edge.adapter import Adapter
from edge.controls.mtconnect.check import describe
from edge.controls.mtconnect.config import MtconnectConfig
from edge.controls.mtconnect.connection import MtconnectConnection
from edge.controls.mtconnect.cursor import parse, place, resume, start
from edge.controls.mtconnect.draft import draft
from edge.controls.mtconnect.mapping import address_of

ADAPTER = Adapter(
    name="mtconnect",
    schemes=("http", "https"),
    config_model=MtconnectConfig,
    start=start,
    place=place,
    resume=resume,
    parse=parse,
    connect=MtconnectConnection,
    describe=describe,
    draft=draft,
    sample_config=Path(__file__).with_name("mtconnect.toml"),
    address=address_of,
)
