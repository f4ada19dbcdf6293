"""The table [heidenhain] of an edge's configuration."""

import re
from enum import StrEnum
from typing import Annotated
from urllib.parse import urlsplit

from pydantic import AfterValidator, Field

from edge.config import EdgeConfig
from edge.controls.heidenhain.plc import PlcAddress
from edge.errors import ConfigError, EdgeError
from edge.section import Section
from edge.signals import signal
from twin.vocabulary.signals import DERIVED

PORT = 19000
TOOL_CHANGE = "tool_change"  # the key of [heidenhain.plc] that is no signal: a bit that is 1 during a change
SIGNALS_MAX = 64


class ToolSource(StrEnum):
    """The source of the tool number. `auto`: a PLC address if there is one, else the control if it tells, else the program."""

    AUTO = "auto"
    CONTROL = "control"
    PLC = "plc"
    PROGRAM = "program"


def _lsv2(url: str) -> str:
    try:
        host_and_port(url)
    except EdgeError as error:
        raise ValueError(str(error)) from None
    return url


def host_and_port(url: str) -> tuple[str, int]:
    """Host and port of an address.

    >>> host_and_port("lsv2://tnc640"), host_and_port("lsv2://10.0.0.7:19001")
    (('tnc640', 19000), ('10.0.0.7', 19001))
    """
    try:
        parts = urlsplit(url)
        host, port = parts.hostname, parts.port or PORT
    except ValueError:
        raise ConfigError("is no address: its host or port cannot be read; write it as lsv2://tnc640:19000") from None
    if parts.scheme != "lsv2" or not host:
        raise ConfigError("is no lsv2:// address, such as lsv2://tnc640:19000")
    if "@" in url or parts.path.strip("/") or parts.query or parts.fragment:
        raise ConfigError("must be lsv2://host:port and nothing more; a PLC password is named by plc_password_env")
    return host, port


def _plc(addresses: dict[str, str]) -> dict[str, str]:
    if len(addresses) > SIGNALS_MAX:
        raise ValueError(f"has {len(addresses)} addresses, which is above the limit of {SIGNALS_MAX}")
    for name, address in addresses.items():
        try:
            if name in DERIVED:
                raise ConfigError(f"is derived by the edge; give the bit of a change in progress as {TOOL_CHANGE}")
            if name != TOOL_CHANGE:
                signal(name)
            if name == TOOL_CHANGE and not re.match(r"[MIO]\d", address):
                raise ConfigError(f"{address!r} is no bit, such as M4000")
            PlcAddress.parse(address)
        except EdgeError as error:
            raise ValueError(f"{name}: {error}") from None
    return addresses


class HeidenhainConfig(Section):
    """The control and what is read.

    Without `plc` nobody logs in as PLCDEBUG, without `program_text` and `tool_table` nobody as FILE.
    """

    url: Annotated[str, AfterValidator(_lsv2)] = f"lsv2://127.0.0.1:{PORT}"
    interval_ms: int = Field(default=250, ge=50, le=60_000)
    timeout_s: float = Field(default=3.0, gt=0, le=60)  # for a whole look, and for the log-in
    tool_number_from: ToolSource = ToolSource.AUTO
    program_text: bool = True
    program_kib_max: int = Field(default=512, ge=1, le=1024)
    tool_table: str = Field(default="", max_length=200, pattern=r"^([A-Za-z0-9_]+:[^\x00]+)?$")
    tool_table_interval_s: float = Field(default=30.0, ge=1, le=86_400)
    slow_interval_ms: int = Field(default=1000, ge=50, le=600_000)  # [variables] and [plc]
    clock_interval_s: float = Field(default=10.0, ge=0, le=3600)  # 0: the clock is not read, and nobody logs in as DIAGNOSTICS
    clock_utc_offset_h: float = Field(default=0.0, ge=-14, le=14)  # what the control's seconds are ahead of UTC
    plc: Annotated[dict[str, str], AfterValidator(_plc)] = Field(default_factory=dict)
    plc_password_env: str = ""


Config = EdgeConfig[HeidenhainConfig]
