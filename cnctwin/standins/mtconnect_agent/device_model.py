"""The device model: which machine has which data items, read from a Devices.xml of any schema version."""

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field
from xml.etree import ElementTree

from cnctwin.standins.mtconnect_agent.errors import DeviceModelError
from cnctwin.standins.mtconnect_agent.shdr import CONDITION_WIDTH
from cnctwin.standins.mtconnect_agent.units import Conversion, conversion
from cnctwin.standins.mtconnect_agent.xml_text import attributes, escape, local_name, parse_xml

UNAVAILABLE = "UNAVAILABLE"
DATA_ITEMS_MAX = 20_000

CATEGORY_ELEMENTS = {"SAMPLE": "Samples", "EVENT": "Events", "CONDITION": "Condition"}
_CATEGORY_ORDER = tuple(CATEGORY_ELEMENTS)
_REPRESENTATION_SUFFIX = {"DATA_SET": "DataSet", "TABLE": "Table", "TIME_SERIES": "TimeSeries", "DISCRETE": "Discrete"}
_UNUSUAL_WORDS = {"AC": "AC", "DC": "DC", "PH": "PH", "IP": "IP", "URI": "URI", "MTCONNECT": "MTConnect"}
_SHOWN_ATTRIBUTES = (("subType", "sub_type"), ("compositionId", "composition_id"), ("statistic", "statistic"))


@dataclass(frozen=True)
class Component:
    """A part of the machine that owns data items; the device itself is one."""

    element: str
    id: str
    name: str | None


@dataclass(frozen=True, eq=False)  # compared by identity: it is a dictionary key on the hot path
class DataItem:
    """One data item. `width` is the number of SHDR values it takes; `constant` its only possible value, if it has one."""

    id: str
    name: str | None
    category: str
    type: str
    component: Component
    device_name: str
    sub_type: str | None = None
    representation: str = "VALUE"
    composition_id: str | None = None
    statistic: str | None = None
    is_discrete: bool = False
    is_vector: bool = False
    constant: str | None = None
    conversion: Conversion | None = None
    rank: int = 0
    element: str = field(init=False)
    shown: str = field(init=False)
    width: int = field(init=False)

    def __post_init__(self) -> None:
        if self.category not in CATEGORY_ELEMENTS:
            raise DeviceModelError(
                f"data item {self.id!r} has category {self.category!r}; it must be one of {', '.join(CATEGORY_ELEMENTS)}"
            )
        shown = {"dataItemId": self.id}
        if self.name:
            shown["name"] = self.name
        shown |= {name: value for name, attr in _SHOWN_ATTRIBUTES if (value := getattr(self, attr))}
        if self.is_condition:
            shown["type"] = self.type
        object.__setattr__(self, "shown", attributes(shown))
        object.__setattr__(self, "element", element_name(self.type) + _REPRESENTATION_SUFFIX.get(self.representation, ""))
        object.__setattr__(self, "width", self._width())

    @property
    def is_condition(self) -> bool:
        return self.category == "CONDITION"

    @property
    def is_sample(self) -> bool:
        return self.category == "SAMPLE"

    @property
    def is_data_set(self) -> bool:
        return self.representation in ("DATA_SET", "TABLE")

    @property
    def is_message(self) -> bool:
        return self.type == "MESSAGE"

    @property
    def is_asset_event(self) -> bool:
        return self.type in ("ASSET_CHANGED", "ASSET_REMOVED")

    def _width(self) -> int:
        if self.is_condition or self.type == "ALARM":
            return CONDITION_WIDTH
        if self.representation == "TIME_SERIES":
            return 3
        return 2 if self.is_message or self.is_asset_event else 1


@dataclass(frozen=True)
class Device:
    """One machine: its data items in document order, and the XML that /probe shows."""

    id: str
    name: str
    uuid: str
    items: tuple[DataItem, ...]
    element: ElementTree.Element
    by_key: dict[str, DataItem]

    def item_of_type(self, item_type: str) -> DataItem | None:
        """Return the device's own item of a type, such as ASSET_CHANGED."""
        return next((i for i in self.items if i.type == item_type and i.component.element == "Device"), None)


@dataclass(frozen=True)
class DeviceModel:
    """All devices of a Devices.xml."""

    devices: tuple[Device, ...]

    def device(self, key: str) -> Device | None:
        """Return the device of this name, uuid or id."""
        return next((d for d in self.devices if key in (d.name, d.uuid, d.id)), None)

    @property
    def items(self) -> Iterator[DataItem]:
        return (item for device in self.devices for item in device.items)


def element_name(item_type: str) -> str:
    """Turn a type into the name of its element.

    >>> element_name("PATH_FEEDRATE"), element_name("PH"), element_name("x:GRIPPER_STATE")
    ('PathFeedrate', 'PH', 'x:GripperState')
    """
    prefix, colon, name = item_type.rpartition(":")
    return prefix + colon + "".join(_UNUSUAL_WORDS.get(word, word.capitalize()) for word in name.split("_"))


def read_device_model(text: str, schema: tuple[int, int]) -> DeviceModel:
    """Read a Devices.xml; `schema` is the version the agent will speak, which decides the items it adds of its own."""
    root = parse_xml(text)
    found = [e for e in root.iter() if local_name(e.tag) == "Device"]
    if not found:
        raise DeviceModelError(f"no Device in the device model, its root is <{local_name(root.tag)}>")
    devices: list[Device] = []
    rank = 0
    for element in found:
        devices.append(_device(element, schema, rank))
        rank += len(devices[-1].items)
        if rank > DATA_ITEMS_MAX:
            raise DeviceModelError(f"more than {DATA_ITEMS_MAX} data items in the device model; split the file")
    names = [d.name for d in devices]
    twice = next((n for n in names if names.count(n) > 1), None)
    if twice is not None:
        raise DeviceModelError(f"two devices are named {twice!r}; a name says which device is meant, so change one")
    return DeviceModel(tuple(devices))


def _device(element: ElementTree.Element, schema: tuple[int, int], rank: int) -> Device:
    device_id, name, uuid = (element.get(a) for a in ("id", "name", "uuid"))
    if not (device_id and uuid):
        raise DeviceModelError(f"a Device without id or uuid: id {device_id!r}, uuid {uuid!r}; give it both")
    _add_own_items(element, device_id, schema)
    drafts = list(_data_items(element, name or uuid))
    order = sorted(drafts, key=lambda i: (i.component.id, _CATEGORY_ORDER.index(i.category), i.id))
    for place, item in enumerate(order):
        object.__setattr__(item, "rank", rank + place)
    by_key: dict[str, DataItem] = {}
    sources = _source_keys(element)
    for keys in ((i.id for i in drafts), (i.name for i in drafts), (sources.get(i.id) for i in drafts)):
        for key, item in zip(keys, drafts, strict=True):
            if key:
                by_key.setdefault(key, item)
    return Device(device_id, name or uuid, uuid, tuple(drafts), element, by_key)


def _data_items(owner: ElementTree.Element, device_name: str) -> Iterator[DataItem]:
    component = Component(local_name(owner.tag), owner.get("id", ""), owner.get("name"))
    for element in _children(owner, "DataItems"):
        if local_name(element.tag) == "DataItem":
            yield _data_item(element, component, device_name)
    for element in _children(owner, "Components"):
        yield from _data_items(element, device_name)


def _data_item(element: ElementTree.Element, component: Component, device_name: str) -> DataItem:
    item_id, category, item_type = (element.get(a, "") for a in ("id", "category", "type"))
    if not (item_id and item_type):
        raise DeviceModelError(f"a DataItem without id or type in {component.element} {component.id!r}")
    units = element.get("units")
    return DataItem(
        id=item_id,
        name=element.get("name"),
        category=category,
        type=item_type,
        component=component,
        device_name=device_name,
        sub_type=element.get("subType"),
        representation=element.get("representation", "VALUE"),
        composition_id=element.get("compositionId"),
        statistic=element.get("statistic"),
        is_discrete=element.get("discrete") == "true" or element.get("representation") == "DISCRETE",
        is_vector=bool(units and units.endswith("_3D")),
        constant=_constant(element),
        conversion=conversion(element.get("nativeUnits"), units, element.get("nativeScale")),
    )


def _constant(element: ElementTree.Element) -> str | None:
    values = [v for v in _children(element, "Constraints") if local_name(v.tag) == "Value"]
    return (values[0].text or "").strip() if len(values) == 1 else None


def _source_keys(device: ElementTree.Element) -> dict[str, str]:
    """Return the adapter's key of each data item that has one in its Source element."""
    keys: dict[str, str] = {}
    for item in device.iter():
        if isinstance(item.tag, str) and local_name(item.tag) == "DataItem":
            text = next((c.text for c in item if isinstance(c.tag, str) and local_name(c.tag) == "Source"), None)
            if text and text.strip():
                keys[item.get("id", "")] = text.strip()
    return keys


def _children(owner: ElementTree.Element, group: str) -> Iterable[ElementTree.Element]:
    for child in owner:
        if isinstance(child.tag, str) and local_name(child.tag) == group:
            yield from (c for c in child if isinstance(c.tag, str))


def _add_own_items(device: ElementTree.Element, device_id: str, schema: tuple[int, int]) -> None:
    """Add what an agent adds to a device that lacks it: availability and the asset events of its schema version."""
    own = next((c for c in device if isinstance(c.tag, str) and local_name(c.tag) == "DataItems"), None)
    if own is None:
        own = ElementTree.Element("DataItems")
        after = [i for i, c in enumerate(device) if local_name(str(c.tag)) in ("Description", "Configuration")]
        device.insert(after[-1] + 1 if after else 0, own)
    present = {item.get("type") for item in own}
    added: list[tuple[tuple[int, int], dict[str, str]]] = [
        ((1, 2), {"id": f"{device_id}_avail", "type": "AVAILABILITY"}),
        ((1, 2), {"id": f"{device_id}_asset_chg", "type": "ASSET_CHANGED"}),
        ((1, 3), {"id": f"{device_id}_asset_rem", "type": "ASSET_REMOVED"}),
        ((2, 0), {"id": f"{device_id}_asset_count", "type": "ASSET_COUNT", "representation": "DATA_SET"}),
    ]
    for since, attribute in added:
        if schema >= since and attribute["type"] not in present:
            if attribute["type"] == "ASSET_CHANGED" and schema >= (1, 5):
                attribute["discrete"] = "true"
            own.append(ElementTree.Element("DataItem", {"category": "EVENT", **attribute}))


def device_attributes(device: Device) -> str:
    """Write the attributes of a DeviceStream."""
    return f' name="{escape(device.name)}" uuid="{escape(device.uuid)}"'
