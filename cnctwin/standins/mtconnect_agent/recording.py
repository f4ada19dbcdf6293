"""A recording on disk: its lines in file order, and the device model that gives its keys a meaning."""

import re
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from cnctwin.standins.mtconnect_agent.device_draft import draft_device_model
from cnctwin.standins.mtconnect_agent.device_model import Device, DeviceModel, read_device_model
from cnctwin.standins.mtconnect_agent.errors import DeviceModelError, RecordingError
from cnctwin.standins.mtconnect_agent.shdr import Command, Line, Unusable, parse_lines

DEVICES_BYTES_MAX = 16_000_000


@dataclass(frozen=True)
class Recording:
    """A recorded SHDR or `time|key|value` file."""

    path: Path

    def __post_init__(self) -> None:
        if not self.path.is_file():
            raise RecordingError(f"there is no recording {self.path}; give the path of an SHDR or time|key|value file")

    def lines(self) -> Iterator[Line | Command | Unusable]:
        """Yield the lines in file order; bytes that aren't UTF-8 become U+FFFD."""
        with self.path.open(encoding="utf-8", errors="replace", newline="\n") as file:
            yield from parse_lines(file)

    def passes(self, loop: bool) -> Iterator[Iterator[Line | Command | Unusable]]:
        """Yield the lines once, or in a loop again and again; a recording without a line is not looped."""
        yield self.lines()
        if loop and any(True for _ in self.lines()):
            while True:
                yield self.lines()

    def device_model(self, devices: Path | None, device: str | None, schema: tuple[int, int]) -> tuple[DeviceModel, Device]:
        """Read the device model, or draft one, and choose the device whose keys the recording carries."""
        if devices is None:
            name = re.sub(r"[^A-Za-z0-9_.-]", "_", device or self.path.stem)
            model = read_device_model(draft_device_model(name, self.lines()), schema)
            return model, model.devices[0]
        model = read_device_model(_read_text(devices), schema)
        return model, self._choose(model, devices, device)

    def _choose(self, model: DeviceModel, devices: Path, key: str | None) -> Device:
        names = ", ".join(d.name for d in model.devices)
        if key is not None:
            chosen = model.device(key)
            if chosen is None:
                raise RecordingError(f"{devices} has no device {key!r}; it has {names}")
            return chosen
        if len(model.devices) == 1:
            return model.devices[0]
        named = [d for d in model.devices if d.name.lower() in self.path.name.lower()]
        if not named:
            raise RecordingError(
                f"{devices} has {len(model.devices)} devices and none is named in {self.path.name}; say which: {names}"
            )
        return max(named, key=lambda d: len(d.name))


def _read_text(path: Path) -> str:
    if not path.is_file():
        raise DeviceModelError(f"there is no device model {path}; give the path of a Devices.xml")
    size = path.stat().st_size
    if size > DEVICES_BYTES_MAX:
        raise DeviceModelError(f"{path} has {size} bytes, more than the {DEVICES_BYTES_MAX} that are read")
    try:
        return path.read_text(encoding="utf-8-sig")
    except UnicodeDecodeError as error:
        raise DeviceModelError(f"{path} isn't UTF-8 ({error}); convert it") from error
