"""The edge for controls with an OPC UA server: SINUMERIK, and those that follow OPC 40501-1 or OPC 40502.

`maps/*.toml` say which node is which signal, `resolve` finds the nodes, `session` holds the line, `delivery` finds what is
missing, `cursor` parses. Alarms come as events: `event_session` hears them, `alarm_table` folds them, `alarm_samples` publishes
the list. `tool_reader` and `life_reader` ask for what belongs to the tool in the spindle. The library asyncua is an extra: only a
connection imports it.

Documentation: docs/how-to/edge-opcua.md. Every key of the configuration: opcua.toml beside this file, edge/edge.toml.
"""

from pathlib import Path

from edge.adapter import Adapter
from edge.controls.opcua.address import node_of_address
from edge.controls.opcua.check import describe
from edge.controls.opcua.config import OpcUaConfig
from edge.controls.opcua.connection import OpcUaConnection
from edge.controls.opcua.cursor import parse, place, resume, start
from edge.controls.opcua.draft import draft

ADAPTER = Adapter(
    name="opcua",
    schemes=("opc.tcp",),
    config_model=OpcUaConfig,
    start=start,
    place=place,
    resume=resume,
    parse=parse,
    connect=OpcUaConnection,
    describe=describe,
    draft=draft,
    address=node_of_address,
    sample_config=Path(__file__).with_name("opcua.toml"),
)
