"""The table [mtconnect] of an edge's configuration."""

import re
from typing import Annotated

from pydantic import AfterValidator, Field

from edge.section import Section


def _http(url: str) -> str:
    if "@" in url:
        raise ValueError("must hold no user or password, since addresses are logged and published; use username and password_env")
    if not url.startswith(("http://", "https://")):
        raise ValueError("is no http:// or https:// address")
    if not re.fullmatch(r"https?://(\[[^/\s?#\]]+\]|[^/\s?#:]+)(:\d{1,5})?(/[^\s?#]*)?", url):
        raise ValueError("is not http://host[:port][/path] and nothing more")
    return url.rstrip("/")


class MtconnectConfig(Section):
    """The agent and how it is asked. Empty `device`: the only one; empty `spindle`: see `edge.controls.mtconnect.mapping`.

    tool_asset: the data item that names the tool in the spindle; empty: the first TOOL_ASSET_ID
    """

    url: Annotated[str, AfterValidator(_http)] = "http://127.0.0.1:5000"
    device: str = ""
    spindle: str = ""
    tool_asset: str = ""
    count: int = Field(default=1000, ge=1, le=100_000)
    interval_ms: int = Field(default=100, ge=1, le=60_000)
    heartbeat_ms: int = Field(default=2000, ge=100, le=60_000)
    poll_ms: int = Field(default=500, ge=10, le=600_000)  # where the agent does not stream
    timeout_s: float = Field(default=10.0, gt=0, le=300)
    username: str = ""
    password_env: str = ""
    ca_file: str = ""
