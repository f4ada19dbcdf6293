"""A storm: all machines are born at once. How long until all are in the mirror, and until each processor has told of each."""

import tempfile
import time
from pathlib import Path
from typing import Any

from benchmarks.hall import trial
from benchmarks.hall.trial import Setup

WAIT_S_MAX = 180.0
QUIET_S = 3.0


def weathered(setup: Setup) -> dict[str, Any]:
    """Have the machines born, wait until nothing new comes, print and return the figures."""
    with tempfile.TemporaryDirectory(prefix="cnctwin-storm-") as folder, trial.started(setup, Path(folder)) as running:
        before = running.used()
        trial.bear(running)
        began_s = time.monotonic()
        count, since_s = 0, began_s
        while time.monotonic() - began_s < WAIT_S_MAX:
            time.sleep(0.5)
            seen = running.seen()
            now = len(seen.live) + sum(map(len, seen.twins.values()))
            if now != count:
                count, since_s = now, time.monotonic()
            full = len(seen.live) == setup.machines and all(len(one) == setup.machines for one in seen.twins.values())
            if full and time.monotonic() - since_s > QUIET_S:
                break
        tallies, births_s = running.tallies()
        after, seen = running.used(), running.seen()
        live = sorted(seen.live.values())
        last = {node: round(max(born.values()) - births_s, 2) for node, born in seen.twins.items()}
        result: dict[str, Any] = {
            "machines": setup.machines,
            "hz": setup.hz,
            "live": len(live),
            "live_s": round(live[-1] - births_s, 2) if live else None,
            "half_live_s": round(live[len(live) // 2] - births_s, 2) if live else None,
            "twin_nodes": {node: len(born) for node, born in sorted(seen.twins.items())},
            "twins_s": max(last.values(), default=None),
            "cpu_s": {name: round(after[name].cpu_s - before[name].cpu_s, 2) for name in after},
            "rss_mb": round(after["processors"].rss_mb, 1),
            "rebirths": sum(tally.rebirths for tally in tallies),
            "nodes": trial.health(seen),
            "complaints": [],
        }
        complete = len(live) == setup.machines and all(len(born) == setup.machines for born in seen.twins.values())
    result["complaints"] = [] if complete else [f"not all are live after {WAIT_S_MAX:.0f} s"]
    complaint = "".join(f"; {words}: {result['twin_nodes']}" for words in result["complaints"])
    print(
        f"{setup.machines} machines born at once: {len(live)} in the mirror after {result['live_s']} s (half of them after "
        f"{result['half_live_s']} s), all twins born after {result['twins_s']} s; "
        f"processors {result['cpu_s']['processors']} s of CPU time, {result['rss_mb']:.0f} MB{complaint}",
        flush=True,
    )
    return result
