"""`cnctwin replay` as a process of its own: it may take a minute of a core, and is not to hold up the page meanwhile."""

import asyncio
import json
import sys
from pathlib import Path
from typing import Any

from cnctwin.api.errors import ApiError

SECONDS_MAX = 120.0
STDOUT_MAX = 16_000_000


async def replayed(store: str, machine: str, from_ms: int, to_ms: int, config: Path | None) -> dict[str, Any]:
    """Return what the processors give now, beside what they published then. Raises ApiError."""
    options = [f"--machine={machine}", f"--from={from_ms}", f"--to={to_ms}", f"--store={store}", "--json"]
    options += [] if config is None else [f"--config={config}"]
    child = await asyncio.create_subprocess_exec(
        *(sys.executable, "-m", "cnctwin", "replay", *options),
        stdin=asyncio.subprocess.DEVNULL,
        stdout=asyncio.subprocess.PIPE,
        stderr=asyncio.subprocess.PIPE,
        limit=STDOUT_MAX,
    )
    try:
        out, err = await asyncio.wait_for(child.communicate(), SECONDS_MAX)
    except TimeoutError:
        raise ApiError(503, f"the replay took more than {SECONDS_MAX:g} s and was ended; ask for a shorter stretch") from None
    finally:
        if child.returncode is None:
            child.kill()
            await child.wait()
    if child.returncode not in (0, 1):
        lines = err.decode(errors="replace").strip().splitlines() or [f"the replay ended with {child.returncode}"]
        raise ApiError(503, lines[-1].removeprefix("cnctwin: "))
    try:
        told = json.loads(out)
    except ValueError:
        raise ApiError(503, "the replay gave no answer that can be read") from None
    return dict(told)
