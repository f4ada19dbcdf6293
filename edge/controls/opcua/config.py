"""The table [opcua] of an edge's configuration."""

import re
from typing import Annotated, Literal

from pydantic import AfterValidator, Field, model_validator

from edge.config import EdgeConfig
from edge.controls.opcua.address import node_of_address
from edge.controls.opcua.point import TOOL, Point, maps, node_of
from edge.errors import ConfigError
from edge.section import Section

AUTO, NONE = "auto", "none"
SECURITY = (AUTO, NONE)
POLICIES = ("Aes256Sha256RsaPss", "Aes128Sha256RsaOaep", "Basic256Sha256")  # best first; older ones are not offered: SHA-1
MODES = ("SignAndEncrypt", "Sign")


def _address(url: str) -> str:
    if "@" in url:
        raise ValueError("must hold no user or password, since addresses are logged and published; use username and password_env")
    if not re.fullmatch(r"opc\.tcp://(\[[^/\s?#\]]+\]|[^/\s?#:]+)(:\d{1,5})?(/[^\s?#]*)?", url):
        raise ValueError("is no opc.tcp://host:port address")
    return url


def _security(text: str) -> str:
    policy, _, mode = text.partition(":")
    if text not in SECURITY and (policy not in POLICIES or mode not in MODES):
        raise ValueError(f"is none of auto, none, or one of {', '.join(POLICIES)} with :SignAndEncrypt or :Sign behind it")
    return text


def _fingerprint(text: str) -> str:
    plain = text.lower().removeprefix("sha256:").replace(":", "")
    if plain and not re.fullmatch(r"[0-9a-f]{64}", plain):
        raise ValueError("is no SHA-256 fingerprint: 64 hexadecimal digits")
    return plain


def _map(name: str) -> str:
    if name and name not in maps():
        raise ValueError(f"no such map; there are {', '.join(sorted(maps()))}, and '' for [signals.<name>] data_item alone")
    return name


def _events(text: str) -> str:
    if text not in (AUTO, NONE):
        try:
            node_of(text)
        except ConfigError as error:
            raise ValueError(f"is neither auto nor none, and {error}") from error
    return text


class OpcUaConfig(Section):
    """The server, how it is trusted, and how it is asked. `map` is a file of edge/controls/opcua/maps, without its ending."""

    url: Annotated[str, AfterValidator(_address)] = "opc.tcp://127.0.0.1:4840"
    map: Annotated[str, AfterValidator(_map)] = "sinumerik"
    channel: str = ""
    spindle: str = ""
    spindle_place: str = "spindle"
    events: Annotated[str, AfterValidator(_events)] = AUTO
    security: Annotated[str, AfterValidator(_security)] = AUTO
    server_fingerprint: Annotated[str, AfterValidator(_fingerprint)] = ""
    certificate_folder: str = ""
    username: str = ""
    password_env: str = ""
    user_certificate: str = ""
    user_key: str = ""
    publishing_ms: int = Field(default=100, ge=10, le=10_000)
    sampling_ms: int = Field(default=100, ge=0, le=10_000)
    queue_size: int = Field(default=50, ge=1, le=10_000)
    timestamps: Literal["source", "server"] = "source"
    timeout_s: float = Field(default=5.0, gt=0, le=300)

    @model_validator(mode="after")
    def _user_is_whole(self) -> "OpcUaConfig":
        if self.username and not self.password_env:
            raise ValueError("username needs password_env: the environment variable that holds the password")
        if bool(self.user_certificate) != bool(self.user_key):
            raise ValueError("user_certificate and user_key belong together: a certificate (DER or PEM) and its private key")
        if self.username and self.user_certificate:
            raise ValueError("username or user_certificate: a session has one user")
        return self


Config = EdgeConfig[OpcUaConfig]


def points_of(config: Config) -> tuple[Point, ...]:
    """Return what is to be read: the map's points, with the nodes that [signals.<name>] data_item puts in their place or adds.

    What [variables] and [plc] choose comes last.
    """
    ready = maps()[config.source.map].points if config.source.map else ()
    known = {point.signal: point for point in ready}
    own: dict[str, Point] = {}
    for name, section in config.signals.items():
        if section.data_item:
            words = known[name].words if name in known else {}
            try:
                own[name] = Point(signal=name, node=section.data_item, words=words, seen="the configuration")
            except ConfigError as error:
                raise ConfigError(f"{config.path}: signals.{name}.data_item: {error}") from error
    for one in config.chosen:
        own[one.signal] = Point(signal=one.signal, node=node_of_address(one), seen="the configuration")
    kept = [point for point in ready if point.signal not in own and not (point.signal == TOOL and "tool_number" in own)]
    return tuple(point for point in (*kept, *own.values()) if is_published(config, point.signal))


def is_published(config: Config, signal: str) -> bool:
    """Return False for a signal that the configuration keeps back."""
    section = config.signals.get("tool_number" if signal == TOOL else signal)
    return section is None or section.publish
