"""Small hand-made documents of an agent, in both dialects that real agents were seen to speak."""

from collections.abc import Iterable
from xml.sax.saxutils import escape, quoteattr

from edge.config import EdgeConfig
from edge.controls.mtconnect.config import MtconnectConfig
from edge.controls.mtconnect.cursor import parse, start
from edge.controls.mtconnect.state import Cursor
from edge.sample import SampleSet

DIALECTS = ("1.4", "2.3")
CONFIG = EdgeConfig(source=MtconnectConfig())

_PROBE = """<?xml version="1.0" encoding="UTF-8"?>
<MTConnectDevices xmlns="urn:mtconnect.org:MTConnectDevices:{version}">
 <Header creationTime="2026-01-01T00:00:00Z" sender="vm" instanceId="{instance}" version="{version}" bufferSize="{buffer_size}"/>
 <Devices>{agent}
  <Device id="d" name="VMC" uuid="vmc-1">
   <DataItems><DataItem category="EVENT" id="avail" type="AVAILABILITY"/></DataItems>
   <Components>
    <Axes id="axes"><Components>
     <Linear id="x" name="X"><DataItems>
      <DataItem category="SAMPLE" id="xpos" type="POSITION" subType="ACTUAL" coordinateSystem="MACHINE" units="MILLIMETER"/>
      <DataItem category="SAMPLE" id="xload" type="LOAD" units="PERCENT"/>
     </DataItems></Linear>
     <Rotary id="s" name="C"><DataItems>
      <DataItem category="SAMPLE" id="rpm" type="ROTARY_VELOCITY" subType="ACTUAL" units="REVOLUTION/MINUTE"/>
      <DataItem category="SAMPLE" id="load" type="LOAD" units="PERCENT"/>
      <DataItem category="SAMPLE" id="temp" type="TEMPERATURE" units="CELSIUS"/>
      <DataItem category="CONDITION" id="servo" type="ACTUATOR"/>
     </DataItems></Rotary>
    </Components></Axes>
    <Controller id="c"><Components><Path id="p" name="path"><DataItems>
      <DataItem category="SAMPLE" id="feed" type="PATH_FEEDRATE" subType="ACTUAL"
       units="MILLIMETER/SECOND" nativeUnits="INCH/MINUTE"/>
      <DataItem category="EVENT" id="block" type="BLOCK"/>
      <DataItem category="EVENT" id="exec" type="EXECUTION"/>
      <DataItem category="EVENT" id="tool" name="Tool" type="TOOL_NUMBER"/>
      <DataItem category="EVENT" id="vars" type="VARIABLE" representation="DATA_SET"/>
    </DataItems></Path></Components></Controller>
   </Components>
  </Device>{other}
 </Devices>
</MTConnectDevices>"""
_ITEM = '<DataItems><DataItem category="EVENT" id="{}" type="AVAILABILITY"/></DataItems>'
_AGENT = f'<Agent id="a" name="Agent" uuid="agent-1">{_ITEM.format("aa")}</Agent>'
_OTHER = f'<Device id="o" name="OTHER" uuid="other-1">{_ITEM.format("oa")}</Device>'


def probe(version: str = "2.3", *, instance: int = 1, buffer_size: int = 128, other: bool = False) -> bytes:
    """One machine; from 2.0 on the agent is a device of its own; `other` adds a second machine."""
    agent = _AGENT if version >= "2" else ""
    text = _PROBE.format(version=version, instance=instance, buffer_size=buffer_size, agent=agent, other=_OTHER if other else "")
    return text.encode()


def value(item: str, sequence: int | str, text: str = "", *, time: str = "", element: str = "", **attributes: str) -> str:
    """One observation."""
    stamp = time or f"2026-01-01T00:00:{int(sequence) % 60 if str(sequence).isdigit() else 0:02d}Z"
    extra = "".join(f" {name}={quoteattr(word)}" for name, word in attributes.items())
    head = f'<{element or "Value"} dataItemId="{item}" sequence="{sequence}" timestamp="{stamp}"{extra}'
    return f"{head}>{escape(text)}</{element or 'Value'}>" if text else f"{head}/>"


def streams(
    next_sequence: int,
    observations: Iterable[str] = (),
    *,
    version: str = "2.3",
    instance: int = 1,
    first: int = 1,
    conditions: Iterable[str] = (),
    device: tuple[str, str] = ("VMC", "vmc-1"),
    buffer_size: int = 128,
    created: str = "2026-01-01T00:00:00Z",
) -> bytes:
    """An answer to /current or /sample."""
    body = ""
    if observations or conditions:
        body = (
            f'<DeviceStream name="{device[0]}" uuid="{device[1]}"><ComponentStream component="Path" componentId="p">'
            f"<Events>{''.join(observations)}</Events><Condition>{''.join(conditions)}</Condition></ComponentStream></DeviceStream>"
        )
    return (
        f'<?xml version="1.0" encoding="UTF-8"?><MTConnectStreams xmlns="urn:mtconnect.org:MTConnectStreams:{version}">'
        f'<Header creationTime="{created}" instanceId="{instance}" bufferSize="{buffer_size}" firstSequence="{first}" '
        f'lastSequence="{next_sequence - 1}" nextSequence="{next_sequence}"/><Streams>{body}</Streams></MTConnectStreams>'
    ).encode()


def error(code: str, text: str = "", *, version: str = "2.3", instance: int = 1) -> bytes:
    """An answer that is none; the HTTP status that comes with it says nothing and is not looked at."""
    return (
        f'<MTConnectError xmlns="urn:mtconnect.org:MTConnectError:{version}"><Header instanceId="{instance}" bufferSize="128"/>'
        f'<Errors><Error errorCode="{code}">{text}</Error></Errors></MTConnectError>'
    ).encode()


def fed(
    *documents: bytes, cursor: Cursor | None = None, config: EdgeConfig[MtconnectConfig] = CONFIG
) -> tuple[Cursor, SampleSet]:
    """The cursor after these documents, and what the last of them gave. Each must be fully accounted for."""
    here, frame = cursor or start(config), SampleSet()
    for document in documents:
        here, frame = parse(config, here, document)
        assert frame.accounted()
    return here, frame


def values(frame: SampleSet) -> list[tuple[str, object]]:
    """Signal and value of each sample, in order."""
    return [(sample.signal, sample.value) for sample in frame.samples]
