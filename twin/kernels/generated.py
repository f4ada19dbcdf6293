"""Generated text becomes a module: in Python as it is, or compiled and kept under a name that is the hash of the text."""

import hashlib
import importlib.abc
import importlib.util
import sys
import tempfile
from functools import cache
from pathlib import Path
from types import ModuleType
from typing import Any

from twin.kernels.kernel_folder import KERNELS_MAX, keep_newest, kernel_folder


class _FromText(importlib.abc.InspectLoader):
    """Loads a module from its text."""

    def __init__(self, text: str) -> None:
        self.text = text

    def get_source(self, fullname: str) -> str:
        return self.text


@cache
def in_python(text: str) -> dict[str, Any]:
    """The names that the generated text defines, run by the interpreter; `njit(…)` in it hands functions through."""
    spec = importlib.util.spec_from_loader("generated", _FromText(text))
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    module.__dict__["njit"] = lambda **_options: lambda function: function
    spec.loader.exec_module(module)
    return vars(module)


@cache
def compiled(text: str) -> ModuleType:
    """The module of the generated text, its functions compiled when they are first called, and kept for the next process."""
    import numba  # noqa: PLC0415 - the live twin runs the text without it

    text = f"# numba {numba.__version__}\nfrom numba import njit\n\n{text}"
    name = f"kernel_{hashlib.sha256(text.encode()).hexdigest()[:24]}"
    path = kernel_folder() / f"{name}.py"
    if not path.exists() or path.read_text(encoding="utf-8") != text:
        keep_newest(list(kernel_folder().glob("kernel_*.py")), KERNELS_MAX)
        _write_whole(path, text)
    spec = importlib.util.spec_from_file_location(name, path)
    assert spec is not None and spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules[name] = module
    spec.loader.exec_module(module)
    return module


def _write_whole(path: Path, text: str) -> None:
    """Another process may write the same text at the same time: each writes its own file and moves it into place."""
    with tempfile.NamedTemporaryFile("w", dir=path.parent, suffix=".part", delete=False, encoding="utf-8") as part:
        part.write(text)
    Path(part.name).replace(path)
