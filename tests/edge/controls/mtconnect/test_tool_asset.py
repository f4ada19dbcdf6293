"""The tool in the spindle as an asset of the agent: what its figures mean, when the agent is asked, and what it may answer."""

from pathlib import Path

import pytest
from pydantic import TypeAdapter

from cnctwin.standins.mtconnect_agent.replay_agent import ReplayAgent
from edge.chosen import PlcAddresses, Variables
from edge.config import EdgeConfig, SignalSection
from edge.config_file import parse as parse_file
from edge.controls.mtconnect.check import describe
from edge.controls.mtconnect.config import MtconnectConfig
from edge.controls.mtconnect.connection import error_document
from edge.controls.mtconnect.cursor import next_request
from edge.controls.mtconnect.documents import AssetsDocument, parse_document, timestamp_ms
from edge.controls.mtconnect.state import Cursor, Phase
from edge.controls.mtconnect.tool_asset import Life, ToolAsset
from edge.errors import ConfigError
from tests.edge.controls.mtconnect.agent_documents import CONFIG, error, fed, probe, streams, value, values
from tests.recordings import recording

TOOL = (
    '<DataItem category="EVENT" id="ta" type="TOOL_ASSET_ID"/><DataItem category="EVENT" id="ac" type="ASSET_CHANGED"/>'
    '<DataItem category="EVENT" id="msg" type="MESSAGE"/>'
)
NAMES = "tool_life_used_min", "tool_life_limit_min", "tool_life_used_count", "tool_life_limit_count"


def with_tool() -> bytes:
    return probe().replace(b'<DataItem category="EVENT" id="avail"', TOOL.encode() + b'<DataItem category="EVENT" id="avail"', 1)


def asset(asset_id: str, minutes: str = "12") -> bytes:
    return (
        '<MTConnectAssets><Header instanceId="1"/><Assets>'
        f'<CuttingTool assetId="{asset_id}"><CuttingToolLifeCycle><ToolLife type="MINUTES" countDirection="UP" limit="60">'
        f'{minutes}</ToolLife><Measurements><FunctionalLength units="INCH">5</FunctionalLength></Measurements>'
        "</CuttingToolLifeCycle></CuttingTool></Assets></MTConnectAssets>"
    ).encode()


def changed_asset(sequence: int, asset_id: str, time: str) -> str:
    """Return the observation as an agent sends it: the element says that it is of an asset."""
    return value("ac", sequence, asset_id, time=time, element="AssetChanged")


def loaded(tool: str = "7.1") -> Cursor:
    """The cursor when /current has named the tool in the spindle."""
    return fed(with_tool(), streams(10, [value("ta", 5, tool)]))[0]


@pytest.mark.parametrize(
    ("direction", "value_", "initial", "limit", "used", "most"),
    [
        ("UP", 206.0, 0.0, 0.0, 206.0, None),  # as the recorded Okuma says it
        ("UP", 12.0, None, 60.0, 12.0, 60.0),
        ("DOWN", 12.0, 60.0, None, 48.0, 60.0),
        ("DOWN", 12.0, 60.0, 10.0, 48.0, 50.0),
        ("DOWN", 12.0, None, None, None, None),
        ("UP", None, None, None, None, None),
    ],
)
def test_life_counts_up_to_its_limit_or_down_from_its_beginning(
    direction: str, value_: float | None, initial: float | None, limit: float | None, used: float | None, most: float | None
) -> None:
    life = Life("MINUTES", direction, value_, initial, limit)
    assert (life.used(), life.most()) == (used, most)


def test_a_figure_that_is_missing_or_cannot_be_is_a_null_with_the_tool_in_its_reason() -> None:
    outcomes = dict(ToolAsset("7.1", (Life("MINUTES", "UP", 2e6, None, None),), (("CuttingDiameter", 12.0),)).outcomes())
    assert outcomes["tool_life_used_min"][2] == "outside 0 to 1e+06: 2e+06"
    assert outcomes["tool_life_limit_min"][2] == "tool 7.1: the control sets no limit"
    assert outcomes["tool_life_used_count"][2] == "tool 7.1: its asset has no ToolLife in PART_COUNT"
    assert outcomes["tool_length_mm"][2] == "tool 7.1: its asset has no FunctionalLength"
    assert outcomes["tool_radius_mm"][0] == 6.0


def test_the_recorded_assets_of_a_real_okuma_are_read() -> None:
    document = parse_document(recording("mtconnect/golden/okuma_assets_2.3.xml").read_bytes())
    assert isinstance(document, AssetsDocument)
    tools = {tool.id: tool for tool in document.tools}
    assert len(tools) == 17
    assert dict(tools["123456.9000"].outcomes())["tool_life_used_min"][0] == 206.0


def test_the_agent_is_asked_for_the_tool_and_sampling_goes_on_where_it_was() -> None:
    cursor = loaded()
    assert next_request(CONFIG, cursor).path == "/asset/7.1"
    cursor, frame = fed(asset("7.1"), cursor=cursor)
    assert dict(values(frame)) | {"tool_radius_mm": None} == {
        "tool_life_used_min": 12.0,
        "tool_life_limit_min": 60.0,
        "tool_life_used_count": None,
        "tool_life_limit_count": None,
        "tool_length_mm": 127.0,
        "tool_radius_mm": None,
    }
    assert (cursor.phase, cursor.next_sequence, frame.received) == (Phase.SAMPLE, 10, 6)
    assert fed(asset("7.1"), cursor=cursor)[1].samples == ()  # nobody waits for it


def test_an_asset_that_changes_often_is_asked_for_every_five_seconds_at_most() -> None:
    cursor, _ = fed(asset("7.1"), cursor=loaded())
    for second, phase in ((1, Phase.SAMPLE), (4, Phase.SAMPLE), (5, Phase.ASSET)):
        created = f"2026-01-01T00:00:{second:02d}Z"
        changed = changed_asset(10 + second, "7.1", time="2031-06-01T00:00:00Z")  # the stamp of ASSET_CHANGED dates nothing
        cursor, _ = fed(streams(11 + second, [changed], created=created), cursor=cursor)
        assert cursor.phase is phase
    later = streams(60, [value("ac", 50, "8.1")], created="2026-01-01T01:00:00Z")
    other, _ = fed(later, cursor=fed(asset("7.1"), cursor=cursor)[0])
    assert other.phase is Phase.SAMPLE  # the asset of a tool in the magazine


def test_the_last_change_before_a_machine_falls_silent_is_read_with_a_heartbeat() -> None:
    cursor, _ = fed(asset("7.1"), cursor=loaded())
    cursor, _ = fed(streams(12, [value("ac", 11, "7.1")], created="2026-01-01T00:00:02Z"), cursor=cursor)
    assert cursor.phase is Phase.SAMPLE
    cursor, _ = fed(streams(12, created="2026-01-01T00:00:06Z"), cursor=cursor)
    assert next_request(CONFIG, cursor).path == "/asset/7.1"
    cursor, frame = fed(asset("7.1", "13"), cursor=cursor)
    assert dict(values(frame))["tool_life_used_min"] == 13.0
    assert fed(streams(12, created="2026-01-01T00:00:30Z"), cursor=cursor)[0].phase is Phase.SAMPLE


def test_a_clock_of_the_agent_that_is_set_back_does_not_hold_a_change_back() -> None:
    cursor, _ = fed(asset("7.1"), cursor=loaded())
    cursor, _ = fed(streams(12, [value("ac", 11, "7.1")], created="2025-12-31T23:00:00Z"), cursor=cursor)
    assert cursor.phase is Phase.ASSET


@pytest.mark.parametrize("days", ["2031-06-01", "2019-06-01"])
def test_the_tool_is_dated_by_the_machine_and_not_by_the_clock_of_the_agent_or_the_day_of_its_measurement(days: str) -> None:
    cut = value("msg", 6, "cut", time="2026-01-01T00:00:07Z")
    lost = value("avail", 7, "UNAVAILABLE", time=f"{days}T00:00:00Z")
    found = [value("ta", 5, "7.1", time="2026-01-01T00:00:05Z"), cut, lost, changed_asset(8, "7.1", time=f"{days}T00:00:00Z")]
    cursor, frame = fed(with_tool(), streams(10, found))
    stamps = {one.timestamp_ms for one in fed(asset("7.1"), cursor=cursor)[1].samples}
    assert stamps == {frame.newest_ms} == {timestamp_ms("2026-01-01T00:00:07Z")}


@pytest.mark.parametrize(("told", "why"), [("", "no tool in the spindle"), ("UNAVAILABLE", "unavailable")])
def test_without_a_tool_its_signals_are_nulls(told: str, why: str) -> None:
    cursor, _ = fed(asset("7.1"), cursor=loaded())
    cursor, frame = fed(streams(11, [value("ta", 10, told)]), cursor=cursor)
    assert {(one.value, one.reason) for one in frame.samples} == {(None, why)}
    assert cursor.phase is Phase.SAMPLE


@pytest.mark.parametrize(
    ("answer", "why"),
    [
        (error("ASSET_NOT_FOUND", "no such asset"), "the agent answers ASSET_NOT_FOUND: no such asset"),
        (error_document("timed out <"), "the agent answers NO_ANSWER: timed out <"),
        (asset("8.1"), "the agent answers with another"),
    ],
)
def test_an_agent_without_the_asset_costs_one_question_and_no_sample(answer: bytes, why: str) -> None:
    cursor, frame = fed(answer, cursor=loaded())
    assert (cursor.phase, cursor.attempt, frame.error) == (Phase.SAMPLE, 0, None)
    assert {one.reason for one in frame.samples} == {f"the asset of tool 7.1 cannot be read: {why}"}


def test_what_is_not_to_be_published_is_not_asked_for() -> None:
    names = (*NAMES, "tool_length_mm", "tool_radius_mm")
    config = EdgeConfig(source=MtconnectConfig(), signals={name: SignalSection(publish=False) for name in names})
    cursor, _ = fed(with_tool(), streams(10, [value("ta", 5, "7.1")]), config=config)
    assert cursor.phase is Phase.SAMPLE


def test_chosen_data_items_and_entries_of_data_sets_are_signals() -> None:
    config = EdgeConfig(
        source=MtconnectConfig(),
        variables=TypeAdapter(Variables).validate_python({"width": {"address": "vars[VC1]", "unit": "mm", "scale": 0.5}}),
        plc=TypeAdapter(PlcAddresses).validate_python({"note": {"address": "msg", "kind": "flag"}, "rpm": {"address": "rpm"}}),
    )
    cursor, frame = fed(with_tool(), config=config)
    offers = {offer.signal: offer for offer in frame.offers or ()}
    assert (offers["variable_width"].source, offers["variable_width"].declared.unit) == ("vars[VC1]", "mm")
    several = '<VariableDataSet dataItemId="vars" sequence="{}" timestamp="2026-01-01T00:00:01Z">{}</VariableDataSet>'
    first = several.format(3, '<Entry key="VC1">80</Entry><Entry key="VC2">1</Entry>')
    cursor, frame = fed(streams(6, [first, value("msg", 4, "ON"), value("rpm", 5, "900")]), cursor=cursor, config=config)
    assert values(frame) == [
        ("variable_width", 40.0),
        ("operator_message", "ON"),
        ("plc_note", True),
        ("spindle_rpm", 900.0),
        ("plc_rpm", 900.0),
    ]
    other = several.format(6, '<Entry key="VC2">2</Entry>')
    removed = several.format(7, '<Entry key="VC1" removed="true"/>')
    _, frame = fed(streams(8, [other, removed]), cursor=cursor, config=config)
    assert [(one.signal, one.value, one.reason) for one in frame.samples] == [("variable_width", None, "unavailable")]


def test_check_shows_the_tool_of_an_agent_and_a_wrong_address_is_one_line(tmp_path: Path) -> None:
    files = recording("mtconnect/okuma.txt"), recording("mtconnect/okuma_devices.xml")
    with ReplayAgent(*files, device="OKUMA", speed=0, style="2.3") as agent:
        for _ in range(40):
            agent.step()
        text = '[mtconnect]\nurl = "{}"\ndevice = "OKUMA"\n[variables]\nx = {{ address = "{}" }}\n'
        rows = {
            row.signal: row for row in describe(parse_file(text.format(agent.url, "Lp1CommonVariable[VC1]"), tmp_path / "e.toml"))
        }
        assert rows["tool_life_used_min"].source == "asset of the tool in the spindle"
        assert isinstance(rows["tool_life_used_min"].value, float), rows["tool_life_used_min"]
        assert rows["alarms"].value == "[]"
        with pytest.raises(ConfigError) as caught:
            describe(parse_file(text.format(agent.url, "Lp1CommonVariabel"), tmp_path / "e.toml"))
    assert "variables.x.address = 'Lp1CommonVariabel': device 'OKUMA' has no such item with values; near are" in str(caught.value)


def test_a_unit_that_the_agent_declares_is_converted_or_refused_in_one_line() -> None:
    def with_unit(unit: str) -> EdgeConfig[MtconnectConfig]:
        chosen = TypeAdapter(Variables).validate_python({"speed": {"address": "rpm", "unit": unit}})
        return EdgeConfig(source=MtconnectConfig(), variables=chosen)

    config = with_unit("rev/s")
    _, frame = fed(with_tool(), streams(6, [value("rpm", 5, "900")]), config=config)
    assert dict(values(frame))["variable_speed"] == 15.0
    _, frame = fed(with_tool(), config=with_unit("bar"))
    assert frame.error == (
        "variables.speed.unit = 'bar': the control says otherwise: REVOLUTION/MINUTE is a speed of rotation and bar a pressure; "
        "correct it, or add a scale"
    )
