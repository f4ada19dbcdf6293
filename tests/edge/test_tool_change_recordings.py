"""The state machine on recordings of real machines: an Okuma, Hurcos and Mazaks."""

import re
from pathlib import Path

import pytest

from edge.config import ToolChangeSection
from edge.sample import EdgeSample
from edge.tool_change import State, Step, step
from tests.edge.controls.mtconnect.shdr_lines import HURCO, MAZAK, OKUMA, samples_of
from tests.recordings import PROJECT, recording, recordings_folder

CONFIG = ToolChangeSection()
RUNS = sorted(recordings_folder().glob("nist/*/*.txt")) or [PROJECT / "nist" / "missing.txt"]


def folded(path: Path, keys: dict[str, str]) -> tuple[list[EdgeSample], list[EdgeSample]]:
    """The samples of a recording and what the fold made of them; each number is accounted for."""
    state, published, debounced = State(), list[EdgeSample](), 0
    samples = list(samples_of(path, keys))
    for sample in samples:
        done: Step = step(CONFIG, state, sample)
        state, debounced = done.state, debounced + done.debounced
        published += done.samples
    numbers = sum(sample.signal == "tool_number" for sample in samples)
    assert numbers == sum(sample.observations for sample in published) + debounced + state.held
    return samples, published


def spans_of(published: list[EdgeSample]) -> list[tuple[int, int]]:
    """Begin and end of each change."""
    spans, begin = [], None
    for sample in published:
        if sample.signal == "tool_change_active" and sample.value is True:
            assert begin is None, "a change began twice"
            begin = sample.timestamp_ms
        elif sample.signal == "tool_change_active" and begin is not None:  # over, or the connection was lost
            spans.append((begin, sample.timestamp_ms))
            begin = None
    assert begin is None
    return spans


def test_the_okuma_recording_has_exactly_eleven_tool_changes_each_spanning_its_m06() -> None:
    samples, published = folded(recording("mtconnect/okuma.txt"), OKUMA)
    spans = spans_of(published)
    commands = [s.timestamp_ms for s in samples if s.signal == "nc_block" and re.fullmatch("M06", str(s.value))]
    assert len(spans) == len(commands) == 11
    assert all(begin <= command <= end for (begin, end), command in zip(spans, commands, strict=True))
    assert all(6_000 < end - begin < 9_000 for begin, end in spans)


def test_the_okuma_changes_end_with_the_right_tool_and_show_no_flap() -> None:
    _, published = folded(recording("mtconnect/okuma.txt"), OKUMA)
    tools: list[object] = []
    for sample in published:
        if sample.signal == "tool_number" and (not tools or tools[-1] != sample.value):
            tools.append(sample.value)
    first, second, third = [2206, 8003], [2207, 2201, 2202, 2208, 2205, 2204, 2206], [2201, 2202, 2208]
    expected: list[object] = []
    for tool in first + second:
        expected += [tool, None]
    expected[-1:] = [2208, None]  # the third section begins with another tool, without a change
    for tool in third:
        expected += [tool, None]
    expected[-1:] = [8003]  # and so does the fourth
    assert tools == expected


@pytest.mark.parametrize("path", RUNS, ids=lambda path: path.stem)
def test_nist_recordings_go_through_with_each_number_accounted_for(path: Path) -> None:
    path = recording(f"nist/{path.parent.name}/{path.name}")
    _, published = folded(path, MAZAK if path.parent.name == "raw" else HURCO)
    assert spans_of(published)


def test_a_clean_plate_run_has_its_seven_tools() -> None:
    _, published = folded(recording("nist/plate/Plate-Hurco04-13of20.txt"), HURCO)
    assert [s.value for s in published if s.signal == "tool_number" and s.value is not None][-7:] == [7, 15, 3, 4, 5, 1, 23]
    assert len(spans_of(published)) == 7


def test_a_mazak_that_sends_its_zero_degrees_has_no_temperature_then() -> None:
    samples, _ = folded(recording("nist/raw/Mazak01-20180718-20180719.txt"), MAZAK)
    zeros = [s for s in samples if s.signal == "spindle_temp_c" and s.reason == "outside 1 to 150 °C: 0"]
    assert len(zeros) == 1150
    assert all(s.value is None for s in zeros)
