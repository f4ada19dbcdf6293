"""The lines of a recording (SHDR or `time|key|value`) as canonical samples, for tests that need no agent."""

from collections.abc import Iterator, Mapping
from pathlib import Path

from edge.controls.mtconnect.documents import timestamp_ms
from edge.controls.mtconnect.mapping import Target
from edge.reading import read
from edge.sample import EdgeSample

OKUMA = {"p1CurrentTool": "tool_number", "p1block": "nc_block", "pexecution": "exec_state"}
HURCO = {"Current_Tool": "tool_number", "Program_Status": "exec_state", "Spindle_Speed": "spindle_rpm"}
MAZAK = {"Tool_number": "tool_number", "execution": "exec_state", "S2temp": "spindle_temp_c"}


def samples_of(path: Path, keys: Mapping[str, str]) -> Iterator[EdgeSample]:
    """One sample for each key and value; keys that are not in `keys` only tell the time."""
    end_of_asset = ""
    for line in path.read_text(encoding="utf-8", errors="replace").splitlines():
        fields = line.split("|")
        if end_of_asset:
            end_of_asset = "" if line == end_of_asset else end_of_asset
        elif len(fields) > 1 and fields[1].startswith("@"):
            end_of_asset = fields[-1] if fields[-1].startswith("--multiline--") else ""
        elif len(fields) > 2 and (at_ms := timestamp_ms(fields[0])) is not None:
            for key, text in zip(fields[1::2], fields[2::2], strict=False):
                yield _sample(keys.get(key, ""), text, at_ms)


def _sample(signal: str, text: str, at_ms: int) -> EdgeSample:
    if not signal:
        return EdgeSample("feed_mm_min", 0.0, at_ms, observations=0)
    value, quality, reason = read(Target("x", signal, low=1, high=150), text)
    return EdgeSample(signal, value, at_ms, quality, reason)
