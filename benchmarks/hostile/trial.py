"""Hostile senders against the demo: do other machines' values, alerts and the page go on?

    .venv/bin/python -m benchmarks.hostile.trial                     # all attacks, one after the other
    .venv/bin/python -m benchmarks.hostile.trial --attack flood --seconds 60

The whole demo runs, each part a process of its own. During each attack a machine of its own (the witness) says a value five times
a second and is overloaded once. The bounds: each value and the alert within 5 s, no value missing, the page answers within 5 s,
no process above 512 MB, none started again. The simulated machine is left out of the memory: it stands in for a control, and no
attack reaches it.
"""

import argparse
import json
import sys
import threading
import time
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from pathlib import Path
from tempfile import TemporaryDirectory

import httpx

from benchmarks.hostile.attacks import ATTACKS, Attack, Target
from benchmarks.hostile.witness import DWELL_S, Witness
from cnctwin.demo.parts import Demo, DemoOptions
from sparkplug.broker import BrokerAddress

LATE_S_MAX, MEMORY_MB_MAX = 5.0, 512.0
ALERT_S_MAX = 60.0  # for which an alert is waited for
LOOK_S = 0.5
CONTROL = (
    "agent"  # the simulated machine, which stands in for a control: it needs up to 550 MB where its kernels are compiled again
)


@dataclass(frozen=True, slots=True)
class Result:
    """The figures of one attack. None: it never came."""

    attack: str
    value_s: float | None
    missing: int
    alert_s: float | None
    page_s: float | None
    page_failures: int
    memory_mb: dict[str, float]
    restarts: dict[str, int]

    @property
    def holds(self) -> bool:
        """True if it is within all bounds."""
        times = (self.value_s, self.alert_s, self.page_s)
        in_time = all(one is not None and one <= LATE_S_MAX for one in times)
        quiet = not self.missing and not self.restarts and not self.page_failures
        return in_time and quiet and max(self.memory_mb.values()) <= MEMORY_MB_MAX


class Looker(threading.Thread):
    """Asks the page for its machines twice a second, and the kernel for the memory of each part."""

    def __init__(self, demo: Demo) -> None:
        super().__init__(daemon=True)
        self.demo, self.stop = demo, threading.Event()
        self.slowest_s, self.failures = 0.0, 0
        self.memory: dict[str, float] = {}

    def run(self) -> None:
        """Look until `stop` is set."""
        while not self.stop.wait(LOOK_S):
            began_s = time.monotonic()
            try:
                httpx.get(f"{self.demo.page_url.rstrip('/')}/machines", timeout=30.0).raise_for_status()
            except httpx.HTTPError:
                self.failures += 1
            self.slowest_s = max(self.slowest_s, time.monotonic() - began_s)
            for child in [self.demo.broker.child, *self.demo.children]:
                if child.pid is not None and child.name != CONTROL:
                    self.memory[child.name] = max(self.memory.get(child.name, 0.0), resident_mb(child.pid))


def resident_mb(pid: int) -> float:
    """Return the memory of a process that is resident; 0 where there is none."""
    try:
        lines = Path(f"/proc/{pid}/status").read_text().splitlines()
    except OSError:
        return 0.0
    return next((int(line.split()[1]) / 1000 for line in lines if line.startswith("VmRSS:")), 0.0)


def attempt(demo: Demo, name: str, attack: Attack | None, seconds: float) -> Result:
    """Run one attack, or none, beside a witness."""
    witness = Witness(BrokerAddress("127.0.0.1", demo.broker.port), f"witness-{name.replace('_', '-')}")
    witness.start()
    _while(demo, 3.0)
    before = demo.restarts()
    stop = threading.Event()
    target = Target(demo.broker.port, demo.page_url)
    sender = threading.Thread(target=attack, args=(target, stop), daemon=True) if attack is not None else None
    looker = Looker(demo)
    looker.start()
    if sender is not None:
        sender.start()
    _while(demo, seconds / 2)
    witness.overload()
    _while(demo, max(seconds / 2, DWELL_S + LATE_S_MAX))
    until_s = time.monotonic() + ALERT_S_MAX
    while witness.alarmed_s is None and time.monotonic() < until_s:
        _while(demo, 0.5)
    stop.set()
    if sender is not None:
        sender.join(10.0)
    looker.stop.set()
    looker.join()
    witness.stop()
    return Result(
        attack=name,
        value_s=max(witness.ages, default=None),
        missing=witness.missing,
        alert_s=witness.alert_s,
        page_s=looker.slowest_s,
        page_failures=looker.failures,
        memory_mb=looker.memory,
        restarts={part: count - before.get(part, 0) for part, count in demo.restarts().items() if count > before.get(part, 0)},
    )


def _while(demo: Demo, seconds: float) -> None:
    """Let time pass; what dies is started again, as in the demo."""
    until_s = time.monotonic() + seconds
    while time.monotonic() < until_s:
        demo.watch()
        time.sleep(0.1)


def told(result: Result) -> str:
    """Return a row of the table."""
    name, mb = max(result.memory_mb.items(), key=lambda item: item[1])
    restarts = ", ".join(f"{part} {count}" for part, count in result.restarts.items()) or "none"
    cells = [
        result.attack,
        _s(result.value_s),
        str(result.missing),
        _s(result.alert_s),
        _s(result.page_s) + (f", {result.page_failures} refused" if result.page_failures else ""),
        f"{mb:.0f} MB ({name})",
        restarts,
        "yes" if result.holds else "**no**",
    ]
    return "| " + " | ".join(cells) + " |"


def _s(seconds: float | None) -> str:
    return "never" if seconds is None else f"{seconds:.1f} s"


def run(chosen: Mapping[str, Attack | None], seconds: float) -> list[Result]:
    """Run the attacks one after the other against one demo, and print a row for each."""
    results = []
    with TemporaryDirectory(prefix="cnctwin-hostile-") as folder:
        demo = Demo(DemoOptions(no_open=True), Path(folder))
        try:
            demo.broker.start()
            demo.start()
            _while(demo, 10.0)
            print("| attack | oldest value | missing | alert after | page, slowest | largest process | started again | holds |")
            print("|---|---|---|---|---|---|---|---|", flush=True)
            for name, attack in chosen.items():
                results.append(attempt(demo, name, attack, seconds))
                print(told(results[-1]), flush=True)
        finally:
            demo.stop()
    return results


def main() -> int:
    """Run what was chosen; the exit code is 1 where a bound is broken."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--attack", choices=("none", *ATTACKS), action="append", help="again for more; else all, after none")
    parser.add_argument("--seconds", type=float, default=20.0, help="of each attack")
    parser.add_argument("--json", type=Path, help="where the figures go")
    given = parser.parse_args()
    attacks: dict[str, Attack | None] = {"none": None, **ATTACKS}
    results = run({name: attacks[name] for name in given.attack or attacks}, given.seconds)
    if given.json:
        given.json.write_text(json.dumps([asdict(one) for one in results], indent=1) + "\n")
    return 0 if all(one.holds for one in results) else 1


if __name__ == "__main__":
    sys.exit(main())
