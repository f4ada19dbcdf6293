"""The edge for FANUC controls by FOCAS.

Two backends behind one interface (`edge.controls.focas.calls`): the user's own library, and the Ethernet protocol itself, which
is experimental. Both only read.

Documentation: docs/how-to/edge-focas.md. Every key of the configuration: focas.toml beside this file, edge/edge.toml.
"""

from pathlib import Path

from edge.adapter import Adapter
from edge.controls.focas.address import address_of
from edge.controls.focas.check import describe
from edge.controls.focas.config import FocasConfig
from edge.controls.focas.connection import FocasConnection
from edge.controls.focas.cursor import parse, place, resume, start
from edge.controls.focas.draft import draft

ADAPTER = Adapter(
    name="focas",
    schemes=("focas",),
    config_model=FocasConfig,
    start=start,
    place=place,
    resume=resume,
    parse=parse,
    connect=FocasConnection,
    describe=describe,
    draft=draft,
    sample_config=Path(__file__).with_name("focas.toml"),
    address=address_of,
)
