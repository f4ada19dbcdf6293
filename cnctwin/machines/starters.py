"""Starter machines: a complete machine.toml for each class of machine, every figure of it assumed, with its range and source.

A class is a file `classes/<class>.toml` beside this one, and is found by it; as it stands, its machine has the name of the class.
"""

import json
from pathlib import Path

from cnctwin.errors import UsageError

CLASSES = Path(__file__).with_name("classes")


def machine_classes() -> tuple[str, ...]:
    """Return the classes that there are, in alphabetical order.

    >>> machine_classes()
    ('five-axis', 'hmc', 'lathe', 'router', 'vmc-40')
    """
    return tuple(sorted(file.stem for file in CLASSES.glob("*.toml")))


def starter_text(machine_class: str, machine: str) -> str:
    """Return the text of machine.toml for a machine of a class. Raises UsageError where there is no such class."""
    if machine_class not in machine_classes():
        raise UsageError(f"class {machine_class!r} is not known; there are {', '.join(machine_classes())}")
    text = (CLASSES / f"{machine_class}.toml").read_text(encoding="utf-8")
    return text.replace(f'name = "{machine_class}"', f"name = {json.dumps(machine, ensure_ascii=False)}", 1)


def title_of(machine_class: str) -> str:
    """Return the sentence that says which machines a class holds.

    >>> title_of("vmc-40")[:48]
    'Vertical machining centre: X, Y, Z, 40 taper, ba'
    """
    first = (CLASSES / f"{machine_class}.toml").read_text(encoding="utf-8").partition("\n")[0]
    return first.removeprefix("# ")
