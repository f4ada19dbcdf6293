"""The two benchmarks of the optimiser, as they stand beside `benchmarks/optimise.py`."""

from pathlib import Path
from typing import Any

from twin.machine import machine_from_toml
from twin.machine_toml import machine_to_toml
from twin.optimisation.question import Question

FOLDER = Path(__file__).parent.parent.parent.parent / "benchmarks"


def text(name: str) -> str:
    """One of the files."""
    return (FOLDER / f"optimise_{name}").read_text()


def paper(**changes: Any) -> Question:
    """The reference paper's benchmark with reconstruction constants."""
    return Question(text("paper.nc"), text("paper.toml"), name="paper").with_(**changes)


def second(**changes: Any) -> Question:
    """Three slots for which time and cost disagree."""
    return Question(text("second.nc"), text("second.toml"), name="second").with_(**changes)


def machine_with(toml: str, **sections: Any) -> str:
    """A machine with some sections replaced: keys of a section as a dict, None = without it."""
    values = machine_from_toml(toml).model_dump()
    for name, section in sections.items():
        values[name] = section if section is None or not isinstance(section, dict) else {**(values[name] or {}), **section}
    return machine_to_toml(type(machine_from_toml(toml)).model_validate(values))
