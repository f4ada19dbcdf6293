"""The twin's expectation of the simulated machine's program, as `scripts/make-expectation` has worked it out."""

import json
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from cnctwin.standins.simulated_machine.description import FOLDER, PROGRAM, description_text, program_text
from processors.description import version_of
from twin.expected.files import read_expectation, written

if TYPE_CHECKING:
    from twin.expected.expectation import Expectation

EXPECTATION = FOLDER / "expectation.json"


def worked_out() -> "Expectation":
    """Work it out; it takes half a minute where the kernels are still to be compiled."""
    from twin.expected.making import expectation_of  # noqa: PLC0415  numpy comes with it
    from twin.machine import machine_from_toml  # noqa: PLC0415

    text = description_text()
    return expectation_of(machine_from_toml(text), program_text(), name=PROGRAM.stem, description=version_of(text))


def place_expectation(folder: Path, machine: str) -> str:
    """Put the expectation where the processor `expected` looks for it, under the machine's name; the table that tells it so."""
    written(folder, replace(read_expectation(EXPECTATION), machine=machine))
    return f"\n[expected]\nexpectations = {json.dumps(str(folder))}\nlate_s_max = 60.0\n"
