"""The files of the simulated machine fit each other, and nobody pays for the simulation but who simulates."""

import re
import subprocess
import sys
import tomllib
from collections.abc import Iterator
from typing import Any

from cnctwin.standins.simulated_machine import description
from cnctwin.standins.simulated_machine.as_built import machine_as_built
from twin.machine import read_machine

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


def test_the_processors_are_told_what_the_machine_description_tells() -> None:
    settings = tomllib.loads(description.PROCESSORS.read_text(encoding="utf-8"))
    told = read_machine(description.TOLD).model_dump()
    assert settings["thermal"] == told["thermal"]
    force = settings["cutting_force"]
    assert {key: force[key] for key in told["spindle"]} == told["spindle"]
    named = dict(re.findall(r"T(\d) [A-Z ]*?(?:D|M)([\d.]+)", description.program_text().partition("G21")[0]))
    assert {key: f"{value:g}" for key, value in force["tool_diameters_mm"].items()} == named
    assert force["tool_diameters_mm"]["1"] == force["tool_diameters_mm"]["5"] == told["tool"]["diameter_mm"]


def test_start_up_imports_none_of_the_arrays() -> None:
    code = f"import sys, {', '.join(LIGHT)}; print([name for name in {HEAVY!r} if name in sys.modules])"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"
