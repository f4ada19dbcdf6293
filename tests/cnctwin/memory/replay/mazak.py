"""Two hours of a real Mazak, as an edge would have said them: enough for bursts of UNAVAILABLE, stops, programs and tools."""

from pathlib import Path

from cnctwin.importing.into_store import recorded_messages
from cnctwin.importing.shdr import recorded_rows
from cnctwin.memory.store.contract import Message
from tests.recordings import recording

LINES = 16_000


def mazak_file(folder: Path, lines: int = LINES) -> tuple[Path, Path]:
    """The recording, cut, and its device model."""
    whole, devices = recording("nist/raw/Mazak01-20180718-20180719.txt"), recording("nist/devices.xml")
    cut = folder / whole.name
    with whole.open(encoding="utf-8") as source, cut.open("w", encoding="utf-8") as out:
        out.writelines(line for _, line in zip(range(lines), source, strict=False))
    return cut, devices


def mazak_hours(folder: Path, lines: int = LINES) -> list[Message]:
    """Its messages."""
    return list(recorded_messages(list(recorded_rows(*mazak_file(folder, lines))), "okuma"))
