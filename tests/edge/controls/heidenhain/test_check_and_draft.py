"""`edge check` and `edge discover` on a real server of each model."""

import json
import socket
import subprocess
import sys
from pathlib import Path

import pytest

from cnctwin.standins.lsv2_server.answers import Model
from cnctwin.standins.lsv2_server.server import Lsv2Server
from cnctwin.standins.simulated_control.control import SimulatedControl
from cnctwin.standins.simulated_control.state import ControlState
from edge.config import EdgeConfig
from edge.config_file import parse
from edge.controls.heidenhain.check import describe
from edge.controls.heidenhain.config import HeidenhainConfig
from edge.controls.heidenhain.draft import draft
from edge.errors import ConfigError, ConnectionLostError

ROOT = Path(__file__).parents[4]
STATE = ControlState(exec_state="ACTIVE", program="O1701", line=20, tool_number=1, spindle_rpm=8500.0)


def control(clock_offset_s: float = 0.0) -> SimulatedControl:
    return SimulatedControl([STATE], clock_offset_s=clock_offset_s)


def test_check_shows_each_signal_with_its_source_and_its_value_or_why_there_is_none() -> None:
    with Lsv2Server(control(), model=Model.TNC640) as server:
        source = HeidenhainConfig(url=server.url, plc={"spindle_rpm": "D1004", "coolant_on": "M99999"})
        rows = {row.signal: row for row in describe(EdgeConfig(source=source))}
    assert (rows["tool_number"].value, rows["tool_number"].source) == (1, "program text")
    assert (rows["spindle_rpm"].value, rows["spindle_rpm"].source, rows["spindle_rpm"].unit) == (8500.0, "PLC D1004", "rev/min")
    assert rows["nc_block"].value == "L Z+2 FMAX"
    assert rows["alarm"].reason == "only the iTNC 530 tells it over LSV2"
    assert rows["feed_mm_min"].reason == "no telegram of LSV2 tells it; name its PLC address in [heidenhain.plc]"
    assert "this control has no M99999" in str(rows["coolant_on"].reason)


def test_check_says_that_no_tool_can_be_had_and_what_to_do() -> None:
    with Lsv2Server(control(), model=Model.TNC640) as server:
        bare = EdgeConfig(source=HeidenhainConfig(url=server.url, program_text=False))
        rows = {row.signal: row for row in describe(bare)}
        assert "plc.tool_number" in str(rows["tool_number"].reason)
        asked = EdgeConfig(source=HeidenhainConfig(url=server.url, tool_number_from="control"))
        assert {row.signal: row for row in describe(asked)}["tool_number"].reason == "only the iTNC 530 tells it over LSV2"


def test_check_of_a_control_that_is_not_there_says_so_in_one_line() -> None:
    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))
        url = f"lsv2://127.0.0.1:{taken.getsockname()[1]}"
        with pytest.raises(ConnectionLostError, match="is the control on, the address right, and external access permitted"):
            describe(EdgeConfig(source=HeidenhainConfig(url=url, timeout_s=0.5)))


@pytest.mark.parametrize("model", Model)
def test_a_draft_is_a_configuration_that_loads(model: Model) -> None:
    with Lsv2Server(control(clock_offset_s=7200.0 + 3.0), model=model) as server:
        text = draft(server.url)
    config = parse(text, Path("drafted.toml"))
    assert (config.machine.name, config.source.url) == (model.value, server.url)
    assert config.source.clock_utc_offset_h == 2.0
    assert "tool_number = 1" in text
    assert ("alarm: only the iTNC 530" in text) == (model is Model.TNC640)


def test_a_draft_of_what_is_no_address_says_what_one_is() -> None:
    with pytest.raises(ConfigError, match="such as lsv2://tnc640:19000"):
        draft("http://tnc640")


WITHOUT = """
import sys
sys.modules["pyLSV2"] = None
from edge.adapter import adapters
from edge.config import EdgeConfig
from edge.errors import ConfigError
adapter = adapters()["heidenhain"]
config = EdgeConfig(source=adapter.config_model())
asked = [lambda: adapter.describe(config), lambda: adapter.draft("lsv2://127.0.0.1", "")]
asked += [lambda: next(adapter.connect(config).frames())]
for ask in asked:
    try:
        ask()
    except ConfigError as error:
        print(error)
"""


def test_without_pylsv2_the_adapter_is_found_and_one_line_says_what_to_install() -> None:
    done = subprocess.run([sys.executable, "-c", WITHOUT], cwd=ROOT, capture_output=True, text=True, check=True)
    assert done.stdout.splitlines() == 3 * [
        "the adapter heidenhain needs pyLSV2; install it with: pip install 'cnctwin[heidenhain]'"
    ]


def test_check_shows_the_tool_table_and_chosen_addresses_over_the_real_wire() -> None:
    text = """
[machine]
adapter = "heidenhain"
[heidenhain]
url = "{url}"
tool_table = 'TNC:{table}'
[variables]
length = {{ address = "/TABLE/TOOL/T/1/L", unit = "mm" }}
[plc]
load = {{ address = "W1008", unit = "%", scale = 0.1 }}
changing = {{ address = "M4000", kind = "flag" }}
coolant = {{ address = "M4001" }}
"""
    shown = {}
    for model, table in ((Model.TNC640, "\\table\\tool.t"), (Model.ITNC530, "\\TOOL.T")):
        with Lsv2Server(control(), model=model) as server:
            config = parse(text.format(url=server.url, table=table), Path("edge.toml"))
            rows = {row.signal: row for row in describe(config)}
            assert server.answers.counters.writes_refused == 0
        assert [rows[name].value for name in ("tool_length_mm", "tool_length_wear_mm", "tool_life_used_min")] == [
            127.5,
            -0.01,
            18.5,
        ]
        assert (rows["plc_load"].value, rows["plc_load"].unit, rows["plc_load"].source) == (0.0, "%", "PLC W1008")
        assert (rows["plc_changing"].value, rows["plc_coolant"].value) == (False, 0.0)
        assert str(rows["program_comment"].value).startswith("O1701 BASE PLATE")
        shown[model] = rows["variable_length"]
    assert (shown[Model.ITNC530].value, shown[Model.ITNC530].source) == (127.5, "R_DP /TABLE/TOOL/T/1/L")
    assert shown[Model.TNC640].reason == "only the iTNC 530 has data paths; name a PLC address"


def test_messages_of_an_itnc_are_a_text_and_a_list() -> None:
    shows = SimulatedControl(
        [ControlState(exec_state="STOPPED", program="O1701", line=20, tool_number=1, alarm=(1020, "OVERLOAD"))]
    )
    with Lsv2Server(shows, model=Model.ITNC530) as server:
        rows = {row.signal: row for row in describe(EdgeConfig(source=HeidenhainConfig(url=server.url)))}
    assert rows["alarm"].value == "1020 OVERLOAD"
    assert [alarm["code"] for alarm in json.loads(str(rows["alarms"].value))] == ["1020"]
    assert (rows["tool_length_mm"].value, rows["tool_length_mm"].source) == (100.0, "R_RI 51")


@pytest.mark.parametrize(
    ("table", "message"),
    [
        ('[variables]\nq = { address = "Q10" }', "variables.q.address: 'Q10' is a Q parameter, which LSV2 does not tell"),
        ('[plc]\nx = { address = "S1" }', "plc.x.address: 'S1' is a string"),
        ('[plc]\nx = { address = "W1001" }', "'W1001': the number of a W is a multiple of 2, such as W1000"),
        ('[heidenhain]\ntool_table = "tool.t"', "heidenhain.tool_table"),
    ],
)
def test_an_address_that_cannot_be_is_refused_before_any_connection(table: str, message: str) -> None:
    with pytest.raises(ConfigError) as caught:
        parse(f'[machine]\nadapter = "heidenhain"\n{table}\n', Path("edge.toml"))
    assert message in str(caught.value)
