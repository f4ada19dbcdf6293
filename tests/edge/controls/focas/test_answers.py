"""From blocks of the Ethernet protocol to facts, call by call."""

import json
import struct

import pytest
from hypothesis import given
from hypothesis import strategies as st

from edge.controls.focas import answers
from edge.controls.focas.calls import Answer, Call, FocasValue, Identity, Request, keys_of
from edge.controls.focas.policy import DATA, NUMBER
from edge.controls.focas.wire import Block, Reply

WHO = Identity("31", "M", "G421", "40.1", ("X", "Z"))
VACANT = "ffffffff000affff"
UNKNOWN = (Call.TOOL, Call.LIFE, Call.HISTORY)
EVERY = [
    *(Request(call) for call in Call if call not in {Call.PMC, Call.G_CODE, Call.OFFSET, Call.MACRO, Call.COMMENT, *UNKNOWN}),
    Request(Call.PMC, "F10:4"),
    Request(Call.G_CODE, "2"),
    Request(Call.OFFSET, "length_wear 7"),
    Request(Call.MACRO, "500"),
    Request(Call.COMMENT, "1701"),
]


def given_by(request: Request, *data: str | int) -> Answer:
    """Return what a call gives for blocks of these bytes, or codes."""
    plan = answers.exchange(request)
    assert plan is not None
    found = [Reply(one, b"") if isinstance(one, int) else Reply(0, bytes.fromhex(one)) for one in data]
    assert len(found) == len(plan.blocks)
    return answers.answer(request, plan, found, WHO)


def values(answer: Answer) -> dict[str, object]:
    return {one.key: one.value if one.code == 0 else -one.code for one in answer.found}


def figure(number: int, decimals: int = 0) -> str:
    return struct.pack(">iHh", number, 10, decimals).hex()


def test_status_is_seven_words() -> None:
    found = values(given_by(Request(Call.STATUS), "0001 0003 0001 0001 0000 0000 0000"))
    assert found == dict(zip(keys_of(Request(Call.STATUS), ()), (1, 3, 1, 1, 0, 0, 0), strict=True))


def test_each_part_of_the_dynamic_data_may_be_refused_by_itself() -> None:
    positions = figure(-2880, 3) + figure(-10, 3) + "2020020230333033"  # an axis that is not there holds what it likes
    answer = given_by(Request(Call.DYNAMIC), "000006a5 000006a5", "00000090", figure(3200), 1, positions)
    assert values(answer) == {
        "program.number": 1701,
        "program.main": 1701,
        "sequence": 144,
        "feed": 3200,
        "spindle_rpm": -1,
        "position.X": -2.88,
        "position.Z": -0.01,
    }


def test_an_axis_without_a_value_does_not_spoil_the_others() -> None:
    assert values(given_by(Request(Call.SERVO_LOAD), figure(33) + VACANT)) == {"servo_load.X": 33, "servo_load.Z": -DATA}
    assert values(given_by(Request(Call.SERVO_LOAD), figure(33))) == {"servo_load.X": 33, "servo_load.Z": -DATA}


def test_modal_codes_come_from_their_system_variables() -> None:
    row = [VACANT] * 14
    row[4109 - 4107], row[4113 - 4107], row[4120 - 4107] = figure(12345, 1), figure(6), figure(7)
    row[4111 - 4107], row[4107 - 4107] = figure(17), figure(27)
    assert values(given_by(Request(Call.MODAL), "".join(row))) == {
        "modal.M": 6,
        "modal.S": None,
        "modal.T": 7,
        "modal.F": 1234.5,
        "modal.H": 17,
        "modal.D": 27,
    }


def test_a_program_is_named_by_the_newer_function_or_the_older() -> None:
    full, short = b"//CNC_MEM/USER/PATH1/O2001".hex(), "000007d1" + b"O2001".ljust(36, b"\0").hex()
    assert values(given_by(Request(Call.PROGRAM), full, 1)) == {"program.name": "//CNC_MEM/USER/PATH1/O2001"}
    assert values(given_by(Request(Call.PROGRAM), 1, short)) == {"program.name": "O2001"}
    assert given_by(Request(Call.PROGRAM), 1, 6) == Answer(1)


def test_alarms_are_named_as_on_the_screen() -> None:
    one = struct.pack(">4i", 10, 3, 0, 15) + b"IMPROPER G-CODE".ljust(64, b"\0")
    two = struct.pack(">4i", 401, 6, 1, 64) + b"SERVO ALARM".ljust(64)
    found = values(given_by(Request(Call.ALARMS), (one + two).hex()))
    assert found["alarms"] == "PS0010 IMPROPER G-CODE; SV0401 SERVO ALARM"
    listed = json.loads(str(found["alarm_list"]))
    assert [(alarm["code"], alarm["text"], alarm["active"]) for alarm in listed] == [
        ("PS0010", "IMPROPER G-CODE", True),
        ("SV0401", "SERVO ALARM", True),
    ]
    assert values(given_by(Request(Call.ALARMS), "")) == {"alarms": "", "alarm_list": "[]"}


def test_an_operator_message_has_a_number_and_a_text_or_there_is_none() -> None:
    message = struct.pack(">3i", 2001, 0, 13) + b"CHECK COOLANT".ljust(256, b"\0")
    assert values(given_by(Request(Call.MESSAGE), message.hex())) == {"operator_message": "CHECK COOLANT"}
    assert values(given_by(Request(Call.MESSAGE), struct.pack(">3i", -1, 0, 0).hex())) == {"operator_message": ""}
    assert values(given_by(Request(Call.MESSAGE), "")) == {"operator_message": ""}
    assert given_by(Request(Call.MESSAGE), "0000") == Answer(DATA)


def test_a_comment_is_that_of_the_program_asked_for_and_of_no_other() -> None:
    record = struct.pack(">II64s", 1701, 12, b"BASE PLATE")
    assert values(given_by(Request(Call.COMMENT, "1701"), record.hex())) == {"program.comment": "BASE PLATE"}
    assert values(given_by(Request(Call.COMMENT, "1700"), record.hex())) == {"program.comment": -NUMBER}
    assert given_by(Request(Call.COMMENT, "1700"), "") == Answer(DATA)


def test_an_offset_and_a_variable_are_one_figure_each() -> None:
    assert values(given_by(Request(Call.OFFSET, "length_wear 7"), figure(-15, 3))) == {"offset.length_wear": -0.015}
    plan = answers.exchange(Request(Call.OFFSET, "radius 12"))
    assert plan is not None
    assert plan.blocks == (Block(0x08, (12, 12, 1001)),)
    assert values(given_by(Request(Call.MACRO, "500"), figure(805, 1))) == {"macro.500": 80.5}
    assert values(given_by(Request(Call.MACRO, "500"), VACANT)) == {"macro.500": None}


@pytest.mark.parametrize(("code", "flag", "name"), [(90, 0, "G90"), (542, 1, "G54.2"), (401, 1, "G40.1")])
def test_g_codes_have_tenths_where_the_flag_says_so(code: int, flag: int, name: str) -> None:
    assert values(given_by(Request(Call.G_CODE, "2"), struct.pack(">6H", 2, 0, 0, code, 0, flag).hex())) == {"modal.G2": name}


def test_bytes_of_the_pmc_have_the_lowest_first() -> None:
    assert values(given_by(Request(Call.PMC, "F10:4"), "06000000")) == {"pmc.F10:4": 6}
    assert given_by(Request(Call.PMC, "F10:4"), "0600") == Answer(DATA)
    assert values(given_by(Request(Call.PMC, "D300:2"), "feff")) == {"pmc.D300:2": 65_534}
    assert values(given_by(Request(Call.PMC, "D300:2S"), "feff")) == {"pmc.D300:2S": -2}


def test_the_clock_is_a_date_and_a_time() -> None:
    answer = given_by(Request(Call.CLOCK), "07ea 0005 000e 000000000000", "000000000000 0009 001e 0000")
    assert [one.value for one in answer.found] == [2026, 5, 14, 9, 30, 0]
    assert given_by(Request(Call.CLOCK), "07ea 0005 000e 000000000000", 3) == Answer(DATA)


def test_what_has_no_published_command_is_not_guessed() -> None:
    assert [answers.exchange(Request(call)) for call in UNKNOWN] == [None] * len(UNKNOWN)
    commands = {block.command for request in EVERY if (plan := answers.exchange(request)) for block in plan.blocks}
    assert not commands & {0x21, 0x22, 0x48, 0x8B}


def test_only_commands_that_read_are_ever_sent() -> None:
    blocks = [block for request in EVERY if (plan := answers.exchange(request)) for block in plan.blocks]
    sent = {(block.device, block.command) for block in (*blocks, *answers.IDENTITY_BLOCKS)}
    reading = {
        0x06,
        0x34,
        0x08,
        0x15,
        0x18,
        0x19,
        0x1C,
        0x1D,
        0x20,
        0x23,
        0x24,
        0x25,
        0x26,
        0x40,
        0x45,
        0x56,
        0x89,
        0x96,
        0xA4,
        0xCF,
        0xFC,
    }
    assert sent == {(1, command) for command in reading} | {(2, 0x8001)}


@given(st.sampled_from(EVERY), st.data())
def test_whatever_a_control_answers_gives_the_known_facts_or_a_code(request: Request, data: st.DataObject) -> None:
    plan = answers.exchange(request)
    assert plan is not None
    good, bad = st.builds(Reply, st.just(0), st.binary(max_size=300)), st.builds(Reply, st.integers(1, 17), st.just(b""))
    found = data.draw(st.lists(good | bad, min_size=len(plan.blocks), max_size=len(plan.blocks)))
    answer = answers.answer(request, plan, found, WHO)
    assert all(isinstance(one, FocasValue) and one.key in keys_of(request, WHO.axes) for one in answer.found)
    assert bool(answer.found) is (answer.code == 0)
