"""One look, whatever the content of the answers is: facts that make a frame, or the end of the connection."""

import time
from collections.abc import Callable
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from edge.config import EdgeConfig
from edge.controls.heidenhain.config import HeidenhainConfig
from edge.controls.heidenhain.control import Control
from edge.controls.heidenhain.cursor import parse, start
from edge.controls.heidenhain.link import READS, TELEGRAMS_MAX
from edge.errors import ConnectionLostError
from edge.sweep import Sweep

CONFIG: EdgeConfig[Any] = EdgeConfig(source=HeidenhainConfig(plc={"spindle_rpm": "D1004", "tool_change": "M4000"}))


def control_that(answers: Callable[[str], tuple[str, bytes]]) -> Control:
    """A control whose telegrams are well-formed and hold what this function says."""
    control = Control(CONFIG, clock=time.monotonic, patience_s=1.0)
    control.link._socket = object()  # type: ignore[assignment]
    control.link.connect = control.link.disconnect = lambda: None  # type: ignore[method-assign]
    control.link._exchange = lambda _socket, word, _data: answers(word)  # type: ignore[method-assign]
    return control


_CONTENT = st.binary(max_size=40) | st.sampled_from(
    [
        b"",
        b"\x00\x01nan\x00X\x00",
        b"\x00\x01inf\x00X\x00",
        b"\xff" * 24,
        b"\x00\x00\x00\x05\x00\x00",
        b"iTNC530\x00a\x00b\x00c\x00",
        b"\x01\x63",
    ]
)


@settings(max_examples=60)
@given(data=st.data())
def test_any_content_of_well_formed_telegrams_makes_a_frame_or_ends_the_connection(data: st.DataObject) -> None:
    parts = iter(range(8))

    def answers(word: str) -> tuple[str, bytes]:
        kinds = [*READS[word], "T_ER"] if next(parts, None) is not None else [READS[word][-1], "T_ER"]
        return data.draw(st.sampled_from(kinds)), data.draw(_CONTENT)

    control = control_that(answers)
    try:
        control.open()
    except ConnectionLostError as error:
        assert "\n" not in str(error)[:20]
    try:
        facts = [*control.look(), control.program("TNC:\\x.H")]
        control.clock(lambda: 1_000)
    except ConnectionLostError:
        return
    sweep = Sweep("life", 0, 1_000, tuple(facts), (), 250)
    _, given_ = parse(CONFIG, start(CONFIG), sweep.encode())
    assert given_.accounted()
    assert given_.error is None
    assert all(sample.value is not None or sample.reason for sample in given_.samples)


def test_messages_or_a_file_without_end_end_the_connection() -> None:
    for read in (lambda control: control._errors(), lambda control: control._text("TNC:\\x.H")):
        control = control_that(lambda word: ("T_OK", b"") if word == "A_LG" else (READS[word][0], b"\x00" * 12))
        control.link.begin(60.0)
        with pytest.raises(ConnectionLostError, match=f"more than {TELEGRAMS_MAX} telegrams in one look"):
            read(control)
