"""The files of the simulated machine fit each other, and nobody pays for the simulation but who simulates."""

import re
import subprocess
import sys
import tomllib
from collections.abc import Iterator
from typing import Any

from cnctwin.standins.simulated_machine import description
from cnctwin.standins.simulated_machine.as_built import machine_as_built
from twin.machine import machine_from_toml, read_machine

HEAVY = ("numpy", "scipy", "numba", "pyarrow")
LIGHT = (
    "cnctwin.cli",
    "cnctwin.demo.demo",
    "cnctwin.standins.simulated_machine.serve",
    "edge.running.runtime",
    "edge.check",
    "processors.running.runtime",
)


def figures(table: dict[str, Any], path: str = "") -> Iterator[tuple[str, float]]:
    for key, value in table.items():
        if isinstance(value, dict):
            yield from figures(value, f"{path}{key}.")
        elif isinstance(value, int | float):
            yield f"{path}{key}", float(value)


def test_the_machine_differs_from_what_is_told_by_a_few_per_cent() -> None:
    told, built = read_machine(description.TOLD).model_dump(), machine_as_built().model_dump()
    before = dict(figures(told))
    changed = {
        name: value / before[name] - 1.0
        for name, value in figures(built)
        if not name.startswith("noise") and value != before[name]
    }
    assert len(changed) > 15
    assert all(0.01 < abs(part) < 0.1 for part in changed.values()), changed
    assert not [name for name in changed if "gain" in name or "lead" in name], "a control knows its own parameters"


def test_the_live_twin_is_told_the_machine_with_the_tools_of_its_program() -> None:
    told, alone = machine_from_toml(description.description_text()), read_machine(description.TOLD)
    assert told.model_copy(update={"tools": {}}) == alone
    named = dict(re.findall(r"T(\d) [A-Z ]*?(?:D|M)([\d.]+)", description.program_text().partition("G21")[0]))
    assert {number: f"{tool.diameter_mm:g}" for number, tool in told.tools.items()} == named
    assert alone.tool is not None
    assert told.tools["1"].diameter_mm == told.tools["5"].diameter_mm == alone.tool.diameter_mm


def test_the_processors_are_told_how_to_run_and_not_what_the_machine_is() -> None:
    settings = tomllib.loads(description.PROCESSORS.read_text(encoding="utf-8"))
    assert settings.keys() == {"gap", "loop"}
    assert not {"rated_power_kw", "idle_power_kw"} & settings["gap"].keys()


def test_start_up_imports_none_of_the_arrays() -> None:
    code = f"import sys, {', '.join(LIGHT)}; print([name for name in {HEAVY!r} if name in sys.modules])"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"
