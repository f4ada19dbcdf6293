"""The watch on the tool in the spindle: which asset it is, and whether the agent has to be asked for it.

TOOL_ASSET_ID names the tool, ASSET_CHANGED an asset that has changed, which a control that counts tool life says often: so it is
asked for again only `ASK_MS_MIN` after the last time, by the machine's stamps.

>>> watch = AssetWatch(tool_item="t", changed_item="c")
>>> watch = watch.after("t", "42.1", 1_000, 7)
>>> watch.is_wanted, watch.asked().after("c", "42.1", 2_000, 8).is_wanted, watch.asked().after("c", "42.1", 12_000, 9).is_wanted
(True, False, True)
"""

from dataclasses import dataclass, replace

from edge.controls.mtconnect.model import DeviceModel
from edge.errors import ConfigError

ASK_MS_MIN = 10_000
NOTHING = ("", "UNAVAILABLE")


@dataclass(frozen=True, slots=True)
class AssetWatch:
    """`asset_id`: the tool in the spindle, "" where there is none or none is known; `at_ms`, `sequence`: what it rests on.

    machine_ms: the machine's own time by now
    is_wanted: the agent is to be asked now; is_stale: it is to be asked when `ASK_MS_MIN` have passed since `asked_ms`
    """

    tool_item: str = ""
    changed_item: str = ""
    asset_id: str = ""
    at_ms: int = 0
    machine_ms: int = 0
    sequence: int = 0
    is_wanted: bool = False
    is_stale: bool = False
    asked_ms: int = 0

    def after(self, item: str, value: str, time_ms: int, sequence: int) -> "AssetWatch":
        """Return the watch after one more observation of the device, of which the machine's own time is `time_ms`."""
        if not self.tool_item:
            return self
        watch = self
        if item == self.tool_item:
            asset_id = "" if value in NOTHING else value
            watch = replace(self, asset_id=asset_id, is_wanted=bool(asset_id), is_stale=False, at_ms=time_ms, sequence=sequence)
        elif item == self.changed_item and value == self.asset_id and value:
            watch = replace(self, is_stale=True, at_ms=time_ms, sequence=sequence)
        if watch.is_stale and time_ms - watch.asked_ms >= ASK_MS_MIN:
            return replace(watch, is_wanted=True)
        return watch

    def asked(self) -> "AssetWatch":
        """Return the watch when the agent has answered, whatever it was."""
        return replace(self, is_wanted=False, is_stale=False, asked_ms=self.at_ms)


def watch_of(device: DeviceModel, tool_asset: str) -> AssetWatch:
    """The watch on a device: the data item that the configuration names, or the first TOOL_ASSET_ID; none where there is none."""
    if tool_asset:
        item = device.item(tool_asset)
        if item is None:
            raise ConfigError(f"mtconnect.tool_asset = {tool_asset!r}: device {device.name!r} has no such item")
    else:
        item = next((one for one in device.items if one.type == "TOOL_ASSET_ID"), None)
    changed = next((one.id for one in device.items if one.type == "ASSET_CHANGED"), "")
    return AssetWatch("" if item is None else item.id, changed)
