"""Assets (cutting tools and the like): documents by id, the newest first, bounded."""

import base64
import hashlib
from typing import NamedTuple
from xml.etree import ElementTree

from cnctwin.standins.mtconnect_agent.errors import DeviceModelError
from cnctwin.standins.mtconnect_agent.xml_text import element_text, local_name, parse_xml


class Asset(NamedTuple):
    """One asset as it was last sent."""

    id: str
    type: str
    device_uuid: str
    timestamp: str
    element: ElementTree.Element
    hash: str
    is_removed: bool = False


def read_asset(asset_id: str, device_uuid: str, timestamp: str, xml: str) -> Asset | None:
    """Read an asset's XML; None where it is none."""
    try:
        element = parse_xml(xml)
    except DeviceModelError:
        return None
    digest = base64.b64encode(hashlib.sha256(element_text(element).encode()).digest()[:20]).decode()
    return Asset(asset_id, local_name(element.tag), device_uuid, timestamp, element, digest)


class AssetStore:
    """Assets of all devices. A removed one stays, marked; beyond `size` the one that changed longest ago goes."""

    def __init__(self, size: int) -> None:
        if size < 1:
            raise ValueError(f"room for {size} assets is less than 1")
        self.size = size
        self._by_id: dict[str, Asset] = {}  # the order in which the ids were first seen
        self._newest_last: dict[str, None] = {}

    @property
    def count(self) -> int:
        return sum(not a.is_removed for a in self._by_id.values())

    def get(self, asset_id: str) -> Asset | None:
        return self._by_id.get(asset_id)

    def put(self, asset: Asset) -> None:
        self._newest_last.pop(asset.id, None)
        if asset.id not in self._by_id and len(self._by_id) >= self.size:
            oldest = next(iter(self._newest_last))
            del self._newest_last[oldest], self._by_id[oldest]
        self._newest_last[asset.id] = None
        self._by_id[asset.id] = asset

    def remove(self, asset_id: str, timestamp: str) -> Asset | None:
        """Mark an asset as removed and return it; None where there is nothing to remove."""
        asset = self._by_id.get(asset_id)
        if asset is None or asset.is_removed:
            return None
        removed = asset._replace(is_removed=True, timestamp=timestamp)
        self._by_id[asset_id] = removed
        return removed

    def remove_all(self, asset_type: str, device_uuid: str, timestamp: str) -> list[Asset]:
        """Mark all assets of a device, or all of one type, in the order in which they were first seen."""
        matching = [a for a in self._by_id.values() if asset_type in ("", a.type) and a.device_uuid == device_uuid]
        return [removed for a in matching if (removed := self.remove(a.id, timestamp))]

    def count_of(self, asset_type: str, device_uuid: str) -> int:
        return sum(a.type == asset_type and a.device_uuid == device_uuid and not a.is_removed for a in self._by_id.values())

    def newest_first(
        self, *, asset_type: str | None = None, device_uuid: str | None = None, removed: bool = False
    ) -> list[Asset]:
        """Return the assets that match; removed ones only where they are asked for."""
        assets = (self._by_id[i] for i in reversed(self._newest_last))
        return [
            a
            for a in assets
            if (removed or not a.is_removed) and asset_type in (None, a.type) and device_uuid in (None, a.device_uuid)
        ]
