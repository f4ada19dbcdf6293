"""A piece of a job: a function of ours, named, applied to a JSON text; its answer is a JSON text too, also where it fails.

So what travels between processes and machines is a name and a text, there and back. Nothing of a piece's own is pickled, not even
its error, and the far end says which version of us it is.
"""

import importlib
import json
import logging
import traceback
from collections.abc import Callable
from importlib.metadata import version

from cnctwin.errors import SpreadError, UsageError
from twin.errors import TwinError

PACKAGES = ("sparkplug", "twin", "edge", "processors", "cnctwin")
"""The packages whose functions may be sent."""
_BLAMED: dict[str, type[Exception]] = {"TwinError": TwinError, "UsageError": UsageError}
"""Errors of the input: they come back as what they were."""
_log = logging.getLogger(__name__)


def name_of(function: Callable[[str], str], packages: tuple[str, ...] = PACKAGES) -> str:
    """`module:function`, by which any process finds it again. Raises SpreadError where none would.

    >>> name_of(run_piece)
    'cnctwin.jobs.piece:run_piece'
    >>> name_of(lambda text: text)
    Traceback (most recent call last):
    cnctwin.errors.SpreadError: cnctwin.jobs.piece:<lambda> cannot be spread: it has to stand on the top level of its module
    """
    module, name = getattr(function, "__module__", "?"), getattr(function, "__qualname__", repr(function))
    if module.partition(".")[0] not in packages:
        raise SpreadError(f"{module}:{name} cannot be spread: only functions of {', '.join(packages)} are")
    if getattr(importlib.import_module(module), name, None) is not function:
        raise SpreadError(f"{module}:{name} cannot be spread: it has to stand on the top level of its module")
    return f"{module}:{name}"


def run_piece(name: str, text: str) -> str:
    """At the far end: the answer of the function of that name, or what went wrong, in an envelope for `opened`."""
    module, _, function = name.partition(":")
    try:
        envelope = {"answer": getattr(importlib.import_module(module), function)(text)}
    except Exception as error:  # it is told to whom the job belongs
        kind = next((kind for kind, of in _BLAMED.items() if isinstance(error, of)), "")
        envelope = {"kind": kind, "said": str(error) if kind else _in_one_line(error)}
        if not kind:
            _log.exception("%s failed", name)
    return json.dumps({"version": version("cnctwin"), **envelope})


def opened(envelope: str, number: int) -> str:
    """The answer in an envelope; raises the error in it (TwinError, UsageError), or SpreadError with the number of the piece."""
    told = json.loads(envelope)
    if told["version"] != version("cnctwin"):
        computed_by = f"was computed by cnctwin {told['version']}, and this is {version('cnctwin')}"
        raise SpreadError(f"piece {number} {computed_by}; install the same everywhere")
    if "answer" in told:
        return str(told["answer"])
    if told["kind"] in _BLAMED:
        raise _BLAMED[told["kind"]](told["said"])
    raise SpreadError(f"piece {number} failed: {told['said']}")


def _in_one_line(error: Exception) -> str:
    """Type, text and place of an error of our own making."""
    last = traceback.extract_tb(error.__traceback__)[-1]
    return f"{type(error).__name__}: {' '.join(str(error).split())} ({last.filename}:{last.lineno})"
