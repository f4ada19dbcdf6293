"""The process in which the user's FOCAS library runs: `python -m edge.controls.focas.library_process`, spoken to over its pipes.

What the library prints goes to the standard error, so that it cannot get between the frames.
"""

import json
import os
import struct
import sys
from typing import Any, BinaryIO

from edge.controls.focas.calls import Call, FocasValue, Request
from edge.controls.focas.fwlib import Fwlib
from edge.controls.focas.library import FRAME_BYTES_MAX, packed
from edge.controls.focas.policy import NODLL


def serve(source: BinaryIO, sink: BinaryIO) -> None:
    """Answer requests until the pipe ends."""
    library: Fwlib | None = None
    try:
        while message := _message(source):
            if "open" in message:
                try:
                    library = Fwlib(message["open"]["library"])
                except (OSError, AttributeError) as error:
                    sink.write(packed({"code": NODLL, "why": f"{message['open']['library']}: {error}"}))
                    continue
                sink.write(packed(_opened(library, message["open"])))
            elif library is not None:
                answers = [_answer(library, Request(Call(call), argument)) for call, argument in message["ask"]]
                sink.write(packed({"answers": answers}))
    finally:
        if library is not None:
            library.close()


def _opened(library: Fwlib, wanted: dict[str, Any]) -> dict[str, Any]:
    code = library.open(wanted["host"], wanted["port"], wanted["timeout_s"], wanted["path"])
    return {"code": code, "identity": library.identity}


def _answer(library: Fwlib, request: Request) -> tuple[int, tuple[FocasValue, ...]]:
    answer = library.call(request)
    return answer.code, answer.found


def _message(source: BinaryIO) -> Any:
    head = source.read(4)
    if len(head) < 4:
        return None
    length: int = struct.unpack(">I", head)[0]
    return json.loads(source.read(length)) if length <= FRAME_BYTES_MAX else None


if __name__ == "__main__":
    pipe = os.dup(sys.stdout.fileno())
    os.dup2(sys.stderr.fileno(), sys.stdout.fileno())
    with os.fdopen(pipe, "wb", buffering=0) as frames:
        serve(sys.stdin.buffer, frames)
