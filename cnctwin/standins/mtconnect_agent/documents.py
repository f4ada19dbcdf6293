"""The four documents of an agent: Devices, Streams, Assets and Error, as text."""

from collections.abc import Iterable, Sequence
from itertools import groupby

from cnctwin.standins.mtconnect_agent.agent import Agent
from cnctwin.standins.mtconnect_agent.assets import Asset
from cnctwin.standins.mtconnect_agent.data_set import entries_xml
from cnctwin.standins.mtconnect_agent.device_model import CATEGORY_ELEMENTS, DataItem, Device, device_attributes
from cnctwin.standins.mtconnect_agent.observation import Observation
from cnctwin.standins.mtconnect_agent.stamp import whole_second_text
from cnctwin.standins.mtconnect_agent.xml_text import attributes, element_text, escape

SENDER = "cnctwin-replay"


def streams_document(agent: Agent, observations: Iterable[Observation], next_sequence: int) -> str:
    """Write observations grouped by device, component and category, so not in the order of their sequence numbers."""
    buffer = agent.buffer
    header = _header(
        agent,
        bufferSize=str(buffer.size),
        nextSequence=str(next_sequence),
        firstSequence=str(buffer.first_sequence),
        lastSequence=str(buffer.next_sequence - 1),
    )
    ordered = sorted(observations, key=lambda o: (o.item.rank, o.sequence))
    lines: list[str] = []
    for device_name, of_device in groupby(ordered, key=lambda o: o.item.device_name):
        device = agent.model.device(device_name)
        assert device is not None, device_name
        lines.append(f"    <DeviceStream{device_attributes(device)}>")
        for component, of_component in groupby(of_device, key=lambda o: o.item.component):
            name = f' name="{escape(component.name)}"' if component.name else ""
            lines.append(f'      <ComponentStream component="{component.element}"{name} componentId="{escape(component.id)}">')
            for category, of_category in groupby(of_component, key=lambda o: o.item.category):
                element = CATEGORY_ELEMENTS[category]
                lines.append(f"        <{element}>")
                lines.extend(map(observation_xml, of_category))
                lines.append(f"        </{element}>")
            lines.append("      </ComponentStream>")
        lines.append("    </DeviceStream>")
    return _document(agent, "Streams", header, lines)


def observation_xml(observation: Observation) -> str:
    """Write one observation; an empty value is an element without text."""
    item = observation.item
    element = observation.level or item.element
    extra = "".join(f' {n}="{escape(v)}"' for n, v in observation.attributes)
    if item.is_data_set:
        extra += f' count="{len(observation.entries or ())}"'
    head = f'          <{element}{item.shown} sequence="{observation.sequence}" timestamp="{observation.timestamp}"{extra}'
    if observation.entries:
        return f"{head}>{entries_xml(observation.entries, ' ' * 12)}\n          </{element}>"
    return f"{head}>{escape(observation.value)}</{element}>" if observation.value else f"{head}/>"


def devices_document(agent: Agent, devices: Sequence[Device]) -> str:
    """Write the device model, in the namespace of the agent's schema version."""
    body = [element_text(device.element, "    ") for device in devices]
    return _document(agent, "Devices", _header(agent, **_asset_counts(agent), bufferSize=str(agent.buffer.size)), body)


def assets_document(agent: Agent, assets: Sequence[Asset]) -> str:
    """Write assets, each with what the agent adds to it."""
    return _document(agent, "Assets", _header(agent, **_asset_counts(agent)), [_asset_xml(agent, a) for a in assets])


def error_document(agent: Agent, code: str, text: str) -> str:
    """Write one error."""
    body = [f'    <Error errorCode="{code}">{escape(text)}</Error>']
    return _document(agent, "Error", _header(agent, bufferSize=str(agent.buffer.size)), body, collection="Errors")


def items_of(devices: Iterable[Device]) -> frozenset[DataItem]:
    """Return all data items of some devices."""
    return frozenset(item for device in devices for item in device.items)


def _document(agent: Agent, kind: str, header: str, body: list[str], collection: str = "") -> str:
    namespace = f"urn:mtconnect.org:MTConnect{kind}:{agent.dialect.schema_text}"
    location = f"http://schemas.mtconnect.org/schemas/MTConnect{kind}_{agent.dialect.schema_text}.xsd"
    prefixes = sorted({i.type.partition(":")[0] for i in agent.model.items if ":" in i.type})
    extensions = "".join(f' xmlns:{p}="urn:extension:{p}"' for p in prefixes)
    collection = collection or kind
    content = "\n".join((f"  <{collection}>", *body, f"  </{collection}>")) if body else f"  <{collection}/>"
    return (
        '<?xml version="1.0" encoding="UTF-8"?>\n'
        f'<MTConnect{kind} xmlns:m="{namespace}" xmlns="{namespace}"{extensions}'
        ' xmlns:xsi="http://www.w3.org/2001/XMLSchema-instance"'
        f' xsi:schemaLocation="{namespace} {location}">\n'
        f"{header}\n{content}\n</MTConnect{kind}>\n"
    )


def _header(agent: Agent, **more: str) -> str:
    shown = {
        "creationTime": whole_second_text(agent.now_seconds),
        "sender": SENDER,
        "instanceId": str(agent.instance_id),
        "version": f"{agent.dialect.schema_text}.0.0",
    }
    if agent.dialect.schema >= (1, 7):
        shown["deviceModelChangeTime"] = agent.model_change_time
    pairs = "".join(f' {name}="{escape(value)}"' for name, value in (shown | more).items())
    return f"  <Header{pairs}/>"


def _asset_counts(agent: Agent) -> dict[str, str]:
    return {"assetBufferSize": str(agent.assets.size), "assetCount": str(agent.assets.count)}


def _asset_xml(agent: Agent, asset: Asset) -> str:
    shown = dict(asset.element.attrib) | {
        "assetId": asset.id,
        "deviceUuid": asset.device_uuid,
        "timestamp": asset.timestamp,
    }
    if agent.dialect.schema >= (2, 2):
        shown["hash"] = asset.hash
    if asset.is_removed:
        shown["removed"] = "true"
    whole = element_text(asset.element, "    ")
    rest = whole[len(f"    <{asset.type}{attributes(dict(asset.element.attrib))}") :]
    return f"    <{asset.type}{attributes(shown)}{rest}"
