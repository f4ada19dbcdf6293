"""The mapping from data items of a device to canonical signals.

In order: what the configuration says; what the name says (`names.toml`, the names of Okuma, Mazak, Fanuc, Heidenhain,
Siemens and Hurco); what the standard's type says; axes by the letter of their component. An item feeds at most one signal.

A machine with several spindles has one canonical spindle: the first in the device description that reports both speed and load,
or the one that the configuration names. On the recorded Okuma MULTUS that is C1 with S1speed and S1load: of the time it turns it
is under load (> 5 %) for 48 s, the milling spindle S6 for 4 s, and S2 reports no load at all.
"""

import re
import tomllib
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from difflib import get_close_matches
from functools import cache
from importlib.resources import files
from typing import NamedTuple

from edge.chosen import Chosen
from edge.config import SignalSection
from edge.controls.mtconnect.model import DataItem, DeviceModel
from edge.errors import ConfigError
from edge.reading import Target
from edge.sample import Offer
from edge.signals import signal
from edge.units import conversion

_SPEEDS = ("ROTARY_VELOCITY", "SPINDLE_SPEED")
_ADDRESS = re.compile(r"([^\[\]\s]+)(?:\[([^\[\]]+)\])?")
_AXIS_NAME = re.compile(r"([A-Za-z])(\d{0,2})")


@dataclass(frozen=True, slots=True)
class Assignment:
    """The outcome: targets, what they are called in births, and what no signal stands for."""

    targets: tuple[Target, ...]
    offers: tuple[Offer, ...]
    unmapped: tuple[DataItem, ...]
    chosen: tuple["ChosenItem", ...]
    spindle: str
    spindles: tuple[str, ...]


class ChosenItem(NamedTuple):
    """A data item of [variables] or [plc], or one entry of a data set."""

    data_item_id: str
    key: str
    target: Target


def address_of(chosen: Chosen) -> tuple[str, str]:
    """The data item and the key of an address: `id`, `name`, or `id[key]` for an entry of a data set.

    >>> address_of(Chosen("variable_width", "Lp1Variable[VC1]"))
    ('Lp1Variable', 'VC1')
    """
    found = _ADDRESS.fullmatch(chosen.address)
    if found is None:
        raise ConfigError(f"{chosen.address!r} is no data item; write its id or name, or id[key] for an entry of a data set")
    return found[1], found[2] or ""


def chosen_items(device: DeviceModel, chosen: Iterable[Chosen]) -> Iterator[tuple[ChosenItem, Offer]]:
    """The items that the configuration reads by address; ConfigError for one that is missing, or has a unit of another kind."""
    for one in chosen:
        name, key = address_of(one)
        item = device.item(name)
        if item is None or item.category == "CONDITION":
            raise ConfigError(f"{one.table}.address = {one.address!r}: device {device.name!r} has {_near(device, name)}")
        label = item.label + (f"[{key}]" if key else "")
        yield ChosenItem(item.id, key, one.target(item.id, item.unit)), one.offer(label, item.unit)


def _near(device: DeviceModel, name: str) -> str:
    near = get_close_matches(name, [i.id for i in device.items] + [i.name for i in device.items if i.name], 3)
    return "no such item with values" + (f"; near are {', '.join(near)}" if near else "")


@dataclass(frozen=True, slots=True)
class TypeRule:
    """Items of one of these types feed the signal. Empty `sub_types` takes all, empty `above` any component."""

    signal: str
    types: tuple[str, ...]
    sub_types: tuple[str, ...] = ()
    above: tuple[str, ...] = ()

    def rank(self, item: DataItem) -> int | None:
        """Return how well the item fits, 0 best; None where it does not."""
        if item.type not in self.types or (self.sub_types and item.sub_type not in self.sub_types):
            return None
        if self.above and not set(self.above) & {item.component, *item.parents}:
            return None
        return (self.sub_types.index(item.sub_type) if self.sub_types else 0) * len(self.types) + self.types.index(item.type)


@cache
def names_and_types() -> tuple[Mapping[str, tuple[str, ...]], tuple[TypeRule, ...]]:
    """The table of names, lower case, and the rules by type."""
    table = tomllib.loads(files("edge.controls.mtconnect").joinpath("names.toml").read_text(encoding="utf-8"))
    names = {name: tuple(dict.fromkeys(word.lower() for word in words)) for name, words in table["names"].items()}
    rules = tuple(
        TypeRule(row["signal"], tuple(row["type"]), tuple(row.get("sub_types", ())), tuple(row.get("above", ())))
        for row in table["types"]
    )
    return names, rules


def assign(
    device: DeviceModel, sections: Mapping[str, SignalSection], spindle: str = "", by_address: Iterable[Chosen] = ()
) -> Assignment:
    """Map the items of a device; ConfigError where the configuration names what the device has not."""
    spindles = _spindles(device)
    chosen = _chosen_spindle(device, spindles, spindle)
    found: dict[str, DataItem] = {}
    taken: set[str] = set()
    proposals = (
        *_configured(device, sections),
        *_by_name(device, spindles, chosen),
        *_by_type(device, spindles, chosen),
        *_axes(device, spindles, chosen),
    )
    for name, item in proposals:
        if name not in found and item.id not in taken and (name not in sections or sections[name].publish):
            found[name] = item
            taken.add(item.id)
    targets = tuple(_target(name, item, sections.get(name, SignalSection())) for name, item in found.items())
    offers = tuple(Offer(name, item.label, item.unit, item.low, item.high) for name, item in found.items())
    unmapped = tuple(item for item in device.items if item.id not in taken and item.category != "CONDITION")
    addressed = tuple(chosen_items(device, by_address))
    offers += tuple(offer for _, offer in addressed)
    return Assignment(targets, offers, unmapped, tuple(one for one, _ in addressed), chosen, tuple(spindles))


Proposal = tuple[str, DataItem]


def _configured(device: DeviceModel, sections: Mapping[str, SignalSection]) -> Iterator[Proposal]:
    for name, section in sections.items():
        if not section.data_item:
            continue
        item = device.item(section.data_item)
        if item is None:
            why = _near(device, section.data_item).replace("such item with values", "such item")
            raise ConfigError(f"signals.{name}.data_item = {section.data_item!r}: device {device.name!r} has {why}")
        yield name, item


def _spindles(device: DeviceModel) -> dict[str, str]:
    """Component id → name of the components that report a spindle speed, in the order of the device description."""
    return {
        i.component_id: i.component_name
        for i in device.items
        if i.type in _SPEEDS and i.category == "SAMPLE" and i.component in ("Rotary", "Spindle")
    }


def _chosen_spindle(device: DeviceModel, spindles: Mapping[str, str], wanted: str) -> str:
    if wanted:
        for component_id, name in spindles.items():
            if wanted in (component_id, name):
                return component_id
        known = ", ".join(f"{name} ({component_id})" for component_id, name in spindles.items()) or "none"
        raise ConfigError(f"mtconnect.spindle = {wanted!r}: device {device.name!r} has no such spindle; it has {known}")
    loaded = {i.component_id for i in device.items if i.type == "LOAD" and i.category == "SAMPLE"}
    return next((c for c in spindles if c in loaded), next(iter(spindles), ""))


def _readable(item: DataItem) -> bool:
    """Return whether it has one value that stands for itself: no condition, no set of values, no average over a while."""
    return item.category in ("SAMPLE", "EVENT") and item.representation in ("", "VALUE") and not item.statistic


def _by_name(device: DeviceModel, spindles: Mapping[str, str], chosen: str) -> Iterator[Proposal]:
    names, _ = names_and_types()
    by_label = {item.label.lower(): item for item in reversed(device.items) if _readable(item)}
    for name, words in names.items():
        for word in words:
            item = by_label.get(word)
            if item is not None and not (
                name.startswith("spindle_") and item.component_id in spindles and item.component_id != chosen
            ):
                yield name, item


def _by_type(device: DeviceModel, spindles: Mapping[str, str], chosen: str) -> Iterator[Proposal]:
    _, rules = names_and_types()
    for rule in rules:
        ranked = [
            (rank, order, item)
            for order, item in enumerate(device.items)
            if _readable(item) and (rank := rule.rank(item)) is not None and _fits_spindle(rule.signal, item, spindles, chosen)
        ]
        yield from ((rule.signal, item) for _, _, item in sorted(ranked, key=lambda entry: entry[:2]))


def _fits_spindle(name: str, item: DataItem, spindles: Mapping[str, str], chosen: str) -> bool:
    """Return whether an item may feed this signal, given our spindle. An override may also be outside of all spindles."""
    if not name.startswith("spindle_") or item.component_id == chosen:
        return True
    return name == "spindle_override_pct" and item.component_id not in spindles


def _axes(device: DeviceModel, spindles: Mapping[str, str], chosen: str) -> Iterator[Proposal]:
    """Positions and loads of axes; and the load of the spindle, which shares its component with a C axis on some lathes."""
    keys: dict[str, str] = {}
    for item in device.items:
        if not _readable(item) or item.component not in ("Linear", "Rotary", "Spindle"):
            continue
        is_spindle_load = item.type == "LOAD" and item.component_id in spindles and not _is_axis_load(item)
        if is_spindle_load:
            if item.component_id == chosen:
                yield "spindle_load_pct", item
        elif (suffix := _axis_suffix(item)) and (key := _axis_key(item, keys)):
            yield f"axis_{key}_{suffix}", item


def _is_axis_load(item: DataItem) -> bool:
    """Return whether it is `Cload`: beside `Sload` in one Rotary of a turning centre, that is the load of the C axis."""
    return item.label.lower().startswith("c")


def _axis_suffix(item: DataItem) -> str:
    if item.type == "LOAD" and item.component != "Spindle":
        return "load_pct"
    if item.sub_type not in ("ACTUAL", "") or item.coordinates not in ("MACHINE", ""):  # canonical is the machine position
        return ""
    return {"POSITION": "pos_mm", "ANGLE": "pos_deg"}.get(item.type, "")


def _axis_key(item: DataItem, keys: dict[str, str]) -> str:
    """The letter for the first axis of that letter, letter and number for the others."""
    if item.component_id in keys:
        return keys[item.component_id]
    match = _AXIS_NAME.fullmatch(item.component_name)
    if match is None:
        return ""
    letter = match.group(1).lower()
    key = letter if letter not in keys.values() else letter + (match.group(2) or str(len(keys) + 1))
    if key in keys.values():
        return ""
    keys[item.component_id] = key
    return key


def _target(name: str, item: DataItem, section: SignalSection) -> Target:
    known = signal(name)
    native = section.native_unit or item.unit
    try:
        way = conversion(native, known.unit)
    except ConfigError as error:
        raise ConfigError(
            f"signals.{name}: data item {item.label}: {error}; set signals.{name}.native_unit, or publish = false"
        ) from error
    low = known.low if section.low is None else section.low
    high = known.high if section.high is None else section.high
    return Target(item.id, name, way.factor * section.scale, way.offset, low, high)
