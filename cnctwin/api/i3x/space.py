"""The address space: the plant, its machines and their signals as i3X objects, with their relationships and values.

    plant ──HasChildren──▸ machine ──HasComponent──▸ signal

Everything comes from the live plant at the moment at which it is asked; nothing is kept.
"""

from collections.abc import Iterator, Mapping
from types import MappingProxyType
from typing import Any, NamedTuple

from cnctwin.api.fleet import SHOWN
from cnctwin.api.i3x.elements import PLANT_ID, Place, machine_id, place_of, signal_id
from cnctwin.api.i3x.types import MACHINE, PLANT, object_types, type_of
from cnctwin.api.i3x.vqt import GOOD, UNCERTAIN, Vqt, signal_vqt
from cnctwin.api.live.plant import LivePlant
from sparkplug.clock import now_ms

Signals = Mapping[str, Mapping[str, Any]]


class Element(NamedTuple):
    """One object with what is known of it: `signals` of a machine, or the one signal; `machines` of the plant."""

    place: Place
    online: bool = False
    machines: tuple[str, ...] = ()
    signals: Signals = MappingProxyType({})

    @property
    def element_id(self) -> str:
        """Return its element id."""
        machine, signal = self.place
        return signal_id(machine, signal) if signal else machine_id(machine) if machine else PLANT_ID

    @property
    def type_id(self) -> str:
        """Return the element id of its object type."""
        machine, signal = self.place
        return type_of(signal).element_id if signal else MACHINE if machine else PLANT

    @property
    def is_composition(self) -> bool:
        """Return True of a machine: its signals are its components."""
        return bool(self.place.machine and not self.place.signal)

    def value(self) -> Vqt:
        """Return its own value."""
        machine, signal = self.place
        if signal:
            return signal_vqt(signal, self.signals[signal])
        if not machine:
            return Vqt({"machines": list(self.machines)}, GOOD, now_ms())
        shown: dict[str, Any] = {"online": self.online}
        for title, name in SHOWN.items():
            if name in self.signals:
                shown[title] = signal_vqt(name, self.signals[name]).value
        times = (told["t"] for told in self.signals.values())
        return Vqt(shown, GOOD if self.online else UNCERTAIN, max(times, default=now_ms()))

    def components(self) -> dict[str, Vqt]:
        """Return the values of what it is composed of, by element id."""
        if not self.is_composition:
            return {}
        return {signal_id(self.place.machine, name): signal_vqt(name, told) for name, told in self.signals.items()}

    def related(self) -> Iterator[tuple[str, Place]]:
        """Yield the relationships that begin here."""
        machine, signal = self.place
        if signal:
            yield "ComponentOf", Place(machine)
        elif machine:
            yield "HasParent", Place()
            for name in self.signals:
                yield "HasComponent", Place(machine, name)
        else:
            for name in self.machines:
                yield "HasChildren", Place(name)

    def as_json(self, *, with_metadata: bool) -> dict[str, Any]:
        """Return the object as the interface gives it."""
        machine, signal = self.place
        said: dict[str, Any] = {
            "elementId": self.element_id,
            "displayName": signal or machine or "Plant",
            "typeElementId": self.type_id,
            "parentId": machine_id(machine) if signal else PLANT_ID if machine else None,
            "isComposition": self.is_composition,
            "isExtended": False,
        }
        return said | {"metadata": self._metadata()} if with_metadata else said

    def _metadata(self) -> dict[str, Any]:
        of = object_types()[self.type_id]
        told = self.signals.get(self.place.signal, {})
        edges: dict[str, Any] = {}
        for name, place in self.related():
            target = Element(place).element_id
            if name in ("HasParent", "ComponentOf"):
                edges[name] = target
            else:
                edges.setdefault(name, []).append(target)
        said = {"typeNamespaceUri": of.namespace, "sourceTypeId": of.source_id, "relationships": edges}
        if description := told.get("meaning") or of.schema.get("description"):
            said["description"] = description
        if self.place.machine:
            named = {"sparkplugDevice": self.place.machine, "sparkplugMetric": self.place.signal or None}
            system = {**named, "unit": told.get("unit"), "provenance": told.get("provenance")}
            said["system"] = {key: value for key, value in system.items() if value is not None}
        return said


class Space:
    """The address space over a live plant."""

    def __init__(self, live: LivePlant) -> None:
        self.live = live

    def plant(self) -> Element:
        """Return the root."""
        return Element(Place(), machines=tuple(self.live.machines()))

    def machine(self, name: str) -> Element | None:
        """Return a machine; None where nobody has heard of it."""
        state = self.live.state(name, now_ms())
        if state is None:
            return None
        return Element(Place(name), state["online"], signals={**state["measured"], **state["twin"]})

    def find(self, element_ids: list[str]) -> Iterator[Element | None]:
        """Yield the objects of these ids, None for each that there is not. Each machine is asked once."""
        machines: dict[str, Element | None] = {}
        for place in map(place_of, element_ids):
            if place is None:
                yield None
            elif not place.machine:
                yield self.plant()
            else:
                if place.machine not in machines:
                    machines[place.machine] = self.machine(place.machine)
                machine = machines[place.machine]
                yield machine if machine is None or not place.signal else part_of(machine, place.signal)

    def every(self) -> Iterator[Element]:
        """Yield every object: the root, then each machine with its signals."""
        plant = self.plant()
        yield plant
        for name in plant.machines:
            if (machine := self.machine(name)) is not None:
                yield machine
                yield from (found for signal in machine.signals if (found := part_of(machine, signal)) is not None)


def part_of(machine: Element, signal: str) -> Element | None:
    """Return a signal of a machine; None where it has none of this name."""
    told = machine.signals.get(signal)
    return None if told is None else Element(Place(machine.place.machine, signal), machine.online, signals={signal: told})
