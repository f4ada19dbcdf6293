"""The table `[accelerometer]` of an edge: a sensor beside the control that sends blocks of raw acceleration."""

from enum import StrEnum
from pathlib import PurePosixPath
from typing import Self
from urllib.parse import unquote, urlsplit

from pydantic import Field, model_validator

from edge.accelerometer.filter import HIGH_HZ, RATE_BANDS_MIN
from edge.accelerometer.frame import RATE_HZ_MAX
from edge.section import Section
from sparkplug.shown_address import shown_address

SUFFIXES = (".wav", ".csv", ".acb")
RATE_HZ_MIN = RATE_BANDS_MIN * HIGH_HZ


class Publish(StrEnum):
    """The choice of what goes to the broker: the figures that are computed here, the raw blocks, or both."""

    VALUES = "values"
    BLOCKS = "blocks"
    BOTH = "both"


class AccelerometerSection(Section):
    """The sensor; without a url there is none.

    url: tcp://host:port (frames, `edge/accelerometer/frame.py`), or file:///folder/name.wav, .csv or .acb, played at its pace
    sample_rate_hz: of a CSV, which does not say it; 0 = as frames and WAV say
    scale_g: full scale of the sensor: of a WAV's samples, and where a block counts as clipped
    block_s: length of the blocks that are published, and of those that a file is played in
    """

    url: str = ""
    sample_rate_hz: float = Field(default=0.0, ge=0.0, le=RATE_HZ_MAX)
    scale_g: float = Field(default=16.0, gt=0.0, le=100_000.0)
    block_s: float = Field(default=0.5, ge=0.01, le=5.0)
    publish: Publish = Publish.VALUES

    @property
    def address(self) -> tuple[str, int]:
        """Host and port of a tcp url."""
        parts = urlsplit(self.url)
        return parts.hostname or "", parts.port or 0

    @property
    def file(self) -> str:
        """The path of a file url."""
        return unquote(urlsplit(self.url).path)

    @property
    def is_file(self) -> bool:
        """Return whether blocks come from a file."""
        return self.url.startswith("file:")

    @model_validator(mode="after")
    def _can_be_opened(self) -> Self:
        if not self.url:
            return self
        shown, scheme = shown_address(self.url), self.url.partition(":")[0]
        if scheme not in {"tcp", "file"}:
            raise ValueError(f"url {shown!r}: use tcp://host:port or file:///folder/name.wav")
        try:
            host, port = self.address
            has_user = scheme == "tcp" and "@" in urlsplit(self.url).netloc
        except ValueError:
            raise ValueError(f"url {shown!r}: its host or port cannot be read; use tcp://host:port") from None
        if scheme == "tcp" and (has_user or not (host and port)):
            raise ValueError(f"url {shown!r}: use tcp://host:port, for instance tcp://127.0.0.1:9500")
        suffix = PurePosixPath(self.file).suffix.lower()
        if scheme == "file" and suffix not in SUFFIXES:
            raise ValueError(f"url {shown!r}: the file has to be one of {', '.join(SUFFIXES)}")
        if suffix == ".csv" and scheme == "file" and not self.sample_rate_hz:
            raise ValueError("sample_rate_hz: a CSV does not say it; set it")
        if self.sample_rate_hz and self.sample_rate_hz < RATE_HZ_MIN:
            raise ValueError(
                f"sample_rate_hz {self.sample_rate_hz:g} is below {RATE_HZ_MIN:g}, so there is no band up to {HIGH_HZ:g} Hz"
            )
        return self
