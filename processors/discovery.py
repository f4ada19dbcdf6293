"""Finding processors, without importing what is not asked for.

A processor is a file `<name>.py` with its sample configuration `<name>.toml` beside it, or a folder `<name>/` with both, the
declaration in `processor.py`. Nothing is registered by being imported.
"""

import importlib
from difflib import get_close_matches
from functools import cache
from pathlib import Path
from typing import Any

import processors
from processors.contract import CellProcessor, Processor
from processors.errors import DeclarationError, UnknownProcessorError

AnyProcessor = Processor[Any, Any] | CellProcessor[Any, Any]

FOLDER = Path(processors.__path__[0])


@cache
def modules() -> dict[str, str]:
    """The module that declares each processor, by the processor's name in alphabetical order; imports none of them."""
    found = {sample.stem: f"processors.{sample.stem}" for sample in FOLDER.glob("*.toml")}
    found |= {one.parent.name: f"processors.{one.parent.name}.processor" for one in FOLDER.glob("*/processor.py")}
    return dict(sorted(found.items()))


def discover() -> dict[str, AnyProcessor]:
    """All processors by name, in alphabetical order. Raises DeclarationError where file and name differ."""
    return {name: find(name) for name in modules()}


def module_of(name: str) -> str:
    """The module that declares the processor `name`, not imported. Raises UnknownProcessorError."""
    if name not in modules():
        near = "".join(f"did you mean {one}? " for one in get_close_matches(name, modules(), 1))
        raise UnknownProcessorError(f"no processor {name!r}; {near}there are: {', '.join(modules())}")
    return modules()[name]


def find(name: str) -> AnyProcessor:
    """The processor `name`; imports no other. Raises UnknownProcessorError, DeclarationError."""
    module = importlib.import_module(module_of(name))
    declared = getattr(module, "PROCESSOR", None)
    if not isinstance(declared, Processor | CellProcessor) or declared.name != name:
        raise DeclarationError(f"{module.__name__}: PROCESSOR has to be one, named {name!r}")
    return declared


def sample_configuration(processor: AnyProcessor) -> Path:
    """The sample configuration beside the processor's declaration; its values are the defaults."""
    beside = FOLDER / processor.name / f"{processor.name}.toml"
    return beside if beside.exists() else FOLDER / f"{processor.name}.toml"
