"""The expectation that the demo ships is the one of its program and its machine, and fits what the machine shows."""

from pathlib import Path

import numpy as np
import pytest

from cnctwin.standins.simulated_machine.description import description_text, program_text
from cnctwin.standins.simulated_machine.expectation import EXPECTATION, place_expectation, worked_out
from cnctwin.standins.simulated_machine.part import spare_part
from processors.description import version_of
from twin.expected.files import load_expectations, read_expectation, stale
from twin.expected.making import text_sha256


def test_it_is_up_to_date() -> None:
    shipped, now = read_expectation(EXPECTATION), worked_out()
    assert stale(shipped, program_sha256=text_sha256(program_text()), description=version_of(description_text())) is None
    assert [run.line for run in shipped.runs] == [run.line for run in now.runs]
    assert [run.time_s for run in shipped.runs] == pytest.approx([run.time_s for run in now.runs], rel=1e-6)
    shown, own = ([found.at(line) for line in found.runs_of_line] for found in (shipped, now))
    assert [one and one.feed_mm_min for one in shown] == pytest.approx([one and one.feed_mm_min for one in own], rel=1e-6)


def test_the_demo_finds_it_under_the_name_that_the_control_tells(tmp_path: Path) -> None:
    table = place_expectation(tmp_path, "vmc-7")
    assert f'expectations = "{tmp_path}"' in table
    assert load_expectations(tmp_path)["vmc-7"].get("O1701") is not None


def test_the_machine_as_it_is_differs_by_its_few_percent() -> None:
    """Over the lines of the roughing tool, as the control shows them ten times a second."""
    expected, tool, shown = read_expectation(EXPECTATION), "", []
    row: dict[str, str] = {}
    for moment in spare_part().moments:
        row |= moment.values
        tool = row.get("Tool_number") or tool
        found = expected.at(int(row["line"]), tool=int(tool)) if row.get("line") and tool == "1" else None
        if found is not None and found.cut_load_pct > 5.0:
            shown.append((float(row["Sload"]), found.load_pct))
    measured, by_twin = np.array(shown).T
    assert len(shown) > 100
    assert measured.mean() == pytest.approx(by_twin.mean(), rel=0.12)
