"""A fleet of machines, a broker, all processors as a user starts them: cost of a message, age of a value, what a core holds.

    .venv/bin/python -m benchmarks.fleet --machines 4,20,50 --seconds 30
    .venv/bin/python -m benchmarks.fleet --machines 10,50 --old PATH --json figures.json   # an older checkout in turns
    .venv/bin/python -m benchmarks.fleet --machines 200 --processors thermal,mirror
    .venv/bin/python -m benchmarks.fleet --machines 200 --stages                           # where the time goes, by py-spy
    .venv/bin/python -m benchmarks.fleet --machines 300 --soak 30
    .venv/bin/python -m benchmarks.fleet --machines 1000 --storm
    .venv/bin/python -m benchmarks.fleet --machines 1000 --idle
    .venv/bin/python -m benchmarks.fleet --machines 10 --one-against-twelve

A machine is an edge node with a TCP connection, a will, births of 14 metrics with unit, range and meaning, and data messages by
alias in which 11 values change (benchmarks/hall/machine.py). It changes its tool and stands still now and then; every 15 s one of
all loses its connection for 3 s. CPU time is what the kernel counts for the whole process, threads too, divided by the messages
that the machines sent. Age is the wall's clock at a reader of the plain mirror less the stamp of the value. A run whose load was
late is marked invalid. The figures are of one computer: compare those of one run.
"""

import argparse
import json
import os
import sys
import tempfile
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from benchmarks.hall import holds, soak, stages, storm, trial
from benchmarks.hall.trial import OWN, Setup
from processors.discovery import discover

ALL = "all"


def names_of(given: str) -> tuple[tuple[str, ...], ...]:
    """Return the processors of each process: `all`, or names with commas; a plus between processes, as `a,b+c`."""
    if given == ALL:
        return (tuple(discover()),)
    return tuple(tuple(part.split(",")) for part in given.split("+"))


def tried(setup: Setup, *, with_stages: bool = False, spy: str = "") -> dict[str, Any]:
    """Run one trial and return its figures."""
    with tempfile.TemporaryDirectory(prefix="cnctwin-fleet-") as folder, trial.started(setup, Path(folder)) as running:
        trial.bear(running)
        is_live = trial.await_live(running)
        time.sleep(setup.settle_s)
        result = trial.measured(running)
        result["all_live"] = is_live
        if with_stages:
            result["stages"] = stages.profiled(running, Path(folder), result["used"]["processors"], spy)
    return result


def line(name: str, result: dict[str, Any]) -> str:
    """Return a trial as a line of the table."""
    used, age = result["used"], result["age_ms"]
    own, broker, load = used["processors"], used["broker"], used["load"]
    ages = " ".join(f"{age[q]:8.0f}" for q in ("p50", "p95", "p99")) if age else "       –        –        –"
    in_time = "–" if result["in_time_pct"] is None else f"{result['in_time_pct']:.1f}"
    invalid = "".join(f"  INVALID: {words}" for words in result["complaints"])
    each = [f"{part['us_a_message'] or 0:8.0f}" for part in (own, broker, load)]
    if not holds.has_kept_up(result) and own["us_a_folded"]:
        each[0] = f"{own['us_a_folded']:7.0f}*"
    return (
        f"{name:{NAME}.{NAME}} {result['machines']:5d} {each[0]} {own['cores']:6.2f} {each[1]} {broker['cores']:6.2f} {each[2]} "
        f"{ages} "
        f"{in_time:>6} {own['pss_mb']:6.0f} {own['threads']:4d} {own['switches_a_message'] or 0:8.2f} "
        f"{result['elsewhere_cores']:5.2f}{invalid}"
    )


NAME = 8
HEAD = (
    "               processors            broker      load   age at the reader, ms      in 1 s     MB       switches else-\n"
    "tree     mach. us/message  cores us/mess.  cores us/mess.   median     95 %     99 %      %    PSS thr. /message where"
)


def trees(old: Path | None) -> list[tuple[str, Path]]:
    """Return what is tried: this checkout, and beside it an older one."""
    found = [("new", OWN)]
    if old is not None:
        if not (old / "cnctwin" / "__main__.py").is_file():
            raise SystemExit(f"--old {old}: there is no checkout of cnctwin; give its folder")
        found.append(("old", old.resolve()))
    return found


def many(options: argparse.Namespace) -> list[dict[str, Any]]:
    """Try each number of machines on each tree in turns, and say what a core holds."""
    results = []
    print(HEAD, flush=True)
    for _ in range(options.rounds):
        for machines in numbers(options.machines):
            for name, tree in trees(options.old):
                setup = setup_of(options, tree, machines)
                result = {"tree": name} | tried(setup, with_stages=options.stages, spy=options.py_spy)
                results.append(result)
                print(line(name, result), flush=True)
                for stage, share in result.get("stages", {}).items():
                    print(f"        {stage:28} {share['pct']:5.1f} %  {share['us_a_message']:7.1f} us", flush=True)
                written(options, results)
    if not all(holds.has_kept_up(result) for result in results) and not options.idle:
        print("*: does not keep up; us of each message that it has dealt with")
    for result in results if options.idle else ():
        machine_us = result["used"]["processors"]["cores"] / result["machines"] * 1e6
        print(f"{result['tree']}: {result['machines']} idle machines, {machine_us:.0f} us of CPU time a machine and second")
    for name, _ in () if options.idle else trees(options.old):
        print(f"{name}: {holds.told([result for result in results if result['tree'] == name])}")
    return results


def one_against_all(options: argparse.Namespace) -> list[dict[str, Any]]:
    """Try one processor, then all, with the same machines, on each tree."""
    results = []
    print(HEAD, flush=True)
    for name, tree in trees(options.old):
        spent = []
        for given in (options.one, ALL):
            options.processors = given
            result = {"tree": name} | tried(setup_of(options, tree, numbers(options.machines)[0]))
            print(line(name, result), flush=True)
            results.append(result)
            spent.append(result["used"]["processors"]["us_a_message"])
        print(
            f"{name}: all {len(names_of(ALL)[0])} processors cost {spent[1] / spent[0]:.2f} times what {options.one} alone costs"
        )
    return results


def each(options: argparse.Namespace) -> list[dict[str, Any]]:
    """Try every processor alone, then all together, and print the figures that `cnctwin plan fleet` rests on."""
    results, spent = [], dict[str, float]()
    print(HEAD, flush=True)
    for given in (*discover(), ALL):
        options.processors = given
        result = {"tree": "new"} | tried(setup_of(options, OWN, numbers(options.machines)[0]))
        print(line(given, result), flush=True)
        results.append(result)
        spent[given] = result["used"]["processors"]["us_a_message"]
    together = spent.pop(ALL)
    # Alone, each pays what is shared; together it is paid once.
    shared = min(max(0.0, (sum(spent.values()) - together) / (len(spent) - 1)), *spent.values())
    print(f"shared_us={shared:.1f}\neach_us={ {name: round(us - shared, 1) for name, us in spent.items()} }")
    print(f"sum {shared + sum(us - shared for us in spent.values()):.0f} us, together {together:.0f} us")
    return results


def setup_of(options: argparse.Namespace, tree: Path, machines: int) -> Setup:
    """Return a trial as the options ask for it."""
    return Setup(
        tree,
        names_of(options.processors),
        machines,
        options.hz,
        options.seconds,
        options.settle,
        outage_every_s=options.outage_every,
        is_idle=options.idle,
        everyone=options.storm,
        is_preferred=options.prefer,
        config="" if options.config is None else options.config.read_text(),
    )


def numbers(given: str) -> list[int]:
    """Return the numbers of machines."""
    try:
        found = [int(number) for number in given.split(",")]
    except ValueError:
        found = []
    if not found or min(found) < 1:
        raise SystemExit(f"--machines {given}: write numbers from 1 on with commas, as 4,20,50")
    return found


def kind_of(options: argparse.Namespace) -> str:
    """Return the kind of trials that is asked for."""
    kinds = ("storm", "idle", "each", "one_against_twelve")
    return "soak" if options.soak is not None else next((kind for kind in kinds if getattr(options, kind)), "many")


def written(options: argparse.Namespace, results: Sequence[dict[str, Any]]) -> None:
    """Write the figures, with when and on what they were measured."""
    file: Path | None = options.json
    if file is not None:
        model = [
            line.partition(":")[2].strip() for line in Path("/proc/cpuinfo").read_text().splitlines() if "model name" in line
        ]
        about = {
            "kind": kind_of(options),
            "measured": time.strftime("%Y-%m-%d", time.gmtime()),
            "command": _command(),
            "cpu": model[0] if model else "",
            "cores": os.cpu_count(),
        }
        file.write_text(json.dumps(about | {"trials": results}, indent=1) + "\n")


def _command() -> str:
    """Return the command without what names places of this computer."""
    words = list(sys.argv[1:])
    for option in ("--json", "--py-spy"):
        while option in words:
            at = words.index(option)
            del words[at : at + 2]
    if "--old" in words:
        words[words.index("--old") + 1] = "OLDER_CHECKOUT"
    return " ".join(("python -m benchmarks.fleet", *words))


def options_of(given: Sequence[str] | None = None) -> argparse.Namespace:
    """Return what is asked for."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--machines", default="4,20,50", help="numbers of machines, each a trial")
    parser.add_argument("--hz", type=float, default=10.0, help="messages a second of each machine")
    parser.add_argument("--seconds", type=float, default=60.0, help="that are measured, of each trial")
    parser.add_argument("--settle", type=float, default=10.0, help="seconds before, once all machines are live")
    parser.add_argument("--rounds", type=int, default=1, help="the trials are repeated so often")
    parser.add_argument("--processors", default=ALL, help="all, or names: a,b in one process, a,b+c in two")
    parser.add_argument("--config", type=Path, help="TOML for the processors; the historian's table is added")
    parser.add_argument("--old", type=Path, help="folder of an older checkout, tried in turns under the same load")
    parser.add_argument("--outage-every", type=float, default=15.0, help="seconds between two lost connections; 0: none")
    parser.add_argument("--prefer", action="store_true", help="give broker and processors precedence on a busy computer (root)")
    parser.add_argument("--json", type=Path, help="write all figures to this file")
    parser.add_argument(
        "--stages", action="store_true", help="where the time goes, by py-spy (pip install py-spy), after each trial"
    )
    parser.add_argument("--py-spy", default="", help="the program, if it is not on the path")
    what = parser.add_mutually_exclusive_group()
    what.add_argument(
        "--soak", type=float, metavar="MINUTES", help="one trial so long, with memory, queues and ledgers over time"
    )
    what.add_argument("--storm", action="store_true", help="all machines are born at once: seconds until all are live")
    what.add_argument("--idle", action="store_true", help="machines that say nothing but their births")
    what.add_argument("--each", action="store_true", help="every processor alone, then all: the figures of `cnctwin plan fleet`")
    what.add_argument("--one-against-twelve", action="store_true", help="one processor, then all, with the same machines")
    parser.add_argument("--one", default="thermal", help="that one")
    return parser.parse_args(given)


def main() -> None:
    """Measure and print; exit 1 where the load was late or a ledger does not balance."""
    options = options_of()
    if options.soak is not None:
        results = [
            soak.soaked(setup_of(options, tree, numbers(options.machines)[0]), options.soak) | {"tree": name}
            for name, tree in trees(options.old)
        ]
    elif options.storm:
        results = [
            {"tree": name} | storm.weathered(setup_of(options, tree, machines))
            for machines in numbers(options.machines)
            for name, tree in trees(options.old)
        ]
    elif options.each:
        results = each(options)
    elif options.one_against_twelve:
        results = one_against_all(options)
    else:
        results = many(options)
    written(options, results)
    missing = {node: told["missing"] for result in results for node, told in result["nodes"].items() if told.get("missing")}
    if missing:
        print(f"ledgers that do not balance, and by how much: {missing}")
    raise SystemExit(1 if missing or any(result["complaints"] for result in results) else 0)


if __name__ == "__main__":
    main()
