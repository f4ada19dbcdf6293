"""The edge for HEIDENHAIN controls over LSV2: iTNC 530, TNC 128, 320, 620, 640, and what of LSV2 a TNC7 answers.

`connection` looks at the control at a steady pace through `control` (pyLSV2) and `link`, which lets no telegram out that
writes; `cursor` makes samples of a look, with the tool from the program's text (`klartext`, `tool_flow`) where the control does
not tell it.

Documentation: docs/how-to/edge-heidenhain.md. Every key of the configuration: heidenhain.toml beside this file, edge/edge.toml.
"""

from pathlib import Path

from edge.adapter import Adapter
from edge.controls.heidenhain.address import address_of
from edge.controls.heidenhain.check import describe
from edge.controls.heidenhain.config import HeidenhainConfig
from edge.controls.heidenhain.connection import HeidenhainConnection
from edge.controls.heidenhain.cursor import parse, place, resume, start
from edge.controls.heidenhain.draft import draft

ADAPTER = Adapter(
    name="heidenhain",
    schemes=("lsv2",),
    config_model=HeidenhainConfig,
    start=start,
    place=place,
    resume=resume,
    parse=parse,
    connect=HeidenhainConnection,
    describe=describe,
    draft=draft,
    sample_config=Path(__file__).with_name("heidenhain.toml"),
    address=address_of,
)
