"""The watch on the tool in the spindle: which asset it is, and whether the agent has to be asked for it.

TOOL_ASSET_ID names the tool, ASSET_CHANGED an asset that has changed, which a control that counts tool life says often: so it is
asked for again only `ASK_MS_MIN` after the last time, by the agent's clock. Its heartbeats carry that clock too, so the last
change before a machine falls silent is read as well.

>>> watch = AssetWatch(tool_item="t", changed_item="c").after("t", "42.1", 1_000, 7).due(5_000)
>>> changed = watch.asked().after("c", "42.1", 2_000, 8)
>>> watch.is_wanted, changed.due(6_000).is_wanted, changed.due(10_000).is_wanted
(True, False, True)
"""

from dataclasses import dataclass, replace

from edge.controls.mtconnect.model import DeviceModel
from edge.errors import ConfigError

ASK_MS_MIN = 5_000
NOTHING = ("", "UNAVAILABLE")


@dataclass(frozen=True, slots=True)
class AssetWatch:
    """`asset_id`: the tool in the spindle, "" where there is none or none is known; `at_ms`, `sequence`: what it rests on.

    machine_ms: the machine's own time by now
    is_wanted: the agent is to be asked now; is_stale: it is to be asked when `ASK_MS_MIN` have passed since `asked_ms`, which the
    agent's clock showed
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
        if item == self.tool_item:
            asset_id = "" if value in NOTHING else value
            return replace(self, asset_id=asset_id, is_wanted=bool(asset_id), is_stale=False, at_ms=time_ms, sequence=sequence)
        if item == self.changed_item and value == self.asset_id and value:
            return replace(self, is_stale=True, at_ms=time_ms, sequence=sequence)
        return self

    def due(self, now_ms: int) -> "AssetWatch":
        """Return the watch when the agent's clock shows `now_ms`: wanted where it is time to ask, or the clock was set back."""
        has_waited = not 0 <= now_ms - self.asked_ms < ASK_MS_MIN
        return replace(self, is_wanted=True, asked_ms=now_ms) if self.is_wanted or (self.is_stale and has_waited) else self

    def asked(self) -> "AssetWatch":
        """Return the watch when the agent has answered, whatever it was."""
        return replace(self, is_wanted=False, is_stale=False)


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
