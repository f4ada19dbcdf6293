"""What each function answers, over the wire."""

import struct
from dataclasses import replace

import pytest
from hypothesis import given
from hypothesis import strategies as st

from cnctwin.standins.focas_server import functions
from cnctwin.standins.focas_server.frames import Code, Request
from cnctwin.standins.focas_server.shown import ControlDescription, Moment
from cnctwin.standins.simulated_control.state import ControlState
from tests.cnctwin.standins.focas_server import captured
from tests.cnctwin.standins.focas_server.client import Block, RawClient, ask, blocks
from tests.cnctwin.standins.focas_server.moments import CHANGING, CUTTING, DESCRIPTION, SWITCHED_ON_S, Serve

CNC, PMC = 1, 2


def one(
    serve: Serve, *asked: int, shown: tuple[ControlState, ...] = (CHANGING,), description: ControlDescription = DESCRIPTION
) -> Block:
    """The answer of a server that shows these states, one after the other, to one question."""
    with RawClient(serve(*shown, description=description).port) as client:
        return ask(client, asked)[0]


def figures(data: bytes, number: int) -> list[float | None]:
    found = list[float | None]()
    for mantissa, base, places in struct.iter_unpack(">iHH", data[: 8 * number]):
        assert base == 10
        found.append(None if places == 0xFFFF else mantissa / 10**places)
    return found


def test_a_captured_open_is_answered_as_a_0i_did(serve: Serve) -> None:
    server = serve(description=ControlDescription(axis_names=("X", "Y")))
    with RawClient(server.port, is_opened=False) as client:
        answer = client.exchange(captured.OPEN)
    assert answer.startswith(captured.OPENED_0I_BEGINS)
    assert len(answer) == 0x168 + 10


def test_a_captured_sysinfo_of_that_control_is_answered_byte_for_byte(serve: Serve) -> None:
    its = ControlDescription(" 0", " M", "D5F3", "11.0", ("X", "Y"), max_axis=32)
    with RawClient(serve(description=its).port) as client:
        assert client.exchange(captured.SYSINFO) == captured.SYSINFO_0I


def test_the_captured_loads_of_a_31i_are_answered_byte_for_byte_up_to_the_axes_that_there_are(serve: Serve) -> None:
    its = ControlDescription(axis_names=("X", "Y", "Z", "B"), work_offset_mm=(0.0,) * 4)
    state = replace(CHANGING, axis_load_pct=(0.0, -3.0, 33.0, 0.0), axis_pos_mm=(0.0,) * 4)
    with RawClient(serve(state, description=its).port) as client:
        answer = client.exchange(captured.LOADS)
    assert len(answer) == len(captured.LOADS_31I)
    ours, theirs = blocks(answer), blocks(captured.LOADS_31I)
    assert (ours[0], ours[1], ours[3]) == (theirs[0], theirs[1], theirs[3])
    assert ours[2].data[:32] == theirs[2].data[:32]


def test_nine_questions_of_a_160i_are_answered_in_its_lengths(serve: Serve) -> None:
    its = ControlDescription(max_axis=8)
    server = serve(replace(CHANGING, program="O3000", line=0), description=its)
    server.faults.failing = {(1, 0x25): 1}
    with RawClient(server.port) as client:
        answer = client.exchange(captured.NINE)
    assert [16 + len(block.data) for block in blocks(answer)][:8] == captured.NINE_160I_LENGTHS
    assert answer[12:].startswith(captured.NINE_160I_BEGINS)
    assert captured.SPINDLE_SPEED_REFUSED_160I in answer


def test_status_says_that_a_tool_change_is_not_finished(serve: Serve) -> None:
    assert struct.unpack(">7H", one(serve, CNC, 0x19).data) == (1, 3, 0, 1, 0, 0, 0)
    assert struct.unpack(">7H", one(serve, CNC, 0x19, shown=(CUTTING,)).data) == (1, 3, 1, 0, 0, 0, 0)


@pytest.mark.parametrize(
    ("state", "mode_and_run"),
    [
        (ControlState(mode="MANUAL_DATA_INPUT", exec_state="READY"), (0, 0)),
        (ControlState(mode="EDIT", exec_state="READY"), (3, 0)),
        (ControlState(mode="MANUAL", exec_state="STOPPED"), (5, 1)),
        (ControlState(mode="AUTOMATIC", exec_state="FEED_HOLD"), (1, 2)),
        (ControlState(mode="AUTOMATIC", exec_state="PROGRAM_COMPLETED"), (1, 0)),
    ],
)
def test_modes_and_runs_have_their_numbers(serve: Serve, state: ControlState, mode_and_run: tuple[int, int]) -> None:
    assert struct.unpack(">7H", one(serve, CNC, 0x19, shown=(state,)).data)[:2] == mode_and_run


def test_m_stays_at_6_after_the_change_and_t_is_the_tool_called_for_next(serve: Serve) -> None:
    after = replace(CUTTING, at_s=1.0, block="G1 X3. T3")
    with RawClient(serve(CHANGING, after, at_s=2.0).port) as client:
        m, t, mstb, macros = ask(client, (CNC, 0x21, 106), (CNC, 0x21, 108), (CNC, 0x19), (CNC, 0x15, 4109, 4120))
    assert struct.unpack(">iBBxx", m.data)[0] == 6
    assert struct.unpack(">iBBxx", t.data)[0] == 3
    assert struct.unpack(">7H", mstb.data)[3] == 0
    assert figures(macros.data, 12) == [0, None, 0, None, 6, 2, 1701, None, None, None, 0, 3]


def test_the_tool_number_is_an_option(serve: Serve) -> None:
    assert one(serve, CNC, 0x22, shown=(CUTTING,)).code == 6
    with_it = one(serve, CNC, 0x22, shown=(CUTTING,), description=replace(DESCRIPTION, has_tool_number=True))
    assert struct.unpack(">ii", with_it.data) == (0, 2)


def test_the_programs_text_begins_at_the_running_block_and_goes_on(serve: Serve) -> None:
    data = one(serve, CNC, 0x20, 256).data
    assert data == struct.pack(">i", 2) + b"T2 M6\nG0 G54 X10. S4000 M3\nG43 H2 T3\n"
    assert one(serve, CNC, 0x20, 7).data[4:] == b"T2 M6\nG"
    assert one(serve, CNC, 0x20, 0).code == 2


def test_program_names_and_numbers(serve: Serve) -> None:
    with RawClient(serve().port) as client:
        numbers, line, path, executing, other_path = ask(client, (1, 0x1C), (1, 0x1D), (1, 0xB9), (1, 0xCF), (1, 0xFC))
    assert struct.unpack(">ii", numbers.data) == (1701, 1701)
    assert struct.unpack(">i", line.data) == (2,)
    assert path.data == other_path.data == b"//CNC_MEM/USER/PATH1/O1701\0"
    assert executing.data == struct.pack(">i36s", 1701, b"O1701")


def test_positions_of_the_machine_differ_from_those_of_the_work_by_the_offset(serve: Serve) -> None:
    with RawClient(serve().port) as client:
        machine, absolute, to_go, y, fourth, unknown = ask(
            client, (1, 0x26, 1, -1), (1, 0x26, 4, -1), (1, 0x26, 7, -1), (1, 0x26, 1, 2), (1, 0x26, 1, 4), (1, 0x26, 5, -1)
        )
    assert figures(machine.data, 3) == [-12.5, -290.0, 0.001]
    assert figures(absolute.data, 3) == [437.5, -10.0, 380.001]
    assert figures(to_go.data, 3) == [0, 0, 0]
    assert len(machine.data) == 32 * 8
    assert figures(y.data, 1) == [-290.0]
    assert (fourth.code, unknown.code) == (4, 4)


def test_feed_speed_and_loads_are_whole_numbers_as_the_control_shows_them(serve: Serve) -> None:
    with RawClient(serve(CUTTING).port) as client:
        feed, speed, servo, both, load, rpm = ask(
            client, (1, 0x24), (1, 0x25), (1, 0x56, 1), (1, 0x40, 0, -1), (1, 0x40, 4, -1), (1, 0x40, 5, 1)
        )
    assert (figures(feed.data, 1), figures(speed.data, 1)) == ([500], [3956])
    assert figures(servo.data, 3) == [3, -4, 12]
    assert figures(both.data, 2) == [17, 3956]
    assert (len(load.data), figures(load.data, 1)) == (64, [17])
    assert (len(rpm.data), figures(rpm.data, 1)) == (8, [3956])


def test_names_and_counts_of_axes(serve: Serve) -> None:
    with RawClient(serve().port) as client:
        axes, spindles, servo_count, spindle_count, odd = ask(
            client, (1, 0x89), (1, 0x8A), (1, 0xA4, 2), (1, 0xA4, 1), (1, 0xA4, 9)
        )
    assert axes.data == b"X\0\0\0Y\0\0\0Z\0\0\0"
    assert spindles.data == b"S\0\0\0"
    assert (servo_count.data, spindle_count.data, odd.code) == (b"\0\3", b"\0\1", 4)


def test_alarms_have_number_type_and_text_and_none_is_no_data(serve: Serve) -> None:
    alarmed = replace(CUTTING, alarm=(1004, "MAGAZINE NOT IN POSITION"))
    with RawClient(serve(alarmed).port) as client:
        message, bits, other_type, status = ask(client, (1, 0x23, -1, 10, 2, 64), (1, 0x1A), (1, 0x23, 3, 10, 2, 64), (1, 0x19))
    assert struct.unpack(">iiii", message.data[:16]) == (1004, 15, 0, 24)
    assert message.data[16:] == b"MAGAZINE NOT IN POSITION".ljust(64, b"\0")
    assert bits.data == (1 << 15).to_bytes(4, "big")
    assert other_type.data == b""
    assert struct.unpack(">7H", status.data)[5] == 1
    assert one(serve, CNC, 0x23, -1, 10, 2, 64) == Block(1, 0x23, 0, b"")


def test_macros_are_values_vacant_or_unknown(serve: Serve) -> None:
    assert figures(one(serve, CNC, 0x15, 500, 502).data, 3) == [12.345, -7.0, None]
    assert one(serve, CNC, 0x15, 40_000, 40_000).code == 3
    assert one(serve, CNC, 0x15, 501, 500).code == 2
    assert one(serve, CNC, 0x15, 500, 900).code == 2


def test_date_and_time_are_those_of_the_controls_own_clock(serve: Serve) -> None:
    with RawClient(serve(at_s=3_661.9).port) as client:
        date, time, macros, odd = ask(client, (1, 0x45, 0), (1, 0x45, 1), (1, 0x15, 3011, 3012), (1, 0x45, 2))
    assert struct.unpack(">3H6x", date.data) == (2026, 1, 1)
    assert struct.unpack(">6x3H", time.data) == (1, 1, 1)
    assert figures(macros.data, 2) == [20_260_101, 10_101]
    assert odd.code == 5


def test_parameters_in_both_generations(serve: Serve) -> None:
    with RawClient(serve().port) as client:
        new, old, unknown = ask(client, (1, 0x8D, 6711, 6711, -1), (1, 0x0E, 6711, 6711, -1), (1, 0x8D, 1, 1, -1))
    assert struct.unpack(">IhHi", new.data[:12]) == (6711, 0, 3, 41)
    assert struct.unpack(">IhHi", old.data[:12]) == (6711, 0, 3, 41)
    assert (len(new.data), len(old.data)) == (8 + 32 * 8, 8 + 32 * 4)
    assert unknown.code == 3


def test_tool_offsets(serve: Serve) -> None:
    assert figures(one(serve, CNC, 0x08, 1, 3, 3).data, 3) == [0, 110.25, 0]
    assert figures(one(serve, CNC, 0x08, 2, 2, 1003).data, 1) == [110.25]
    assert one(serve, CNC, 0x08, 2, 2, 7).code == 4
    assert one(serve, CNC, 0x08, 0, 2, 3).code == 3


def test_g_codes_of_the_first_groups_are_those_of_the_blocks(serve: Serve) -> None:
    with RawClient(serve(replace(CUTTING, block="G91 G28 Z0."), replace(CUTTING, at_s=1.0), at_s=2.0).port) as client:
        motion, plane, distance, unknown = ask(client, (1, 0x96, 0), (1, 0x96, 1), (1, 0x96, 2), (1, 0x96, 3))
    assert [struct.unpack(">H4xH2xH", block.data) for block in (motion, plane, distance)] == [(0, 1, 0), (1, 17, 0), (2, 91, 0)]
    assert unknown.code == 4


def test_the_pmc_shows_overrides_strobes_and_the_machine_builders_relay(serve: Serve) -> None:
    with RawClient(serve().port) as client:
        feed, rapid, spindle, strobes, m, t, relay = ask(
            client,
            (PMC, 0x8001, 12, 12, 0, 0),
            (PMC, 0x8001, 14, 14, 0, 0),
            (PMC, 0x8001, 30, 30, 0, 0),
            (PMC, 0x8001, 7, 7, 1, 0),
            (PMC, 0x8001, 10, 13, 1, 2),
            (PMC, 0x8001, 26, 29, 1, 0),
            (PMC, 0x8001, 100, 100, 5, 0),
        )
    tool = one(serve, PMC, 0x8001, 100, 101, 9, 1, shown=(CUTTING,))
    assert (255 - feed.data[0], rapid.data[0], spindle.data[0]) == (80, 1, 110)
    assert strobes.data == b"\x09"
    assert m.data == b"\0\0\0\6", "a double word has its high byte first"
    assert t.data == b"\2\0\0\0", "bytes lie as in the PMC"
    assert (relay.data, tool.data) == (b"\1", b"\0\2")


@pytest.mark.parametrize(
    ("arguments", "code"),
    [((0, 0, 10, 0), 4), ((0, 0, 0, 3), 4), ((767, 768, 0, 0), 3), ((-1, 0, 0, 0), 3), ((0, 2, 0, 1), 2), ((0, 1400, 5, 0), 2)],
)
def test_pmc_ranges_that_there_are_not(serve: Serve, arguments: tuple[int, ...], code: int) -> None:
    assert one(serve, PMC, 0x8001, *arguments).code == code


_int32 = st.integers(-(2**31), 2**31 - 1) | st.integers(-2, 1100)


@given(st.sampled_from(sorted(functions.FUNCTIONS)), st.tuples(_int32, _int32, _int32, _int32), st.booleans())
def test_whatever_the_arguments_there_is_an_answer_of_bounded_length_or_a_code(
    function: tuple[int, int], arguments: tuple[int, int, int, int], is_changing: bool
) -> None:
    moment = Moment(CHANGING if is_changing else ControlState(), SWITCHED_ON_S, DESCRIPTION)
    given_ = functions.answer(moment, Request(function[0], 1, function[1], arguments))
    assert isinstance(given_, Code) or len(given_) <= 1440


def test_another_path_is_refused() -> None:
    moment = Moment(CHANGING, SWITCHED_ON_S, DESCRIPTION)
    assert functions.answer(moment, Request(1, 2, 0x19)) is Code.PATH


def test_one_frame_is_one_moment_however_many_questions_it_has(serve: Serve) -> None:
    with RawClient(serve().port) as client:
        answers = ask(client, *[(CNC, 0x1C), (CNC, 0x19)] * 50)
    assert len({block.data for block in answers}) == 2


def test_what_has_no_room_in_the_frame_is_refused_and_the_rest_is_answered(serve: Serve) -> None:
    with RawClient(serve().port) as client:
        answers = ask(client, *[(CNC, 0x26, 1, -1)] * 20, (CNC, 0x1D))
    assert [block.code for block in answers] == [0] * 12 + [2] * 8 + [0]


def test_the_list_of_programs_begins_with_the_next_that_there_is(serve: Serve) -> None:
    description = ControlDescription(program_comments={1701: "BASE PLATE", 1800: "BRACKET"}, operator_message=(2001, "COOLANT"))
    with RawClient(serve(ControlState(), description=description).port) as client:
        listed, message = ask(client, (CNC, 0x06, 1702, 19, 2), (CNC, 0x34))
    assert struct.unpack(">II64s", listed.data)[::2] == (1800, b"BRACKET".ljust(64, b"\0"))
    assert struct.unpack_from(">iii7s", message.data) == (2001, 0, 7, b"COOLANT")
