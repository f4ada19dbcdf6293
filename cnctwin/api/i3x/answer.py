"""The answer to a request that a limit of this server may have cut short: then 206, with what was left out.

It compresses itself, since the middleware takes every 206 for a piece of a file, and leaves it alone.
"""

import gzip
import json

from fastapi import Request
from fastapi.responses import JSONResponse, Response

from cnctwin.api.i3x.problem import Json, detail


def answer(request: Request, body: Json, left_out: str | None = None, title: str | None = None) -> Response:
    """Return the body with 200; where something was left out, with 206 and the sentence that says what."""
    if left_out is None:
        return JSONResponse(body)
    said = json.dumps({**body, "responseDetail": detail(206, left_out, title)}, separators=(",", ":"), allow_nan=False).encode()
    if "gzip" not in request.headers.get("accept-encoding", ""):
        return Response(said, 206, media_type="application/json")
    return Response(gzip.compress(said), 206, {"Content-Encoding": "gzip", "Vary": "Accept-Encoding"}, "application/json")
