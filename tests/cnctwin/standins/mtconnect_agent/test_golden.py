"""The replay agent against a real one: C++ agent 2.3.0.8 replaying the same Okuma recording.

All 25,727 observations are equal in data item, element, value, attributes and recorded stamp, and all that the
recording causes come in the same order. What differs, each with a test that it is that and no more:

- initial order: the first value of each data item; the real agent walks a hash table, ours the device model
- agent stamps: what the agent makes of its own (initial values, asset events) bears the agent's own time
- sequence numbers: the real agent also stores items of its own Agent device and of its adapter; ours has neither
- hashes: the real agent hashes its inner representation; ours digests an asset's XML, and writes none for a device
- empty descriptions: the real agent leaves out the empty Description element of each tool
- header: sender, version, times, instance id, buffer size
"""

import gzip
import re
from collections import Counter
from collections.abc import Iterator
from xml.etree import ElementTree

import httpx
import pytest

from cnctwin.standins.mtconnect_agent import ReplayAgent
from cnctwin.standins.mtconnect_agent.xml_text import local_name
from tests.recordings import recording

GOLDEN_OBSERVATIONS = 25_727
INITIAL_OBSERVATIONS = 103
AGENT_STAMPED = 348

GOLDEN_START_S = 1_795_246_948.9
"""When the real agent was started; ours is given the same clock, so that its own stamps can be told by their year."""
HEADER_ATTRIBUTES_OWN = {"creationTime", "sender", "instanceId", "version", "deviceModelChangeTime", "bufferSize"}
SEQUENCE_ATTRIBUTES = {"nextSequence", "firstSequence", "lastSequence"}

Said = tuple[str, str, str, tuple[tuple[str, str], ...], tuple[tuple[str, str, str], ...]]


@pytest.fixture(scope="module")
def agent() -> Iterator[ReplayAgent]:
    played = ReplayAgent(
        recording("mtconnect/okuma.txt"), recording("mtconnect/okuma_devices.xml"), speed=float("inf"), now=lambda: GOLDEN_START_S
    )
    with played:
        assert played.wait_finished(30.0)
        yield played


@pytest.fixture(scope="module")
def golden() -> list[ElementTree.Element]:
    """The observations of the 61 golden documents, by sequence number."""
    path = recording("mtconnect/golden/okuma_samples_2.3.xmlseq.gz")
    text = gzip.decompress(path.read_bytes()).decode()
    documents = [d for d in re.split(r"(?=<\?xml )", text) if d.strip()]
    assert len(documents) == 61
    return _by_sequence(o for d in documents for o in _observations(d))


@pytest.fixture(scope="module")
def ours(agent: ReplayAgent) -> list[ElementTree.Element]:
    """Our observations, taken as a client takes them: 1000 at a time, on from nextSequence."""
    found: list[ElementTree.Element] = []
    start, last = 1, -1
    with httpx.Client(base_url=agent.url, trust_env=False) as client:
        while start != last:
            document = client.get("/OKUMA/sample", params={"from": start, "count": 1000}).text
            found += _observations(document)
            last, start = start, int(_header(document)["nextSequence"])
    return _by_sequence(found)


def test_every_golden_observation_is_there_once_and_no_other(
    golden: list[ElementTree.Element], ours: list[ElementTree.Element]
) -> None:
    assert len(golden) == GOLDEN_OBSERVATIONS
    assert Counter(map(_said, ours)) == Counter(map(_said, golden))


def test_what_the_recording_causes_comes_in_the_same_order_with_the_same_stamps(
    golden: list[ElementTree.Element], ours: list[ElementTree.Element]
) -> None:
    of_golden, of_ours = golden[INITIAL_OBSERVATIONS:], ours[INITIAL_OBSERVATIONS:]
    assert [_said(o) for o in of_ours] == [_said(o) for o in of_golden]
    recorded = [i for i, o in enumerate(of_golden) if o.attrib["timestamp"].startswith("2022-")]
    assert len(recorded) == GOLDEN_OBSERVATIONS - INITIAL_OBSERVATIONS - AGENT_STAMPED
    stamps = [(of_ours[i].get("timestamp"), of_golden[i].get("timestamp")) for i in recorded]
    assert all(mine == theirs for mine, theirs in stamps)


def test_difference_initial_order(golden: list[ElementTree.Element], ours: list[ElementTree.Element]) -> None:
    initial_golden, initial_ours = golden[:INITIAL_OBSERVATIONS], ours[:INITIAL_OBSERVATIONS]
    assert {_said(o) for o in initial_ours} == {_said(o) for o in initial_golden}
    assert len({_said(o) for o in initial_ours}) == INITIAL_OBSERVATIONS


def test_difference_agent_stamps(golden: list[ElementTree.Element], ours: list[ElementTree.Element]) -> None:
    own = [o for o in golden[INITIAL_OBSERVATIONS:] if not o.attrib["timestamp"].startswith("2022-")]
    assert len(own) == AGENT_STAMPED
    assert {o.tag for o in own} == {"AssetChanged", "AssetRemoved", "AssetCountDataSet"}
    assert {o.tag for o in ours[INITIAL_OBSERVATIONS:] if not o.attrib["timestamp"].startswith("2022-")} == {o.tag for o in own}


def test_difference_sequence_numbers(golden: list[ElementTree.Element], ours: list[ElementTree.Element]) -> None:
    pairs = zip(golden[INITIAL_OBSERVATIONS:], ours[INITIAL_OBSERVATIONS:], strict=True)
    ahead = [int(theirs.attrib["sequence"]) - int(mine.attrib["sequence"]) for theirs, mine in pairs]
    assert ahead == sorted(ahead)  # the gap only widens, two items at a time
    assert sorted(set(ahead)) == [19, 21, 23, 25, 27, 29]


def test_current_is_equal_and_in_the_same_document_order(agent: ReplayAgent) -> None:
    theirs, mine = _golden_document("okuma_current_2.3.xml"), _get(agent, "/OKUMA/current")
    assert _shape(mine) == _shape(theirs)
    places = [(e.get("dataItemId"), e.get("componentId"), _recorded(e)) for e in mine.iter() if e.tag != "Header"]
    assert places == [(e.get("dataItemId"), e.get("componentId"), _recorded(e)) for e in theirs.iter() if e.tag != "Header"]
    assert sum(1 for *_, stamp in places if stamp) == 80


def test_probe_is_equal_but_for_the_device_hash(agent: ReplayAgent) -> None:
    theirs, mine = _golden_document("okuma_probe_2.3.xml"), _get(agent, "/OKUMA/probe")
    lacking = Counter(_facts(theirs)) - Counter(_facts(mine))
    assert list(lacking) == [("/MTConnectDevices/Devices/Device", "hash", "8sS/KRZRZWwy3+J36rqcr0bWnc4=")]
    assert not Counter(_facts(mine)) - Counter(_facts(theirs))
    items = [i.get("id") for i in theirs.iter() if i.tag == "DataItem"]
    assert items == [i.get("id") for i in mine.iter() if i.tag == "DataItem"]


def test_assets_are_equal_but_for_hashes_and_empty_descriptions(agent: ReplayAgent) -> None:
    theirs, mine = _golden_document("okuma_assets_2.3.xml"), _get(agent, "/assets")
    assert [a.get("assetId") for a in mine.iter("CuttingTool")] == [a.get("assetId") for a in theirs.iter("CuttingTool")]
    tool = "/MTConnectAssets/Assets/CuttingTool"
    lacking, extra = (
        Counter(_facts(theirs)) - Counter(_facts(mine)),
        Counter(_facts(mine)) - Counter(_facts(theirs)),
    )
    assert {fact[:2] for fact in lacking} == {(tool, "hash")}
    assert {fact[:2] for fact in extra} == {(tool, "hash"), (f"{tool}/Description", "text")}
    assert extra[f"{tool}/Description", "text", ""] == 17
    assert _header_of(mine)["assetCount"] == _header_of(theirs)["assetCount"] == "17"


@pytest.mark.parametrize(
    ("path", "name"),
    [
        ("/OKUMA/probe", "okuma_probe_2.3.xml"),
        ("/OKUMA/current", "okuma_current_2.3.xml"),
        ("/assets", "okuma_assets_2.3.xml"),
    ],
)
def test_difference_header(agent: ReplayAgent, path: str, name: str) -> None:
    theirs, mine = _header_of(_golden_document(name)), _header_of(_get(agent, path))
    assert set(theirs) == set(mine)
    same = set(theirs) - HEADER_ATTRIBUTES_OWN - SEQUENCE_ATTRIBUTES - {"assetCount"}
    assert all(theirs[a] == mine[a] for a in same)


def test_the_ledger_accounts_for_every_entry_of_the_recording(agent: ReplayAgent) -> None:
    ledger = agent.ledger
    assert ledger.balances
    assert (ledger.lines, ledger.commands, ledger.entries) == (10_534, 9, 25_659)
    assert dict(ledger.dropped) == {"constant": 20, "duplicate": 207, "unknown_key": 4}
    other_device = len(agent.agent.model.devices[1].items)
    assert ledger.observations == GOLDEN_OBSERVATIONS + other_device


def _said(observation: ElementTree.Element) -> Said:
    """Return what an observation says: everything but sequence number, stamp and asset hash."""
    left_out = {"sequence", "timestamp", "hash"}
    attributes = tuple(sorted((k, v) for k, v in observation.attrib.items() if k not in left_out))
    entries = tuple((e.attrib["key"], e.get("removed", ""), e.text or "") for e in observation)
    text = "" if entries else observation.text or ""
    return (observation.attrib["dataItemId"], observation.tag, text, attributes, entries)


def _shape(element: ElementTree.Element) -> list[tuple[str, tuple[tuple[str, str], ...], str]]:
    """Every element in document order but the header, with text and attributes; not sequences, stamps and hashes."""
    left_out = {"sequence", "timestamp", "hash"}
    return [
        (e.tag, tuple(sorted((k, v) for k, v in e.attrib.items() if k not in left_out)), (e.text or "").strip())
        for e in element.iter()
        if e.tag != "Header"
    ]


def _recorded(observation: ElementTree.Element) -> str | None:
    """The stamp, where it comes from the recording."""
    stamp = observation.get("timestamp", "")
    return stamp if stamp.startswith("2022-") else None


def _facts(element: ElementTree.Element, path: str = "") -> Iterator[tuple[str, str, str]]:
    """Every attribute and text with its place; the header and the order of siblings don't count."""
    place = f"{path}/{element.tag}"
    if element.tag == "Header":
        return
    yield place, "text", " ".join((element.text or "").split())
    for name, value in element.attrib.items():
        yield place, local_name(name), value
    for child in element:
        yield from _facts(child, place)


def _get(agent: ReplayAgent, path: str) -> ElementTree.Element:
    return _parsed(httpx.get(agent.url + path, trust_env=False).text)


def _golden_document(name: str) -> ElementTree.Element:
    return _parsed(recording(f"mtconnect/golden/{name}").read_text(encoding="utf-8"))


def _parsed(text: str) -> ElementTree.Element:
    root = ElementTree.fromstring(text)
    for element in root.iter():
        element.tag = local_name(element.tag)
    return root


def _observations(document: str) -> list[ElementTree.Element]:
    return [e for e in _parsed(document).iter() if e.get("dataItemId")]


def _by_sequence(found: Iterator[ElementTree.Element] | list[ElementTree.Element]) -> list[ElementTree.Element]:
    ordered = sorted(found, key=lambda o: int(o.attrib["sequence"]))
    assert len({o.attrib["sequence"] for o in ordered}) == len(ordered)
    return ordered


def _header(document: str) -> dict[str, str]:
    return _header_of(_parsed(document))


def _header_of(root: ElementTree.Element) -> dict[str, str]:
    return next(e for e in root if e.tag == "Header").attrib
