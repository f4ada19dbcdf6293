"""The table [focas] of an edge's configuration."""

from enum import StrEnum
from typing import Annotated

from pydantic import AfterValidator, Field, model_validator

from edge.config import EdgeConfig
from edge.controls.focas.pmc import PmcAddress, pmc_address
from edge.errors import ConfigError
from edge.section import Section


class Backend(StrEnum):
    """The way to the control: the user's own library, or the protocol itself (experimental)."""

    LIBRARY = "library"
    ETHERNET = "ethernet"


class ToolSource(StrEnum):
    """The source of the tool number."""

    AUTO = "auto"  # cnc_toolnum; else the T code: on a lathe at once, on a machining centre when M6 works on it
    TOOLNUM = "toolnum"
    MODAL = "modal"  # the T code as it stands
    MODAL_AT_CHANGE = "modal_at_change"  # the T code at the last tool change: programs that call the next tool ahead


class LifeUnit(StrEnum):
    """The unit in which the control counts tool life. Its screen tells; the functions do not."""

    UNKNOWN = ""  # then tool life is not read
    MINUTES = "minutes"
    USES = "uses"


class Group(StrEnum):
    """Groups of values that can be left out, to ask the control less."""

    BLOCK = "block"
    MODAL = "modal"
    LOADS = "loads"
    OVERRIDES = "overrides"
    ALARMS = "alarms"
    OFFSET = "offset"
    CLOCK = "clock"
    MESSAGES = "messages"
    COMMENT = "comment"
    HISTORY = "history"


def _address(text: str) -> PmcAddress:
    try:
        return pmc_address(text)
    except ConfigError as error:
        raise ValueError(str(error)) from error


def _bit(text: str) -> str:
    if text and _address(text).bit is None:
        raise ValueError(f"{text!r} names no bit; write it as {text.partition(':')[0]}.0")
    return text.upper()


def _register(text: str) -> str:
    if text and _address(text).bit is not None:
        raise ValueError(f"{text!r} is one bit; name a byte, such as D100, or several, such as D100:2")
    return text.upper()


OVERRIDE_BYTES = ("G12.", "G14.", "G30.")


class FocasConfig(Section):
    """The control and how it is asked. `library` is the path of the user's own fwlib; `path` counts from 1."""

    host: str = Field(default="127.0.0.1", min_length=1, pattern=r"^[^/@\s]+$")
    port: int = Field(default=8193, ge=1, le=65_535)
    backend: Backend = Backend.ETHERNET
    library: str = ""
    path: int = Field(default=1, ge=1, le=15)
    interval_ms: int = Field(default=200, ge=20, le=60_000)
    slow_interval_ms: int = Field(default=1000, ge=100, le=600_000)
    rare_interval_s: float = Field(default=10.0, ge=1, le=3600)
    clock_interval_s: float = Field(default=10.0, ge=1, le=3600)
    utc_offset_min: int = Field(default=0, ge=-840, le=840)
    timeout_s: float = Field(default=2.0, ge=0.05, le=60)
    groups: frozenset[Group] = frozenset(Group)
    tool_number: ToolSource = ToolSource.AUTO
    tool_life_unit: LifeUnit = LifeUnit.UNKNOWN
    tool_change_m_codes: tuple[Annotated[int, Field(ge=0, le=99_999_999)], ...] = Field(default=(6,), max_length=16)
    tool_change_pmc: Annotated[str, AfterValidator(_bit)] = ""
    tool_number_pmc: Annotated[str, AfterValidator(_register)] = ""

    @model_validator(mode="after")
    def _has_library(self) -> "FocasConfig":
        if self.backend is Backend.LIBRARY and not self.library:
            raise ValueError(
                'backend = "library" needs library = "/path/of/libfwlib32.so": the library that came with your FOCAS'
            )
        if self.backend is Backend.ETHERNET and self.tool_number is ToolSource.TOOLNUM:
            raise ValueError('tool_number = "toolnum" needs backend = "library": the protocol has no known command for it')
        if self.backend is Backend.ETHERNET and self.tool_life_unit is not LifeUnit.UNKNOWN:
            raise ValueError(
                f'tool_life_unit = "{self.tool_life_unit}" needs backend = "library": no command of the protocol is known for it'
            )
        if self.tool_change_pmc.upper().startswith(OVERRIDE_BYTES):
            raise ValueError(
                f'tool_change_pmc = "{self.tool_change_pmc}" lies in a byte of an override; name the bit of the builder\'s ladder'
            )
        return self


Config = EdgeConfig[FocasConfig]
