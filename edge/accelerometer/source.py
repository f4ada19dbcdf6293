"""The source of blocks of acceleration: a TCP connection, or a file that is played at its own pace. I/O only.

A TCP source reconnects by itself, waiting longer after each failure, with jitter. No call blocks for longer than `LOOK_S`, and
`close` ends it from any thread. None in place of a block says that nothing came for so long.
"""

import csv
import random
import socket
import threading
import time
import wave
from collections.abc import Callable, Iterable, Iterator
from itertools import count
from pathlib import Path
from typing import IO

from edge.accelerometer.frame import Block, Frames
from edge.accelerometer.section import AccelerometerSection
from edge.errors import ConfigError, ConnectionLostError, DocumentError

LOOK_S = 0.5
SILENCE_S_MAX = 5.0
BACKOFF_S = 0.25
BACKOFF_S_MAX = 10.0
READ_BYTES = 65_536
LINE_BYTES_MAX = 4096


class Source:
    """Blocks until `close`; `last_error` says why there are none at present."""

    def __init__(self, section: AccelerometerSection, *, chance: random.Random | None = None) -> None:
        self.reconnects = 0
        self.last_error = ""
        self._section = section
        self._chance = chance or random.Random()  # noqa: S311  jitter, not a secret
        self._closed = threading.Event()

    def close(self) -> None:
        """End `blocks`, from any thread, within `LOOK_S`."""
        self._closed.set()

    def pause(self, seconds: float) -> None:
        """Let a sender that is too fast wait, unless it is closed meanwhile."""
        self._closed.wait(seconds)

    def blocks(self, wait: Callable[[float], object] | None = None) -> Iterator[Block | None]:
        """Blocks in order. `wait` lets time pass between the blocks of a file."""
        if self._section.is_file:
            yield from self._played(wait or self._closed.wait)
        else:
            yield from self._received()

    def _played(self, wait: Callable[[float], object]) -> Iterator[Block | None]:
        try:
            for block in file_blocks(self._section):
                wait(len(block.samples_g) / block.rate_hz)
                if self._closed.is_set():
                    return
                yield block
            self.last_error = f"{self._section.url}: the recording is over"
        except (OSError, EOFError, wave.Error, DocumentError, ConfigError) as error:
            self.last_error = f"{self._section.url}: {error}"
        while not self._closed.wait(LOOK_S):
            yield None

    def _received(self) -> Iterator[Block | None]:
        failures = 0
        while not self._closed.is_set():
            try:
                with socket.create_connection(self._section.address, timeout=SILENCE_S_MAX) as connection:
                    connection.settimeout(LOOK_S)
                    for block in self._stream(connection):
                        failures = 0 if block is not None else failures
                        yield block
            except (OSError, ConnectionLostError, DocumentError) as error:
                if self._closed.is_set():
                    return
                self.reconnects += 1
                failures += 1
                self.last_error = f"{self._section.url}: {str(error) or type(error).__name__}"
                yield None
                longest_s = min(BACKOFF_S_MAX, BACKOFF_S * 2.0 ** min(failures, 16))
                self._closed.wait(longest_s * self._chance.uniform(0.5, 1.0))

    def _stream(self, connection: socket.socket) -> Iterator[Block | None]:
        frames, whole_s = Frames(), time.monotonic()
        while not self._closed.is_set():
            try:
                data = connection.recv(READ_BYTES)
            except TimeoutError:
                yield None
            else:
                if not data:
                    raise ConnectionLostError("the sender closed the connection")
                for block in frames.feed(data):
                    whole_s = time.monotonic()
                    yield block
            if time.monotonic() - whole_s >= SILENCE_S_MAX:  # one that drips is as silent as one that sends nothing
                raise ConnectionLostError(f"no whole block for {SILENCE_S_MAX:g} s")


def file_blocks(section: AccelerometerSection) -> Iterator[Block]:
    """The blocks of a file, numbered from 0, without a time of their own unless it is one of frames."""
    path = Path(section.file)
    suffix = path.suffix.lower()
    if suffix == ".acb":
        with path.open("rb") as file:
            yield from _frames_of(file)
    elif suffix == ".wav":
        with wave.open(str(path), "rb") as recording:
            yield from _wave_blocks(recording, section)
    else:
        with path.open(encoding="utf-8", newline="") as lines:
            yield from _cut(_column(lines, path), section.sample_rate_hz, section.block_s)


def _frames_of(file: IO[bytes]) -> Iterator[Block]:
    frames = Frames()
    while data := file.read(READ_BYTES):
        yield from frames.feed(data)
    if not frames.is_between:
        raise DocumentError("the last frame is not whole")


def _wave_blocks(recording: wave.Wave_read, section: AccelerometerSection) -> Iterator[Block]:
    """The first channel. A WAV of 8 bits is unsigned, the others are signed and little-endian."""
    width, channels, rate_hz = recording.getsampwidth(), recording.getnchannels(), recording.getframerate()
    if section.sample_rate_hz and section.sample_rate_hz != rate_hz:
        raise ConfigError(f"sample_rate_hz = {section.sample_rate_hz:g}, but the file has {rate_hz} Hz; remove it")
    step, full = width * channels, 2.0 ** (8 * width - 1)
    size = max(2, round(section.block_s * rate_hz))
    for number in count():
        data = recording.readframes(size)
        if not data:
            return
        if width == 1:
            counts: Iterable[int] = (value - 128 for value in data[::step])
        else:
            counts = (int.from_bytes(data[at : at + width], "little", signed=True) for at in range(0, len(data), step))
        yield Block(number, float(rate_hz), None, tuple([value / full * section.scale_g for value in counts]))


def _column(lines: IO[str], path: Path) -> Iterator[float]:
    """The column `acceleration_g`, or the only one there is."""
    rows = csv.reader(_bounded(lines))
    header = [name.strip() for name in next(rows, [])]
    if "acceleration_g" in header:
        column = header.index("acceleration_g")
    elif len(header) == 1:
        column = 0
    else:
        raise DocumentError(f"{path.name}: its first line has to name a column acceleration_g; it has {', '.join(header)[:80]!r}")
    for number, row in enumerate(rows, start=2):
        try:
            yield float(row[column])
        except (ValueError, IndexError) as error:
            raise DocumentError(f"{path.name}: line {number}: no number in column {column + 1}") from error


def _bounded(lines: IO[str]) -> Iterator[str]:
    while line := lines.readline(LINE_BYTES_MAX):
        if len(line) >= LINE_BYTES_MAX:
            raise DocumentError(f"a line of more than {LINE_BYTES_MAX} characters")
        yield line


def _cut(samples: Iterator[float], rate_hz: float, block_s: float) -> Iterator[Block]:
    size, held = max(2, round(block_s * rate_hz)), list[float]()
    number = count()
    for value in samples:
        held.append(value)
        if len(held) == size:
            yield Block(next(number), rate_hz, None, tuple(held))
            held.clear()
    if held:
        yield Block(next(number), rate_hz, None, tuple(held))
