"""The PLC memory that the simulated control shows. Every builder of machines has his own addresses; these are ours.

    M4000  a tool change is in progress        M4001  coolant
    W1000  tool in the spindle, 0 while none   D1004  spindle speed, rev/min
    W1008  spindle load, 0.1 %                 D1012  path feed, mm/min
    W1016  spindle temperature, 0.1 °C         S0     selected program

Markers take a byte each; B, W and D lie in one memory, whose addresses count bytes, little-endian.
"""

import struct

from cnctwin.standins.simulated_control.state import ControlState

MARKERS_START, MARKERS = 0x0000_1000, 10_000
INPUTS_START, INPUTS = 0x0000_5000, 1_000
OUTPUTS_START, OUTPUTS = 0x0000_6000, 1_000
COUNTERS_START, COUNTERS = 0x0000_7000, 100
TIMERS_START, TIMERS = 0x0000_8000, 100
WORDS_START, WORDS = 0x0001_0000, 30_000
STRINGS_START, STRINGS, STRING_BYTES = 0x0004_0000, 32, 64
READ_BYTES_MAX = 255
SHOWN = ("M4000", "M4001", "W1000", "D1004", "W1008", "D1012", "W1016", "S0")


def system_parameters(block_bytes_max: int = 4096) -> bytes:
    """The answer to R_PR: where each kind of memory begins and how much there is, and how long a telegram may be."""
    regions = [MARKERS_START, MARKERS, INPUTS_START, INPUTS, OUTPUTS_START, OUTPUTS, COUNTERS_START, COUNTERS]
    regions += (TIMERS_START, TIMERS, WORDS_START, WORDS, STRINGS_START, STRINGS)
    words_of_inputs_and_outputs = (0x0000_9000, 100, 0x0000_A000, 100, 0, 0, 0, 0)
    return struct.pack(
        "!14L8B8L2BH4B2L2HL",
        *regions,
        *(STRING_BYTES, 0, 0, 0, 0, 0, 0, 0),
        *words_of_inputs_and_outputs,
        *(1, 255, block_bytes_max),
        *(0, 0, 0, 0),
        *(1, 0),
        *(0, 0),
        0,
    )


def read(state: ControlState, address: int, count: int) -> bytes | None:
    """So many bytes from an absolute address; None where there is no such memory."""
    for start, size in (
        (MARKERS_START, MARKERS),
        (INPUTS_START, INPUTS),
        (OUTPUTS_START, OUTPUTS),
        (COUNTERS_START, COUNTERS),
        (TIMERS_START, TIMERS),
        (WORDS_START, WORDS * 2),
        (STRINGS_START, STRINGS * STRING_BYTES),
    ):
        if start <= address and address + count <= start + size and 0 < count <= READ_BYTES_MAX:
            return _cut(_written(state), address, count)
    return None


def _written(state: ControlState) -> tuple[tuple[int, bytes], ...]:
    return (
        (MARKERS_START + 4000, bytes([state.is_changing_tool])),
        (MARKERS_START + 4001, bytes([state.coolant_on])),
        (WORDS_START + 1000, struct.pack("<h", state.tool_number)),
        (WORDS_START + 1004, struct.pack("<l", round(state.spindle_rpm))),
        (WORDS_START + 1008, struct.pack("<h", round(state.spindle_load_pct * 10))),
        (WORDS_START + 1012, struct.pack("<l", round(state.feed_mm_min))),
        (WORDS_START + 1016, struct.pack("<h", round(state.spindle_temp_c * 10))),
        (STRINGS_START, state.program.encode("latin-1", "replace")[: STRING_BYTES - 1]),
    )


def _cut(written: tuple[tuple[int, bytes], ...], address: int, count: int) -> bytes:
    memory = bytearray(count)
    for at, data in written:
        for number, byte in enumerate(data, at - address):
            if 0 <= number < count:
                memory[number] = byte
    return bytes(memory)
