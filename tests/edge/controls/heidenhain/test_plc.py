"""PLC addresses: as this edge reads them, and as pyLSV2 does, from the same server."""

import pyLSV2
import pytest
from hypothesis import given
from hypothesis import strategies as st

from cnctwin.standins.lsv2_server import plc_memory
from cnctwin.standins.lsv2_server.server import Lsv2Server
from cnctwin.standins.simulated_control.control import SimulatedControl
from cnctwin.standins.simulated_control.state import ControlState
from edge.controls.heidenhain.plc import PlcAddress
from edge.errors import ConfigError

STATE = ControlState(
    tool_number=7, is_changing_tool=True, spindle_rpm=-8500.0, spindle_load_pct=41.3, feed_mm_min=3800.0, program="O1701"
)
ADDRESSES = ("M4000", "M4001", "W1000", "D1004", "W1008", "D1012", "B1000", "W1016", "S0", "D59996", "W0", "I3", "O5")


def test_it_reads_what_pylsv2_reads() -> None:
    with Lsv2Server(SimulatedControl([STATE])) as server:
        client = pyLSV2.LSV2("127.0.0.1", port=server.port, timeout=2.0, safe_mode=False)
        client.connect()
        try:
            for text in ADDRESSES:
                address = PlcAddress.parse(text)
                place = address.lies_at(client.parameters)
                assert place is not None
                data = plc_memory.read(STATE, *place)
                assert data is not None
                if text != "D59996":  # pyLSV2 counts half of the double words that there are (its issue 61)
                    assert address.value(data) == client.read_plc_address(text), text
        finally:
            client.disconnect()


@pytest.mark.parametrize("text", ["", "X5", "M", "W-2", "D1003", "W1001", "ID2", "m4000", "W 1000", "D99999999", "M4000.1"])
def test_what_is_no_address_is_refused_with_the_way_out(text: str) -> None:
    with pytest.raises(ConfigError, match=r"PLC address|multiple of"):
        PlcAddress.parse(text)


def test_memory_that_the_control_does_not_have_is_nowhere() -> None:
    parameters = pyLSV2.misc.decode_system_parameters(bytearray(plc_memory.system_parameters()))
    for text in ("M10000", "D60000", "W60000", "S32", "B60000"):
        assert PlcAddress.parse(text).lies_at(parameters) is None
    assert PlcAddress.parse("W2").lies_at(pyLSV2.SystemParameters()) is None


@given(st.integers(-(2**31), 2**31 - 1))
def test_double_words_are_signed_and_little_endian(number: int) -> None:
    assert PlcAddress.parse("D4").value(number.to_bytes(4, "little", signed=True)) == number
