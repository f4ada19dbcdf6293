"""Finding processors: each module of this package that holds a `PROCESSOR`. Nothing is registered by being imported."""

import importlib
import pkgutil
from pathlib import Path
from typing import Any

import processors
from processors.contract import CellProcessor, Processor
from processors.errors import DeclarationError, UnknownProcessorError

AnyProcessor = Processor[Any, Any] | CellProcessor[Any, Any]


def discover() -> dict[str, AnyProcessor]:
    """All processors by name, in alphabetical order. Raises DeclarationError where file and name differ."""
    found: dict[str, AnyProcessor] = {}
    for module in sorted(pkgutil.iter_modules(processors.__path__), key=lambda module: module.name):
        processor = _declared_in(module.name)
        if processor is not None:
            found[module.name] = processor
    return found


def find(name: str) -> AnyProcessor:
    """The processor `name`; loads no other. Raises UnknownProcessorError."""
    known = {module.name for module in pkgutil.iter_modules(processors.__path__)}
    processor = _declared_in(name) if name in known else None
    if processor is None:
        raise UnknownProcessorError(f"no processor {name!r}; there are: {', '.join(discover())}")
    return processor


def sample_configuration(processor: AnyProcessor) -> Path:
    """The sample configuration beside the processor's file; its values are the defaults."""
    return Path(processors.__path__[0]) / f"{processor.name}.toml"


def _declared_in(module_name: str) -> AnyProcessor | None:
    declared = getattr(importlib.import_module(f"processors.{module_name}"), "PROCESSOR", None)
    if declared is None:
        return None
    if not isinstance(declared, Processor | CellProcessor) or declared.name != module_name:
        raise DeclarationError(f"processors/{module_name}.py: PROCESSOR has to be one, named {module_name!r}")
    return declared
