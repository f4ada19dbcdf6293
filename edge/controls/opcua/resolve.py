"""The way from the names of a map to the nodes of one server, again at each connection: namespace indices may have changed.

A point with a node is looked up by its namespace's URI. A point of a companion model is looked for: the objects below Objects and
Machines are browsed, with bounds, for objects of its type; the path goes on from there by browse names.
"""

import base64
import re
import time
from collections import deque
from collections.abc import Iterable, Sequence
from typing import Any, NamedTuple

from asyncua import ua
from asyncua.client.client import Client
from asyncua.ua.attribute_ids import AttributeIds
from asyncua.ua.object_ids import ObjectIds

from edge.controls.opcua.config import Config, points_of
from edge.controls.opcua.point import TOOL, NodeName, Point, maps, node_of
from edge.controls.opcua.spindle_tool import TOOLS_MAX

NODES_MAX = 20_000
DEPTH_MAX = 12
BROWSE_S_MAX = 30.0
AT_ONCE = 100
TYPES_MAX = 1_000
ITEMS_MAX = 2_000
_HIERARCHICAL = ua.NodeId(ua.Int32(ObjectIds.HierarchicalReferences))


class Resolved(NamedTuple):
    """A key, the node that feeds it, the point behind it; `fault` in place of the node where there is none.

    owner: the object that has the node, where that was found by its type
    """

    key: str
    node: ua.NodeId | None
    point: Point
    fault: str = ""
    owner: ua.NodeId | None = None


class BrowsedNode(NamedTuple):
    """An object or variable that browsing met: the type's name is "" where it is of no interest."""

    node: ua.NodeId
    namespace: str
    name: str
    type_name: str
    is_variable: bool
    path: tuple[str, ...]


async def resolve(config: Config, client: Client) -> list[Resolved]:
    """Every point of the configuration on this server; those that the server does not have are there with the reason."""
    points = [point for point in points_of(config) if not point.follows_tool]
    namespaces = await client.get_namespace_array()
    resolved = [_by_name(point, namespaces) for point in points if point.node]
    browsed = [point for point in points if not point.node]
    if browsed:
        model = maps()[config.source.map].namespace
        resolved += await _by_type(config, client, browsed, model, namespaces)
    return resolved[:ITEMS_MAX]


def node_id(name: NodeName, namespaces: Sequence[str]) -> ua.NodeId | None:
    """The node of this name; None where the server has no such namespace."""
    if name.namespace and name.namespace not in namespaces:
        return None
    index = ua.Int16(namespaces.index(name.namespace) if name.namespace else 0)
    if name.kind == "i":
        return ua.NodeId(ua.Int32(int(name.identifier)), index)
    if name.kind == "g":
        return ua.NodeId(ua.Guid(name.identifier), index)
    if name.kind == "b":
        return ua.NodeId(ua.ByteString(base64.b64decode(name.identifier)), index)
    return ua.NodeId(ua.String(name.identifier), index)


def name_of(node: ua.NodeId, namespaces: Sequence[str]) -> str:
    """Return how a configuration names this node.

    >>> name_of(ua.NodeId("/Nck/State", 2), ["", "urn:x", "SinumerikVarProvider"])
    'nsu=SinumerikVarProvider;s=/Nck/State'
    """
    text: str = node.to_string().rpartition("ns=")[2].partition(";")[2] if node.NamespaceIndex else node.to_string()
    index = int(node.NamespaceIndex)
    return f"nsu={namespaces[index]};{text}" if 0 < index < len(namespaces) else text


def _by_name(point: Point, namespaces: Sequence[str]) -> Resolved:
    name = node_of(point.node)
    found = node_id(name, namespaces)
    return Resolved(point.signal, found, point, "" if found else f"the server has no namespace {name.namespace}")


async def _by_type(
    config: Config, client: Client, points: Sequence[Point], model: str, namespaces: Sequence[str]
) -> list[Resolved]:
    wanted = {point.of for point in points}
    objects = [found for found in await browse(client, namespaces, model, wanted) if found.type_name in wanted]
    chosen = {kind: _chosen(config, kind, [o for o in objects if o.type_name == kind]) for kind in wanted}
    asked = [
        (point, found, number) for point in points for number, found in enumerate(chosen[point.of]) if point.each or not number
    ]
    nodes = await follow(client, [(found.node, point.path) for point, found, _ in asked], namespaces, model)
    flags = await _flags(client, asked, namespaces, model)
    resolved = [
        Resolved(point.signal, None, point, f"the server has no object of type {point.of}")
        for point in points
        if not chosen[point.of] and not point.each
    ]
    for (point, found, number), node in zip(asked, nodes, strict=True):
        flag = flags.get((str(found.node), point.only_if or point.only_if_not))
        if (point.only_if and flag is not True) or (point.only_if_not and flag is True):
            continue
        if point.signal == TOOL:
            key = f"{TOOL}:{number}:{point.path.rpartition('/')[2]}"
        else:
            key = point.signal.replace("{name}", re.sub(r"\W", "", found.name).lower())
        if node is not None or not point.each:
            fault = "" if node else f"the server has no {found.name}/{point.path}"
            resolved.append(Resolved(key, node, point, fault, found.node))
    return _first_of_each(resolved)


def _first_of_each(resolved: Iterable[Resolved]) -> list[Resolved]:
    """Two objects of one name, in two channels for instance, feed one signal: the first one does."""
    kept: dict[str, Resolved] = {}
    for one in resolved:
        kept.setdefault(one.key, one)
    return list(kept.values())


def _chosen(config: Config, kind: str, objects: list[BrowsedNode]) -> list[BrowsedNode]:
    """The objects of this type, once each, in the order of their browse paths; of channels and spindles the one that is named."""
    wanted = {"CncChannelType": config.source.channel, "ChannelMonitoringType": config.source.channel}
    wanted |= {"CncSpindleType": config.source.spindle, "SpindleMonitoringType": config.source.spindle}
    by_node = {str(found.node): found for found in sorted(objects, key=lambda found: found.path, reverse=True)}
    ordered = sorted(by_node.values(), key=lambda found: found.path)
    name = wanted.get(kind, "")
    return [found for found in ordered if name in ("", found.name)][:TOOLS_MAX]


async def _flags(
    client: Client, asked: Sequence[tuple[Point, BrowsedNode, int]], namespaces: Sequence[str], model: str
) -> dict[tuple[str, str], object]:
    """The values of the flags that decide whether a point is read at all."""
    wanted = {(str(found.node), flag): found.node for point, found, _ in asked if (flag := point.only_if or point.only_if_not)}
    nodes = await follow(client, [(node, flag) for (_, flag), node in wanted.items()], namespaces, model)
    there = [(key, node) for key, node in zip(wanted, nodes, strict=True) if node is not None]
    if not there:
        return {}
    values = await client.uaclient.session.read_attributes([node for _, node in there], AttributeIds.Value)
    return {key: None if v.Value is None else v.Value.Value for (key, _), v in zip(there, values, strict=True)}


async def follow(
    client: Client, starts: Sequence[tuple[ua.NodeId, str]], namespaces: Sequence[str], model: str
) -> list[ua.NodeId | None]:
    """The nodes at the ends of these paths. A browse name may be in the model's namespace, or in any other."""
    ends: list[ua.NodeId | None] = [None] * len(starts)
    indices = [namespaces.index(model)] if model in namespaces else []
    indices += [index for index in range(len(namespaces)) if index not in indices]
    for index in indices[:8]:
        open_ends = [number for number, end in enumerate(ends) if end is None]
        for begin in range(0, len(open_ends), AT_ONCE):
            some = open_ends[begin : begin + AT_ONCE]
            paths = [_browse_path(*starts[number], index) for number in some]
            for number, result in zip(some, await client.uaclient.session.translate_browsepaths_to_nodeids(paths), strict=True):
                if result.StatusCode.is_good() and result.Targets:
                    ends[number] = result.Targets[0].TargetId
    return ends


def _browse_path(start: ua.NodeId, path: str, index: int) -> ua.BrowsePath:
    elements = []
    for name in path.split("/"):
        element: Any = ua.RelativePathElement()  # its flags are typed as a class that no bool is
        element.ReferenceTypeId = _HIERARCHICAL
        element.IsInverse, element.IncludeSubtypes = False, True
        element.TargetName = ua.QualifiedName(name, ua.UInt16(index))
        elements.append(element)
    return ua.BrowsePath(StartingNode=start, RelativePath=ua.RelativePath(Elements=elements))


async def browse(client: Client, namespaces: Sequence[str], model: str, stop_at: Iterable[str] = ()) -> list[BrowsedNode]:
    """Return what is below Objects, breadth first, bounded in number, depth and time; with the model's type of each object."""
    begun_s, found, seen = time.monotonic(), list[BrowsedNode](), set[str]()
    names: dict[str, str] = {}
    stops = set(stop_at) - {"CncChannelType"}  # a channel has spindles and axes below it, on some servers there alone
    root = ua.NodeId(ua.Int32(ObjectIds.ObjectsFolder))
    waiting: deque[tuple[ua.NodeId, tuple[str, ...]]] = deque([(root, ())])
    while waiting and len(found) < NODES_MAX and time.monotonic() - begun_s < BROWSE_S_MAX:
        some = [waiting.popleft() for _ in range(min(AT_ONCE, len(waiting)))]
        for (_, path), references in zip(some, await children_of(client, [node for node, _ in some]), strict=True):
            await _name_types(client, references, names, namespaces, model)
            for reference in references:
                key = str(reference.NodeId)
                if key in seen or len(found) >= NODES_MAX or reference.NodeId == ua.NodeId(ua.Int32(ObjectIds.Server)):
                    continue
                seen.add(key)
                one = _found(reference, path, namespaces, names)
                found.append(one)
                if not one.is_variable and len(one.path) < DEPTH_MAX and one.type_name not in stops:
                    waiting.append((one.node, one.path))
    return found


def _found(
    reference: ua.ReferenceDescription, path: tuple[str, ...], namespaces: Sequence[str], names: dict[str, str]
) -> BrowsedNode:
    name, index = str(reference.BrowseName.Name or ""), int(reference.NodeId.NamespaceIndex)
    is_variable = reference.NodeClass == ua.NodeClass.Variable
    node = ua.NodeId(reference.NodeId.Identifier, reference.NodeId.NamespaceIndex)
    namespace = namespaces[index] if index < len(namespaces) else ""
    return BrowsedNode(node, namespace, name, names.get(str(reference.TypeDefinition), ""), is_variable, (*path, name))


async def children_of(client: Client, nodes: Sequence[ua.NodeId]) -> list[list[ua.ReferenceDescription]]:
    """Objects and variables one level below, with those that the server holds back for a second question."""
    wishes = [
        ua.BrowseDescription(
            NodeId=node,
            BrowseDirection=ua.BrowseDirection.Forward,
            ReferenceTypeId=_HIERARCHICAL,
            IncludeSubtypes=True,
            NodeClassMask=ua.UInt32(ua.NodeClass.Object | ua.NodeClass.Variable),
            ResultMask=ua.UInt32(ua.BrowseResultMask.All),
        )
        for node in nodes
    ]
    session = client.uaclient.session
    results = await session.browse(ua.BrowseParameters(RequestedMaxReferencesPerNode=ua.UInt32(1000), NodesToBrowse=wishes))
    children = [list(result.References or ()) for result in results]
    for number, result in enumerate(results):
        point = result.ContinuationPoint
        while point and len(children[number]) < NODES_MAX:
            more = (
                await session.browse_next(ua.BrowseNextParameters(ReleaseContinuationPoints=False, ContinuationPoints=[point]))
            )[0]
            children[number] += more.References or ()
            point = more.ContinuationPoint
    return children


async def _name_types(
    client: Client, references: Sequence[ua.ReferenceDescription], names: dict[str, str], namespaces: Sequence[str], model: str
) -> None:
    """The names of types that have not been met yet: their own, or that of the model's type that they are derived from."""
    if model not in namespaces:
        return
    index = namespaces.index(model)
    kinds = {str(r.TypeDefinition): r.TypeDefinition for r in references if r.TypeDefinition.NamespaceIndex}
    for key, kind in kinds.items():
        if key not in names and len(names) < TYPES_MAX:
            names[key] = await _model_name(client, ua.NodeId(kind.Identifier, kind.NamespaceIndex), index)


async def _model_name(client: Client, kind: ua.NodeId, index: int) -> str:
    """The name of the first type in this namespace, from this one upwards; "" where there is none."""
    for _ in range(DEPTH_MAX):
        if kind.NamespaceIndex == index:
            value = (await client.uaclient.session.read_attributes([kind], AttributeIds.BrowseName))[0].Value
            return "" if value is None or value.Value is None else str(value.Value.Name)
        wish = ua.BrowseDescription(
            NodeId=kind,
            BrowseDirection=ua.BrowseDirection.Inverse,
            ReferenceTypeId=ua.NodeId(ua.Int32(ObjectIds.HasSubtype)),
            IncludeSubtypes=True,
            NodeClassMask=ua.UInt32(0),
            ResultMask=ua.UInt32(ua.BrowseResultMask.All),
        )
        above = (await client.uaclient.session.browse(ua.BrowseParameters(NodesToBrowse=[wish])))[0].References
        if not above or not above[0].NodeId.NamespaceIndex:
            return ""
        kind = ua.NodeId(above[0].NodeId.Identifier, above[0].NodeId.NamespaceIndex)
    return ""
