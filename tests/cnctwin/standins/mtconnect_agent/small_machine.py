"""A machine with one of everything, small enough to see what a test expects of it."""

import http.client
from collections.abc import Iterable
from pathlib import Path
from urllib.parse import urlsplit
from xml.etree import ElementTree

from cnctwin.standins.mtconnect_agent import ReplayAgent
from cnctwin.standins.mtconnect_agent.xml_text import local_name

DEVICES = """<MTConnectDevices xmlns="urn:mtconnect.org:MTConnectDevices:1.7"><Devices>
  <Device id="d1" name="VMC-3" uuid="000">
    <DataItems><DataItem id="avail" type="AVAILABILITY" category="EVENT"/></DataItems>
    <Components>
      <Axes id="ax" name="base"><Components>
        <Linear id="x" name="X"><DataItems>
          <DataItem id="xp" name="Xpos" type="POSITION" subType="ACTUAL" category="SAMPLE"
                    units="MILLIMETER" nativeUnits="INCH"/>
          <DataItem id="xl" name="Xload" type="LOAD" category="SAMPLE" units="PERCENT"><Source>X_LOAD_RAW</Source></DataItem>
        </DataItems></Linear>
        <Rotary id="c" name="C"><DataItems>
          <DataItem id="cm" name="Cmode" type="ROTARY_MODE" category="EVENT">
            <Constraints><Value>SPINDLE</Value></Constraints>
          </DataItem>
        </DataItems></Rotary>
      </Components></Axes>
      <Controller id="ct" name="control"><DataItems>
        <DataItem id="exec" type="EXECUTION" category="EVENT"/>
        <DataItem id="tool" type="TOOL_NUMBER" category="EVENT"/>
        <DataItem id="msg" type="MESSAGE" category="EVENT"/>
        <DataItem id="vars" type="VARIABLE" representation="DATA_SET" category="EVENT"/>
        <DataItem id="offsets" type="WORK_OFFSET" representation="TABLE" category="EVENT"/>
        <DataItem id="wave" type="LOAD" representation="TIME_SERIES" category="SAMPLE"/>
        <DataItem id="place" type="PATH_POSITION" category="SAMPLE" units="MILLIMETER_3D" nativeUnits="MILLIMETER_3D"/>
        <DataItem id="logic" type="LOGIC_PROGRAM" category="CONDITION"/>
      </DataItems></Controller>
    </Components>
  </Device>
  <Device id="d2" name="LATHE-1" uuid="111"><DataItems>
    <DataItem id="lexec" type="EXECUTION" category="EVENT"/>
  </DataItems></Device>
</Devices></MTConnectDevices>
"""


def write_machine(folder: Path, lines: Iterable[str], name: str = "vmc-3.txt") -> tuple[Path, Path]:
    """Write a recording and the device model; return both paths."""
    devices, recording = folder / "devices.xml", folder / name
    devices.write_text(DEVICES, encoding="utf-8")
    recording.write_text("".join(f"{line}\n" for line in lines), encoding="utf-8")
    return recording, devices


def played(folder: Path, lines: Iterable[str], **options: object) -> ReplayAgent:
    """Return an agent, not yet serving, that has played all the lines."""
    recording, devices = write_machine(folder, lines)
    agent = ReplayAgent(recording, devices, speed=0, **options)  # type: ignore[arg-type]
    agent.step(1_000_000)
    return agent


def ask(agent: ReplayAgent, path: str, method: str = "GET", body: bytes | None = None) -> tuple[int, str]:
    """Send a request as it is, nothing in the path quoted but spaces; return status and document."""
    connection = http.client.HTTPConnection(urlsplit(agent.url).netloc, timeout=60.0)
    try:
        connection.request(method, path.replace(" ", "%20"), body)
        response = connection.getresponse()
        assert response.headers["content-type"] == "text/xml"
        return response.status, response.read().decode()
    finally:
        connection.close()


def fetch(agent: ReplayAgent, path: str, status: int = 200) -> str:
    """Return the document that a serving agent answers with, after a look at the status."""
    found, text = ask(agent, path)
    assert found == status, text
    return text


def at(second: int, rest: str) -> str:
    """Write a line with a stamp so many seconds after noon."""
    return f"2024-05-01T12:{second // 60:02}:{second % 60:02}.5Z|{rest}"


def elements(xml: str) -> list[ElementTree.Element]:
    """Return all elements of a document, tags without their namespace."""
    found = list(ElementTree.fromstring(xml).iter())
    for element in found:
        element.tag = local_name(element.tag)
    return found


def header(xml: str) -> dict[str, str]:
    """Return the header's attributes."""
    return next(e for e in elements(xml) if e.tag == "Header").attrib


def observations(xml: str) -> list[ElementTree.Element]:
    """Return a Streams document's observations, in document order."""
    return [e for e in elements(xml) if e.get("dataItemId")]


def values(xml: str, item_id: str) -> list[str | None]:
    """Return the texts of one data item, by sequence number."""
    of_item = [o for o in observations(xml) if o.get("dataItemId") == item_id]
    return [o.text for o in sorted(of_item, key=lambda o: int(o.attrib["sequence"]))]


def error(xml: str) -> tuple[str, str]:
    """Return code and text of an error document."""
    found = next(e for e in elements(xml) if e.tag == "Error")
    return found.attrib["errorCode"], found.text or ""
