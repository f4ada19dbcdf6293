"""A soak: one trial for long, with memory, queues, lag and ledgers looked at every ten seconds."""

import tempfile
import threading
import time
from pathlib import Path
from typing import Any

from benchmarks.hall import trial
from benchmarks.hall.trial import Running, Setup
from benchmarks.hall.usage import pss_mb, usage_of

LOOK_S = 10.0


def soaked(setup: Setup, minutes: float) -> dict[str, Any]:
    """Run the trial for so many minutes, print and return its figures with the looks."""
    setup = Setup(**{name: getattr(setup, name) for name in setup.__slots__} | {"seconds": 60.0 * minutes})
    looks: list[dict[str, Any]] = []
    with tempfile.TemporaryDirectory(prefix="cnctwin-soak-") as folder, trial.started(setup, Path(folder)) as running:
        trial.bear(running)
        is_live = trial.await_live(running)
        time.sleep(setup.settle_s)
        stop = threading.Event()
        watcher = threading.Thread(target=_look, args=(running, stop, looks), daemon=True)
        watcher.start()
        result = trial.measured(running)
        stop.set()
        watcher.join()
        store = Path(folder) / "store"
        result["store_mb"] = round(sum(file.stat().st_size for file in store.rglob("*") if file.is_file()) / 1e6, 1)
    later = looks[len(looks) // 3 :]
    result |= {
        "all_live": is_live,
        "missing": sum(abs(node.get("missing", 0)) for node in result["nodes"].values()),
        "looks": looks,
        "slope_mb_an_hour": slope([(look["at_s"] / 3600.0, look["pss_mb"]) for look in later]),
        "queue_depth_max": max((look["queue_depth"] for look in looks), default=None),
        "store_waiting_max": max((look["store_waiting"] for look in looks), default=None),
        "lag_s_max": max((look["lag_s"] for look in looks), default=None),
        "threads_max": max((look["threads"] for look in looks), default=None),
    }
    _tell(result)
    return result


def _look(running: Running, stop: threading.Event, looks: list[dict[str, Any]]) -> None:
    """Look every ten seconds until told to stop. The reader is asked at its own health only, by the trial's thread no sooner."""
    began_s = time.monotonic()
    while not stop.wait(LOOK_S):
        pids = [one.pid for one in running.processors if one.pid is not None]
        use = [usage_of(pid) for pid in pids]
        told = trial.health(running.seen()).values()
        looks.append(
            {
                "at_s": round(time.monotonic() - began_s, 1),
                "pss_mb": round(sum(pss_mb(pid) for pid in pids), 1),
                "rss_mb": round(sum(one.rss_mb for one in use), 1),
                "cpu_s": round(sum(one.cpu_s for one in use), 2),
                "threads": sum(one.threads for one in use),
                "switches": sum(one.switches for one in use),
                "queue_depth": max((node.get("queue_depth", 0) for node in told), default=0),
                "lag_s": max((node.get("lag_s", 0.0) for node in told), default=0.0),
                "store_waiting": max((node.get("store_waiting", 0) for node in told), default=0),
                "missing": sum(abs(node.get("missing", 0)) for node in told),
                "dropped": sum(node.get("dropped", 0) for node in told),
            }
        )


def slope(points: list[tuple[float, float]]) -> float | None:
    """Return the slope of the line through the points by least squares; None where there are too few.

    >>> slope([(0.0, 1.0), (1.0, 3.0), (2.0, 5.0)])
    2.0
    """
    if len(points) < 3:
        return None
    mean_x, mean_y = (sum(point[axis] for point in points) / len(points) for axis in (0, 1))
    across = sum((x - mean_x) ** 2 for x, _ in points)
    return round(sum((x - mean_x) * (y - mean_y) for x, y in points) / across, 1) if across else None


def _tell(result: dict[str, Any]) -> None:
    age, used = result["age_ms"] or {}, result["used"]
    own = used["processors"]
    print(
        f"{result['machines']} machines at {result['hz']:g} Hz for {result['seconds'] / 60:.1f} min: "
        f"processors {own['cores']:.2f} of a "
        f"core ({own['us_a_message']} us a message), broker {used['broker']['cores']:.2f}, load {used['load']['cores']:.2f}\n"
        f"age at the reader: median {age.get('p50')} ms, 95 % {age.get('p95')} ms, 99 % {age.get('p99')} ms; "
        f"{result['in_time_pct']} % of the values within 1 s\n"
        f"memory {own['pss_mb']:.0f} MB, {result['slope_mb_an_hour']} MB/h; threads {result['threads_max']}, "
        f"{own['switches_a_second']:.0f} voluntary switches a second; store {result['store_mb']:.0f} MB on the disk\n"
        f"queues: {result['queue_depth_max']} messages at most, {result['store_waiting_max']} samples before the store; "
        f"lag {result['lag_s_max']} s at most; ledgers miss {result['missing']}"
        + "".join(f"\nINVALID: {words}" for words in result["complaints"]),
        flush=True,
    )
