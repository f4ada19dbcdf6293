"""The address space of the simulated control: types, objects and variables from what is to be shown."""

from collections.abc import Iterable
from typing import Any

from asyncua import ua
from asyncua.common.node import Node
from asyncua.server.server import Server

from cnctwin.standins.opcua_server.shown import SINUMERIK_OBJECT, Shown, Value


async def build(server: Server, shown: Iterable[Shown], calls: Any) -> dict[Shown, ua.NodeId]:
    """Make the nodes; the node of each variable. `calls` is linked with a method `Reset` that nobody should call."""
    nodes: dict[Shown, ua.NodeId] = {}
    types: dict[str, Node] = {}
    objects: dict[tuple[str, ...], Node] = {}
    indices: dict[str, int] = {}
    for one in shown:
        if one.model not in indices:
            indices[one.model] = await server.register_namespace(one.model)
        index = indices[one.model]
        parent = server.nodes.objects
        for depth, step in enumerate(one.path[:-1], start=1):
            place = (one.model, *one.path[:depth])
            if place not in objects:
                objects[place] = await _object(server, parent, index, step, types)
            parent = objects[place]
        nodes[one] = await _variable(parent, index, one)
        objects[one.model, *one.path] = server.get_node(nodes[one])  # a variable may have properties of its own
    if indices:
        index = min(indices.values())
        await server.nodes.objects.add_method(ua.NodeId(ua.String("/Methods/Reset"), ua.Int16(index)), "Reset", calls, [], [])
    return nodes


async def _object(server: Server, parent: Node, index: int, step: str, types: dict[str, Node]) -> Node:
    """An object; its type, where it has one, may be derived from another: `Channel1:VendorChannelType:CncChannelType`."""
    name, *kinds = [part for part in step.split(":") if part]
    if name == SINUMERIK_OBJECT:  # its node has a name, since clients subscribe to its events
        return await parent.add_object(ua.NodeId(ua.String(name), ua.Int16(index)), ua.QualifiedName(name, ua.UInt16(index)))
    if not kinds:
        return await parent.add_object(index, name)
    base, vendor = server.nodes.base_object_type, 1  # index 1 is the server's own namespace
    for kind in reversed(kinds):
        if kind not in types:
            types[kind] = await base.add_object_type(index if kind == kinds[-1] else vendor, kind)
        base = types[kind]
    return await parent.add_object(index, name, objecttype=base.nodeid)


async def _variable(parent: Node, index: int, one: Shown) -> ua.NodeId:
    kind = ua.VariantType[one.kind]
    name: Any = ua.QualifiedName(one.path[-1], ua.UInt16(index))
    identifier: Any = ua.NodeId(ua.String(one.identifier), ua.Int16(index)) if one.identifier else index
    node = await parent.add_variable(identifier, name if one.identifier else one.path[-1], empty(one), kind)
    if one.unit:
        information = ua.EUInformation(DisplayName=ua.LocalizedText(one.unit))
        unit = ua.QualifiedName("EngineeringUnits", ua.UInt16(0))
        await node.add_property(ua.NodeId(ua.Int32(0), ua.Int16(index)), unit, information)
    return node.nodeid


def empty(one: Shown) -> Value:
    """A value of its type before the control has been asked."""
    if one.path[-1] == "ActProgramBlock":
        return ["", "", ""]
    plain: dict[str, Value] = {"String": "", "Boolean": False, "Double": 0.0}
    return plain.get(one.kind, 0)


def variant(one: Shown, value: Value) -> ua.Variant:
    """This value in the type of its variable."""
    return ua.Variant(value, ua.VariantType[one.kind])
