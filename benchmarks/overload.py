"""One edge floods, another machine's alarm is timed: all processors of a plant in one process, on a broker of their own.

    .venv/bin/python -m benchmarks.overload                               # 1,000 messages a second with twelve signals, 30 s
    .venv/bin/python -m benchmarks.overload --metrics 100 --rate 1000
    .venv/bin/python -m benchmarks.overload --old PATH                    # an older checkout in turns

The flood is a process of its own and speaks MQTT by itself. The quiet machine (benchmarks/hostile/witness.py) says a number five
times a second; it is overloaded in the middle of the flood, and its alert is timed to where it stands on the broker, less the
dwell of the rule. Bounds: the alert and each value within 5 s, no value missing, memory below 512 MB.
"""

import argparse
import json
import multiprocessing
import sys
import tempfile
import time
from contextlib import suppress
from dataclasses import dataclass
from multiprocessing.synchronize import Event
from pathlib import Path
from typing import Any

from benchmarks.hall.usage import usage_of
from benchmarks.hostile.attacks import HostileNode, Target, number
from benchmarks.hostile.witness import Witness
from cnctwin.processes.child import Child
from cnctwin.processes.private_broker import PrivateBroker
from processors.discovery import discover
from sparkplug.host import HostApplication
from sparkplug.topics import group_filter
from twin.vocabulary.nodes import is_twin_node, twin_node

OWN = Path(__file__).parents[1]
START_S_MAX = 60.0
ALERT_S_MAX = 60.0
LATE_S_MAX, MEMORY_MB_MAX = 5.0, 512.0
_SPAWN = multiprocessing.get_context("spawn")


@dataclass(frozen=True, slots=True)
class Flood:
    """The load of the hostile edge: so many messages a second, so many signals in each."""

    rate: float
    metrics: int


def flood(port: int, order: Flood, stop: Event, sent: Any) -> None:
    """Send until `stop` is set; runs in a process of its own."""
    node = HostileNode(Target(port, ""))
    names = ("spindle_rpm", "spindle_load_pct", "spindle_temp_c", *(f"signal_{i}" for i in range(3, order.metrics)))
    node.say("DBIRTH", "hostile", [number(name, alias=index + 1) for index, name in enumerate(names)])
    began_s = time.monotonic()
    while not stop.is_set():
        while sent.value < (time.monotonic() - began_s) * order.rate:
            sent.value += 1
            values = [{"alias": index + 1, "double_value": sent.value % 97 + index} for index in range(len(names))]
            node.say("DDATA", "hostile", values)
        time.sleep(0.005)
    node.close()


def processors_of(tree: Path, broker: PrivateBroker, folder: Path) -> Child:
    """Start all processors of a checkout in one process, as a user does."""
    settings = folder / "processors.toml"
    settings.write_text(f"[historian]\nstore = {json.dumps(str(folder / 'store'))}\n")
    own = tree / ".venv" / "bin" / "python"
    python = str(own) if own.exists() else sys.executable
    given = ["--config", str(settings), "--broker", broker.address.url, "--state-dir", str(folder)]
    child = Child(
        "processors",
        ["env", "-C", str(tree), python, "-m", "cnctwin", "process", *discover(), *given],
        folder / "processors.log",
    )
    child.start()
    return child


def await_born(host: HostApplication, child: Child) -> None:
    """Wait until each processor is born on the broker."""
    wanted = {twin_node(name) for name in discover()}
    deadline_s = time.monotonic() + START_S_MAX
    while not wanted <= {node.node for node in host.nodes()}:
        if time.monotonic() > deadline_s:
            raise SystemExit(f"the processors were not born within {START_S_MAX:g} s: {child.last_words()}")
        host.poll(0.1)


def tried(tree: Path, order: Flood, seconds: float) -> dict[str, Any]:
    """Run one trial and return its figures."""
    with tempfile.TemporaryDirectory(prefix="cnctwin-overload-") as name:
        broker = PrivateBroker(Path(name))
        broker.start()
        child = processors_of(tree, broker, Path(name))
        host = HostApplication(
            broker.address,
            "overload-viewer",
            (group_filter("cnc"),),
            publish_state=False,
            wanted=lambda node: is_twin_node(node.node),
        )
        host.start()
        witness = Witness(broker.address, "quiet")
        stop, sent = _SPAWN.Event(), _SPAWN.Value("q", 0)
        sender = _SPAWN.Process(target=flood, args=(broker.address.port, order, stop, sent), daemon=True)
        try:
            await_born(host, child)
            witness.start()
            looked_on(host, child, 3.0)
            sender.start()
            memory_mb = looked_on(host, child, seconds / 2)
            witness.overload()
            until_s = time.monotonic() + ALERT_S_MAX
            memory_mb = max(memory_mb, looked_on(host, child, seconds / 2))
            while witness.alert_s is None and time.monotonic() < until_s:
                memory_mb = max(memory_mb, looked_on(host, child, 0.5))
        finally:
            stop.set()
            with suppress(ValueError, AssertionError):  # it may never have been started
                sender.join(10.0)
            witness.stop()
            looked_on(host, child, 2.0)
            told = counts_of(host)
            host.stop()
            child.stop()
            broker.stop()
        return {
            "sent": sent.value,
            "alert_s": witness.alert_s,
            "value_s": max(witness.ages, default=None),
            "missing": witness.missing,
            "memory_mb": memory_mb,
            **told,
        }


def looked_on(host: HostApplication, child: Child, seconds: float) -> float:
    """Listen for a while; return the most memory that the processors had, in MB."""
    memory_mb, until_s = 0.0, time.monotonic() + seconds
    while time.monotonic() < until_s:
        host.poll(0.2)
        if child.pid is not None:
            memory_mb = max(memory_mb, usage_of(child.pid).rss_mb)
    return memory_mb


def counts_of(host: HostApplication) -> dict[str, Any]:
    """Return what the processors report of it: the mirror's count, the most lag, and restarts of any."""
    found: dict[str, Any] = {"overload": 0, "restarts": 0}
    for node in host.nodes():
        picture = host.picture(node)
        for metric in found if picture is not None else ():
            reading = picture.own.readings.get(f"health/{metric}") if picture is not None else None
            if reading is not None and isinstance(reading.value, int):
                found[metric] = max(found[metric], reading.value)
    return found


def holds(result: dict[str, Any]) -> bool:
    """Return True if a result is within the bounds."""
    times = (result["alert_s"], result["value_s"])
    in_time = all(one is not None and one <= LATE_S_MAX for one in times)
    return in_time and not result["missing"] and not result["restarts"] and result["memory_mb"] <= MEMORY_MB_MAX


def main() -> int:
    """Print a line for each trial; 1 where this checkout is beyond a bound."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--rate", type=float, default=1000.0, help="messages a second of the hostile edge")
    parser.add_argument("--metrics", type=int, default=12, help="signals in each of them")
    parser.add_argument("--seconds", type=float, default=30.0)
    parser.add_argument("--old", type=Path, default=None, help="an older checkout, tried first")
    options = parser.parse_args()
    order = Flood(options.rate, options.metrics)
    print("tree      sent   alert s  oldest value s  missing  overload  restarts   MB")
    good = True
    for name, tree in [("old", options.old), ("new", OWN)]:
        if tree is None:
            continue
        result = tried(tree, order, options.seconds)
        shown = {key: "never" if result[key] is None else f"{result[key]:.1f}" for key in ("alert_s", "value_s")}
        times = f"{shown['alert_s']:>9} {shown['value_s']:>15}"
        counts = f"{result['missing']:8d} {result['overload']:9d} {result['restarts']:9d} {result['memory_mb']:4.0f}"
        print(f"{name:5} {result['sent']:8d} {times} {counts}{'' if holds(result) else '  beyond a bound'}", flush=True)
        good = holds(result)
    return 0 if good else 1


if __name__ == "__main__":
    sys.exit(main())
