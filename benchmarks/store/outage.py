"""A store on a server that is away for an hour: what waits, what that costs, and whether everything is there afterwards, once.

    .venv/bin/python benchmarks/store/outage.py [--server victoria|influxd] [--hours 1] [--machines 4]

The hour is one by volume: each machine tells 20 signals ten times a second, as fast as the store takes them, while the server is
cut off. Then it comes back, and is killed with -9 and started again in the middle of the draining. At the end each sample is
counted on the server, a tenth of them is compared value by value, and the server's folder is measured.
"""

import argparse
import resource
import sys
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path
from random import Random

import httpx

from cnctwin.memory.store.contract import Message, Query
from cnctwin.memory.store.influx.opening import open_influx
from cnctwin.memory.store.influx.store import ServerStore
from sparkplug.host_session import EventKind, HostEvent
from sparkplug.metric import NodeId, Reading
from sparkplug.quality import Quality
from tests.cnctwin.memory.store.influx.gate import Gate
from tests.cnctwin.memory.store.influx.servers import Influxd, ServerProcess, VictoriaMetrics

SIGNALS, EVERY_MS = 20, 100
NODE = NodeId("cnc", "hall")


class DeduplicatingVictoria(VictoriaMetrics):
    """Start the server as docs/how-to/influx.md describes."""

    deduplicates = True


def value(machine: int, signal: int, n: int) -> float:
    """A quantised signal that can be worked out again: a slow wave with some noise in its last digit."""
    noise = (n * 2654435761 + signal * 40503 + machine * 9176) % 7
    return ((n * (signal + 3)) % 4000 + noise) / 100


def seconds(machines: int, count_s: int, t0_ms: int) -> Iterator[list[Message]]:
    """The messages of one second after the other."""
    for second in range(count_s):
        messages = []
        for n in range(second * 10, second * 10 + 10):
            t_ms = t0_ms + n * EVERY_MS
            for m in range(machines):
                readings = tuple(
                    Reading(f"axis_{s}_load_pct", value(m, s, n), t_ms, Quality.GOOD, "%", None, False) for s in range(SIGNALS)
                )
                messages.append(Message(t_ms, HostEvent(EventKind.DATA, NODE, f"vmc-{m}", t_ms, readings)))
        yield messages


def rss_mb() -> float:
    """Memory of this process now."""
    pages = int(Path("/proc/self/statm").read_text().split()[1])
    return pages * resource.getpagesize() / 1e6


def counted(server: ServerProcess) -> int:
    """Samples that the server itself counts."""
    base = f"http://127.0.0.1:{server.port}"
    if isinstance(server, VictoriaMetrics):
        asked = {"query": "sum(count_over_time(cnc_raw_value[1d]))", "time": str(time.time() + 60), "nocache": "1"}
        return int(httpx.get(f"{base}/api/v1/query", params=asked, timeout=60).json()["data"]["result"][0]["value"][1])
    asked = {"db": "cnc_raw", "q": "SELECT count(value) FROM cnc_raw"}
    return int(httpx.get(f"{base}/query", params=asked, timeout=60).json()["results"][0]["series"][0]["values"][0][1])


def folder_bytes(folder: Path) -> int:
    """Bytes on the disk, in whole blocks as du counts them."""
    return sum(path.stat().st_blocks * 512 for path in folder.rglob("*") if path.is_file())


def differing(store: ServerStore, machines: int, count_s: int, t0_ms: int) -> tuple[int, int]:
    """Return, for a tenth of the time: samples that were compared, and those that are wrong, missing or there twice."""
    compared = wrong = 0
    span_s = max(count_s // 30, 1)
    for begin_s in (0, count_s // 2, count_s - span_s):
        begin_ms = t0_ms + begin_s * 1000
        for m in range(machines):
            signals = tuple(f"axis_{s}_load_pct" for s in range(SIGNALS))
            for s, column in enumerate(store.query(Query(f"vmc-{m}", signals, begin_ms, begin_ms + span_s * 1000))):
                expected = [(n, value(m, s, n)) for n in range(begin_s * 10, (begin_s + span_s) * 10)]
                pairs = zip(column.t_us, column.value, strict=True)
                found = [((t // 1000 - t0_ms) // EVERY_MS, round(float(v), 6)) for t, v in pairs if isinstance(v, float)]
                compared += len(expected)
                wrong += len(set(expected) ^ set(found)) + len(found) - len(set(found))
    return compared, wrong


def queries(store: ServerStore, count_s: int, t0_ms: int) -> str:
    """Return how long three usual questions take, the median of nine."""
    three = tuple(f"axis_{s}_load_pct" for s in range(3))
    end_ms = t0_ms + count_s * 1000
    questions = {
        "last five minutes of 3 signals at 1 s": Query("vmc-0", three, end_ms - 300_000, end_ms, 1000),
        "all of 3 signals at 1 min": Query("vmc-0", three, t0_ms, end_ms, 60_000),
        "all of one signal raw": Query("vmc-0", three[:1], t0_ms, end_ms),
    }
    told = []
    for name, question in questions.items():
        times_ms = []
        for _ in range(9):
            begun_s = time.perf_counter()
            store.query(question)
            times_ms.append((time.perf_counter() - begun_s) * 1e3)
        told.append(f"{name} {sorted(times_ms)[4]:.0f} ms")
    return ", ".join(told)


def run(kind: type[ServerProcess], machines: int, count_s: int, folder: Path) -> int:
    """One outage; the exit code."""
    server, samples = kind(folder / "server"), machines * SIGNALS * 10 * count_s
    server.start()
    t0_ms = (int(time.time()) - count_s - 3600) * 1000
    with Gate(server.port) as gate:
        store = open_influx(server.url(gate.port), writable=True, spool=folder / "ring")
        assert isinstance(store, ServerStore)
        base_mb, slowest_s, chance = rss_mb(), 0.0, Random(1)
        gate.shut()
        begun_s, cpu_s = time.monotonic(), time.process_time()
        for second, messages in enumerate(seconds(machines, count_s, t0_ms)):
            before_s = time.monotonic()
            store.append(messages)
            slowest_s = max(slowest_s, time.monotonic() - before_s)
            if second % 60 == 0:
                store.tidy(int(time.time() * 1000))
        took_s, cpu_s = time.monotonic() - begun_s, time.process_time() - cpu_s
        waiting, ring = store.status().waiting, store.status().bytes
        print(f"{samples:,} samples ({machines} machines, {count_s} s) while {server.name} was cut off")
        print(
            f"  appended in {took_s:.0f} s, {cpu_s / samples * 1e6:.1f} us of CPU each, slowest second {slowest_s * 1e3:.0f} ms"
        )
        disk_mb = folder_bytes(folder / "ring") / 1e6
        print(
            f"  waiting {waiting:,}; batches {ring / 1e6:.1f} MB, {ring / samples:.2f} B each; the ring's folder {disk_mb:.1f} MB"
        )
        print(f"  memory {base_mb:.0f} MB -> {rss_mb():.0f} MB")
        begun_s, cpu_s, peak_mb, kills = time.monotonic(), time.process_time(), 0.0, 0
        gate.open()
        kill_at = waiting * chance.uniform(0.4, 0.6)
        while store.account()["held"]:
            peak_mb = max(peak_mb, rss_mb())
            if not kills and store.status().waiting < kill_at:
                server.kill()
                kills += 1
                time.sleep(1.0)
                server.start()
            time.sleep(0.05)
        took_s, cpu_s = time.monotonic() - begun_s, time.process_time() - cpu_s
        print(f"  drained in {took_s:.0f} s with {kills} kill -9 of the server, {cpu_s / samples * 1e6:.1f} us of CPU a sample")
        print(f"  memory while draining at most {peak_mb:.0f} MB")
        account = store.account()
        if isinstance(server, VictoriaMetrics):
            server.flush()
        there = counted(server)
        compared, wrong = differing(store, machines, count_s, t0_ms)
        print(f"  {queries(store, count_s, t0_ms)}")
        store.close()
        server.stop()
        size = folder_bytes(folder / "server")
        print(f"  on the server {there:,} samples, {size / 1e6:.1f} MB, {size / samples:.2f} B a sample with its quality")
        print(f"  compared {compared:,}: {wrong} wrong; account {account}")
        passed = there == samples == account["sent"] and not wrong and waiting == samples
        print("  every sample is there, once" if passed else "  NOT every sample is there once")
    return 0 if passed else 1


def main() -> int:
    """Parse the options and run."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--server", choices=("victoria", "influxd"), default="victoria")
    parser.add_argument("--hours", type=float, default=1.0)
    parser.add_argument("--machines", type=int, default=4)
    options = parser.parse_args()
    kind = DeduplicatingVictoria if options.server == "victoria" else Influxd
    if reason := kind.missing():
        print(reason, file=sys.stderr)
        return 2
    with tempfile.TemporaryDirectory(prefix="store-outage-") as folder:
        return run(kind, options.machines, round(options.hours * 3600), Path(folder))


if __name__ == "__main__":
    raise SystemExit(main())
