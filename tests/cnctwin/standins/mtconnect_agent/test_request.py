"""Requests and their errors, in both generations: the same code, agent 1.4 with status 200."""

from collections.abc import Iterator
from pathlib import Path

import pytest

from cnctwin.standins.mtconnect_agent import ReplayAgent
from cnctwin.standins.mtconnect_agent.request import Answer, answer
from tests.cnctwin.standins.mtconnect_agent.small_machine import (
    ask,
    at,
    elements,
    error,
    fetch,
    header,
    observations,
    played,
    values,
)

STYLES = ("2.3", "1.4")


@pytest.fixture(params=STYLES)
def agent(request: pytest.FixtureRequest, tmp_path: Path) -> Iterator[ReplayAgent]:
    """An agent of each generation whose buffer of 30 has overrun."""
    with played(tmp_path, [at(n, f"tool|{n}") for n in range(50)], style=request.param, buffer_size=30) as serving:
        yield serving


def _is_modern(agent: ReplayAgent) -> bool:
    return agent.agent.dialect.is_modern


# A path, the honest status, the code, and the text of agent 2.3 and of 1.4. {first} and {next} are sequence numbers.
ERRORS = [
    (
        "/sample?from={before_first}",
        400,
        "OUT_OF_RANGE",
        "'from' must be greater than {before_first}",
        "'from' must be greater than or equal to {first}.",
    ),
    (
        "/sample?from={after_next}",
        400,
        "OUT_OF_RANGE",
        "'from' must be less than {after_next}",
        "'from' must be less than or equal to {next}.",
    ),
    ("/sample?from=1", 400, "OUT_OF_RANGE", "'from' must be greater than", "'from' must be greater than or equal to"),
    ("/sample?count=31", 400, "OUT_OF_RANGE", "'count' must be less than 31", "'count' must be less than or equal to 30."),
    ("/sample?count=0", 400, "OUT_OF_RANGE", "'count' must not be zero(0)", "'count' must be greater than or equal to 1."),
    ("/sample?interval=-1", 400, "OUT_OF_RANGE", "'interval' must be greater than -1", "'interval' must be greater than"),
    ("/current?at={after_next}", 400, "OUT_OF_RANGE", "'at' must be less than {next}", "'at' must be less than or equal"),
    ("/current?at=1", 400, "OUT_OF_RANGE", "'at' must be greater than", "'at' must be greater than or equal"),
    ("/sample?interval=10&from=1", 400, "OUT_OF_RANGE", "'from' must be greater", "'from' must be greater"),
    ("/current?path=//Axes[", 400, "INVALID_XPATH", "Invalid syntax: //Axes[", "Invalid syntax: //Axes["),
    ("/current?path=//Nothing", 400, "INVALID_XPATH", "//Nothing", "//Nothing"),
    ("/current?path=", 400, "INVALID_XPATH", "Invalid syntax", "Invalid syntax"),
    ("/GRINDER/probe", 404, "NO_DEVICE", "Could not find the device 'GRINDER'", "Could not find the device 'GRINDER'"),
    ("/asset/T1", 404, "ASSET_NOT_FOUND", "Cannot find asset: T1", "Could not find asset: T1"),
    ("/VMC-3/assets/T1", 404, "ASSET_NOT_FOUND", "Cannot find asset: T1", "Could not find asset: T1"),
]


@pytest.mark.parametrize(("path", "status", "code", "modern", "old"), ERRORS, ids=[e[0] for e in ERRORS])
def test_an_error_is_a_document(agent: ReplayAgent, path: str, status: int, code: str, modern: str, old: str) -> None:
    first, following = agent.agent.buffer.first_sequence, agent.agent.buffer.next_sequence
    numbers = {"first": first, "before_first": first - 1, "next": following, "after_next": following + 1}
    text = fetch(agent, path.format(**numbers), status if _is_modern(agent) else 200)
    assert elements(text)[0].tag == "MTConnectError"
    found_code, found_text = error(text)
    assert found_code == code
    assert (modern if _is_modern(agent) else old).format(**numbers) in found_text
    assert header(text)["instanceId"] == str(agent.agent.instance_id)


@pytest.mark.parametrize(
    ("path", "modern", "old"),
    [
        ("/sample?from=abc", (400, "INVALID_REQUEST"), (200, "OUT_OF_RANGE")),
        ("/sample?from=", (400, "INVALID_REQUEST"), (200, "QUERY_ERROR")),
        ("/GRINDER/current", (404, "NO_DEVICE"), (200, "INVALID_XPATH")),
        ("/GRINDER/sample", (404, "NO_DEVICE"), (200, "INVALID_XPATH")),
        ("/VMC-3/nonsense", (404, "INVALID_REQUEST"), (200, "UNSUPPORTED")),
        ("/a/b/c/d", (404, "INVALID_REQUEST"), (200, "UNSUPPORTED")),
        ("/sample?" + "&".join(f"p{n}=1" for n in range(40)), (400, "INVALID_REQUEST"), (200, "INVALID_REQUEST")),
    ],
)
def test_the_generations_name_some_errors_differently(
    agent: ReplayAgent, path: str, modern: tuple[int, str], old: tuple[int, str]
) -> None:
    status, code = modern if _is_modern(agent) else old
    assert error(fetch(agent, path, status))[0] == code


def test_a_target_that_is_no_url_is_an_error(agent: ReplayAgent) -> None:
    reply = answer(agent.agent, "GET", "http://[/current")
    assert isinstance(reply, Answer)
    assert error(reply.body)[0] == "INVALID_REQUEST"


@pytest.mark.parametrize("method", ["POST", "PUT", "DELETE"])
def test_nothing_can_be_written(agent: ReplayAgent, method: str) -> None:
    status, text = ask(agent, "/VMC-3", method, b"tool=5")
    assert status == (400 if _is_modern(agent) else 200)
    assert error(text)[0] == ("INVALID_REQUEST" if _is_modern(agent) else "UNSUPPORTED")


def test_from_equal_to_next_sequence_is_empty_and_no_error(agent: ReplayAgent) -> None:
    following = agent.agent.buffer.next_sequence
    text = fetch(agent, f"/sample?from={following}")
    assert next(e for e in elements(text) if e.tag == "Streams").attrib == {}
    assert not observations(text)
    assert header(text)["nextSequence"] == str(following)
    assert header(text)["lastSequence"] == str(following - 1)


def test_a_buffer_that_overran_begins_later(agent: ReplayAgent) -> None:
    text = fetch(agent, "/sample?count=30")
    following = agent.agent.buffer.next_sequence
    assert header(text)["firstSequence"] == str(following - 30)
    assert [int(o.attrib["sequence"]) for o in observations(text)] == list(range(following - 30, following))
    assert header(text)["nextSequence"] == str(following)


def test_count_limits_what_the_path_selects(agent: ReplayAgent) -> None:
    text = fetch(agent, '/VMC-3/sample?count=3&path=//DataItem[@type="TOOL_NUMBER"]')
    assert values(text, "tool") == ["20", "21", "22"]
    assert int(header(text)["nextSequence"]) == max(int(o.attrib["sequence"]) for o in observations(text)) + 1


def test_current_shows_each_item_once_and_at_shows_the_past(agent: ReplayAgent) -> None:
    now = fetch(agent, "/current")
    ids = [o.get("dataItemId") for o in observations(now)]
    assert len(ids) == len(set(ids)) == len(list(agent.agent.model.items))
    assert values(now, "tool") == ["49"]
    past = agent.agent.buffer.next_sequence - 5
    assert values(fetch(agent, f"/current?at={past}"), "tool") == ["45"]


def test_probe_shows_one_device_or_all(agent: ReplayAgent) -> None:
    names = [[e.get("name") for e in elements(fetch(agent, p)) if e.tag == "Device"] for p in ("/", "/probe", "/VMC-3")]
    assert names == [["VMC-3", "LATHE-1"], ["VMC-3", "LATHE-1"], ["VMC-3"]]
    by_uuid = fetch(agent, "/111/probe")
    assert [e.get("name") for e in elements(by_uuid) if e.tag == "Device"] == ["LATHE-1"]
    added = {e.get("type") for e in elements(by_uuid) if e.tag == "DataItem"} - {"EXECUTION"}
    counted = {"ASSET_COUNT"} if _is_modern(agent) else set()
    assert added == {"AVAILABILITY", "ASSET_CHANGED", "ASSET_REMOVED"} | counted


def test_the_document_is_grouped_so_that_its_last_element_is_not_the_newest(tmp_path: Path) -> None:
    with played(tmp_path, [at(0, "exec|ACTIVE|Xload|1|Xload|2|tool|7")]) as agent:
        text = fetch(agent, f"/VMC-3/sample?from={agent.agent.buffer.next_sequence - 4}")
    sequences = [int(o.attrib["sequence"]) for o in observations(text)]
    assert sequences != sorted(sequences)
    assert int(header(text)["nextSequence"]) == max(sequences) + 1 != sequences[-1] + 1
    tags = [e.tag for e in elements(text) if e.tag in ("ComponentStream", "Samples", "Events", "Condition")]
    assert tags == ["ComponentStream", "Events", "ComponentStream", "Samples"]


@pytest.mark.parametrize("version", ["1.2", "1.4", "1.8", "2.0", "2.3", "2.7"])
def test_the_namespace_is_that_of_the_schema_version(tmp_path: Path, version: str) -> None:
    with played(tmp_path, [at(0, "tool|1")], schema_version=version) as agent:
        for path, kind in (("/probe", "Devices"), ("/current", "Streams"), ("/assets", "Assets"), ("/x/y/z", "Error")):
            text = fetch(agent, path, 404 if kind == "Error" else 200)
            assert f'<MTConnect{kind} xmlns:m="urn:mtconnect.org:MTConnect{kind}:{version}"' in text
            assert ("deviceModelChangeTime" in header(text)) == (version >= "1.7")
        assert ("ASSET_COUNT" in fetch(agent, "/probe")) == (version >= "2.0")
        assert ("ASSET_REMOVED" in fetch(agent, "/probe")) == (version >= "1.3")


@pytest.mark.parametrize(
    ("path", "expected"),
    [
        ("//Linear", {"xp", "xl"}),
        ('//Linear[@name="X"]//DataItem[@type="LOAD"]', {"xl"}),
        ("//Axes", {"xp", "xl", "cm"}),
        ("//Axes//DataItems", {"xp", "xl", "cm"}),
        ('//DataItem[@category="CONDITION"]', {"logic"}),
        ('//DataItem[@type="POSITION" and @subType="ACTUAL"]', {"xp"}),
        ('//DataItem[@type="EXECUTION" or @type="TOOL_NUMBER"]', {"exec", "tool", "lexec"}),
        ('//Device[@name="LATHE-1"]//DataItem[@type="EXECUTION"]', {"lexec"}),
        ("//Linear|//Rotary", {"xp", "xl", "cm"}),
        ("/MTConnectDevices/Devices/Device/Components/Axes/Components/Rotary", {"cm"}),
        ('//*[@id="x"]', {"xp", "xl"}),
        ("//Controller/DataItems/DataItem[@id='tool']", {"tool"}),
        ("//m:Rotary", {"cm"}),
    ],
)
def test_a_path_selects_data_items(tmp_path: Path, path: str, expected: set[str]) -> None:
    with played(tmp_path, [at(0, "tool|1")]) as agent:
        text = fetch(agent, "/current?path=" + path.replace("&", "%26"))
    assert {o.get("dataItemId") for o in observations(text)} == expected


@pytest.mark.parametrize("path", ["Axes", "//Axes[1]", "//Axes[@name]", "//Axes[@name='X' xor @id='y']", "//a" * 2000])
def test_a_path_beyond_the_supported_part_is_an_error(tmp_path: Path, path: str) -> None:
    with played(tmp_path, [at(0, "tool|1")]) as agent:
        assert error(fetch(agent, "/current?path=" + path, 400))[0] == "INVALID_XPATH"


def test_text_from_the_machine_cannot_break_the_document(tmp_path: Path) -> None:
    with played(tmp_path, [at(0, 'tool|<a b="1">&amp;\x07'), at(1, 'logic|FAULT|<&">|||a < b')]) as agent:
        text = fetch(agent, "/current")
    assert values(text, "tool") == ['<A B="1">&AMP;\ufffd']
    fault = next(o for o in observations(text) if o.tag == "Fault")
    assert (fault.text, fault.get("nativeCode")) == ("a < b", '<&">')
