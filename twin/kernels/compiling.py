"""`kernel`: compiles a function when it is first called, and keeps it for the next process.

numba's own cache looks at the file of a function, not at those of the functions that it calls, so after a change in one file it
would go on running the old code of another. Here what is kept belongs to one state of all packages that have such functions;
they call nothing outside, and the named tuples that they take are declared inside.
"""

import hashlib
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any, TypeVar, cast

import numba
from numba import njit

from twin.kernels.kernel_folder import VERSIONS_MAX, keep_newest, kernel_folder

Function = TypeVar("Function", bound=Callable[..., object])


@cache
def _kept_in() -> str:
    digest = hashlib.sha256(numba.__version__.encode())
    sources = {source: source.read_bytes() for source in sorted(Path(__file__).parents[1].rglob("*.py"))}
    packages = {source.parent for source, text in sources.items() if b"from twin.kernels.compiling import" in text}
    for source, text in sources.items():
        if source.parent in packages:
            digest.update(text)
    folder = kernel_folder() / f"twin-{digest.hexdigest()[:16]}"
    if not folder.exists():
        keep_newest(list(kernel_folder().glob("twin-*")), VERSIONS_MAX - 1)
        folder.mkdir(mode=0o700, exist_ok=True)
    return str(folder)


def kernel(function: Function) -> Function:
    """The compiled function; it raises as Python does, and divides as Python does."""
    settings: Any = numba.config
    before, settings.CACHE_DIR = settings.CACHE_DIR, _kept_in()
    try:
        compiled: Any = njit(cache=True)(function)
    finally:
        settings.CACHE_DIR = before
    return cast("Function", compiled)
