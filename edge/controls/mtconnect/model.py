"""The device description of an agent (/probe): which data items there are, with type, unit and the component they belong to.

Source: MTConnect part 2 (devices). Values in streams are in `units`; the agent has converted them from `nativeUnits` already, so
the native unit matters only where `units` is missing.
"""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from xml.etree.ElementTree import Element

from edge.controls.mtconnect.xml import local_name
from edge.errors import DocumentError

DATA_ITEMS_MAX = 20_000


@dataclass(frozen=True, slots=True)
class DataItem:
    """One data item. `component` is the element name (Linear, Rotary, Path, …) of what it belongs to."""

    id: str
    name: str
    category: str
    type: str
    sub_type: str
    units: str
    native_units: str
    representation: str
    statistic: str
    coordinates: str  # MACHINE, WORK, … or ""
    component: str
    component_id: str
    component_name: str
    parents: tuple[str, ...]  # element names of the components above, outermost first
    low: float | None
    high: float | None

    @property
    def unit(self) -> str:
        """The unit that values in streams have."""
        return self.units or self.native_units

    @property
    def label(self) -> str:
        """Return what people call it."""
        return self.name or self.id


@dataclass(frozen=True, slots=True)
class DeviceModel:
    """One device. The agent describes itself as a device of its own from 2.0 on: `is_agent`."""

    name: str
    uuid: str
    is_agent: bool
    items: tuple[DataItem, ...]

    def item(self, key: str) -> DataItem | None:
        """The data item with this id or, if none has it, the one with this name."""
        by_id = next((item for item in self.items if item.id == key), None)
        return by_id or next((item for item in self.items if item.name == key), None)


def devices_of(root: Element) -> tuple[DeviceModel, ...]:
    """The devices of a parsed MTConnectDevices document."""
    devices = next((child for child in root if local_name(child) == "Devices"), None)
    return tuple(_device(element) for element in (() if devices is None else devices))


def _device(element: Element) -> DeviceModel:
    systems = _coordinate_systems(element)
    items: list[DataItem] = []
    for item in _items(element, (), systems):
        items.append(item)
        if len(items) > DATA_ITEMS_MAX:
            raise DocumentError(f"device {element.get('name')!r} has more than {DATA_ITEMS_MAX} data items")
    return DeviceModel(element.get("name", ""), element.get("uuid", ""), local_name(element) == "Agent", tuple(items))


def _coordinate_systems(device: Element) -> dict[str, str]:
    """Type by id: a coordinate system may be referred to instead of named (2.x)."""
    return {e.get("id", ""): e.get("type", "") for e in device.iter() if local_name(e) == "CoordinateSystem"}


def _items(component: Element, parents: tuple[str, ...], systems: Mapping[str, str]) -> Iterator[DataItem]:
    for group in component:
        kind = local_name(group)
        if kind == "DataItems":
            yield from (_item(e, component, parents, systems) for e in group if local_name(e) == "DataItem")
        elif kind == "Components":
            for child in group:
                yield from _items(child, (*parents, local_name(component)), systems)


def _item(element: Element, component: Element, parents: tuple[str, ...], systems: Mapping[str, str]) -> DataItem:
    def word(name: str) -> str:
        return element.get(name, "").strip()

    coordinates = word("coordinateSystem") or systems.get(word("coordinateSystemIdRef"), "")
    return DataItem(
        id=word("id"),
        name=word("name"),
        category=word("category").upper(),
        type=word("type").upper(),
        sub_type=word("subType").upper(),
        units=word("units").upper(),
        native_units=word("nativeUnits").upper(),
        representation=word("representation").upper(),
        statistic=word("statistic").upper(),
        coordinates=coordinates.upper(),
        component=local_name(component),
        component_id=component.get("id", ""),
        component_name=component.get("name", ""),
        parents=parents,
        low=_limit(element, "Minimum"),
        high=_limit(element, "Maximum"),
    )


def _limit(element: Element, name: str) -> float | None:
    for part in element.iter():
        if local_name(part) == name:
            try:
                return float((part.text or "").strip())
            except ValueError:
                return None
    return None
