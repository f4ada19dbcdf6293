"""Which data item becomes which signal."""

import pytest

from edge.config import SignalSection
from edge.controls.mtconnect.documents import DevicesDocument, parse_document
from edge.controls.mtconnect.mapping import Assignment, assign, names_and_types
from edge.controls.mtconnect.model import DeviceModel
from edge.errors import ConfigError
from edge.signals import signal
from tests.edge.controls.mtconnect.agent_documents import probe
from tests.recordings import recording

CONTROLS = {
    "Fanuc": {"Sspeed": "spindle_rpm", "Spindle_load": "spindle_load_pct", "path_feedrate": "feed_mm_min", "block": "nc_block"},
    "Heidenhain": {"S1Actual": "spindle_rpm", "S1Load": "spindle_load_pct"},
    "Siemens": {
        "actSpeed1": "spindle_rpm",
        "actLoad1": "spindle_load_pct",
        "actTNumber": "tool_number",
        "progStatus": "exec_state",
    },
    "Okuma": {"S1speed": "spindle_rpm", "p1block": "nc_block", "p1CurrentTool": "tool_number", "pexecution": "exec_state"},
    "Mazak": {"Srpm": "spindle_rpm", "Sload": "spindle_load_pct", "Fact": "feed_mm_min", "Tool_number": "tool_number"},
    "Hurco": {
        "Spindle_Speed": "spindle_rpm",
        "Feed_Rate": "feed_mm_min",
        "Current_Tool": "tool_number",
        "Block_Number": "nc_line",
    },
}


def devices(raw: bytes) -> dict[str, DeviceModel]:
    document = parse_document(raw)
    assert isinstance(document, DevicesDocument)
    return {device.name: device for device in document.devices}


def sources(assignment: Assignment) -> dict[str, str]:
    return {offer.signal: offer.source for offer in assignment.offers}


def by_names(names: dict[str, str]) -> DeviceModel:
    """A device whose items say nothing but their name, as an agent with a vendor's types does."""
    items = "".join(f'<DataItem category="EVENT" id="i{i}" name="{name}" type="x:VENDOR"/>' for i, name in enumerate(names))
    device = f'<Device name="M" uuid="m"><DataItems>{items}</DataItems></Device>'
    raw = f"<MTConnectDevices><Header/><Devices>{device}</Devices></MTConnectDevices>"
    return devices(raw.encode())["M"]


@pytest.mark.parametrize("control", CONTROLS)
def test_the_names_of_a_control_are_enough(control: str) -> None:
    names = CONTROLS[control]
    assert sources(assign(by_names(names), {})) == {signal: name for name, signal in names.items()}


def test_the_types_of_the_standard_are_enough() -> None:
    assert sources(assign(devices(probe())["VMC"], {})) == {
        "spindle_rpm": "rpm",
        "spindle_load_pct": "load",
        "spindle_temp_c": "temp",
        "feed_mm_min": "feed",
        "nc_block": "block",
        "exec_state": "exec",
        "tool_number": "Tool",
        "axis_x_pos_mm": "xpos",
        "axis_x_load_pct": "xload",
    }


def test_the_okuma_has_its_main_spindle_and_an_axis_for_each_letter() -> None:
    assignment = assign(devices(recording("mtconnect/okuma_devices.xml").read_bytes())["OKUMA"], {})
    found = sources(assignment)
    assert assignment.spindles == ("Lc1", "Lc2", "Lc6")
    assert {found[name] for name in found if name.startswith("spindle_")} == {"S1speed", "S1cmd", "S1load", "S1ovr"}
    assert (found["axis_z_pos_mm"], found["axis_z4_pos_mm"]) == ("Z1actm", "Z4actm")
    assert (found["axis_c_pos_deg"], found["axis_b_pos_deg"]) == ("C3actm", "B1actw")
    assert (found["nc_block"], found["nc_line"], found["tool_number"]) == ("p1block", "p1BlockNumber", "p1CurrentTool")


@pytest.mark.parametrize("spindle", ["C6", "Lc6"])
def test_another_spindle_may_be_chosen_by_name_or_id(spindle: str) -> None:
    device = devices(recording("mtconnect/okuma_devices.xml").read_bytes())["OKUMA"]
    found = sources(assign(device, {}, spindle))
    assert {found[name] for name in found if name.startswith("spindle_")} == {"S6speed", "S6cmd", "S6load", "S6ovr"}


def test_a_spindle_that_is_not_there_is_refused_with_those_that_are() -> None:
    device = devices(recording("mtconnect/okuma_devices.xml").read_bytes())["OKUMA"]
    with pytest.raises(ConfigError, match=r"spindle = 'S9'.* it has C1 \(Lc1\), C2 \(Lc2\), C6 \(Lc6\)"):
        assign(device, {}, "S9")


def test_the_load_of_a_c_axis_is_not_the_load_of_the_spindle_it_shares_a_component_with() -> None:
    found = sources(assign(devices(recording("nist/devices.xml").read_bytes())["Mazak01"], {}))
    assert (found["spindle_load_pct"], found["axis_c_load_pct"], found["spindle_temp_c"]) == ("Sload", "Cload", "Stemp")
    assert found["rapid_override_pct"] == "Frapidovr"


def test_every_device_of_nist_gets_its_state_program_and_overrides() -> None:
    for device in devices(recording("nist/devices.xml").read_bytes()).values():
        assert {"exec_state", "program", "nc_line", "feed_override_pct", "spindle_override_pct"} <= set(
            sources(assign(device, {}))
        )


def test_the_configuration_comes_first_and_may_leave_a_signal_out() -> None:
    device = devices(recording("mtconnect/okuma_devices.xml").read_bytes())["OKUMA"]
    sections = {
        "spindle_rpm": SignalSection(data_item="LS6speed"),
        "alarm": SignalSection(publish=False),
        "program": SignalSection(publish=False),
    }
    found = sources(assign(device, sections))
    assert found["spindle_rpm"] == "S6speed"
    assert "program" not in found


def test_an_item_feeds_one_signal() -> None:
    device = devices(probe())["VMC"]
    assignment = assign(device, {"spindle_power_kw": SignalSection(data_item="load", native_unit="KILOWATT")})
    assert sources(assignment)["spindle_power_kw"] == "load"
    assert "spindle_load_pct" not in sources(assignment)


def test_a_unit_that_leads_nowhere_is_refused_with_the_way_out() -> None:
    with pytest.raises(
        ConfigError, match=r"signals.spindle_power_kw: data item load: native unit 'PERCENT' cannot become kW.* set .*native_unit"
    ):
        assign(devices(probe())["VMC"], {"spindle_power_kw": SignalSection(data_item="load")})


def test_limits_that_the_control_declares_go_into_the_birth() -> None:
    limits = b"<Constraints><Maximum>150</Maximum><Minimum>0</Minimum></Constraints>"
    load = b'<DataItem category="SAMPLE" id="load" type="LOAD" units="PERCENT"'
    raw = probe().replace(load + b"/>", load + b">" + limits + b"</DataItem>")
    (offer,) = [offer for offer in assign(devices(raw)["VMC"], {}).offers if offer.signal == "spindle_load_pct"]
    assert (offer.low, offer.high) == (0.0, 150.0)


def test_the_table_names_only_canonical_signals() -> None:
    names, rules = names_and_types()
    for name in (*names, *(rule.signal for rule in rules)):
        assert signal(name).name == name
