"""docs/explanation/fleet.md: the tables and curves of what was measured, filled in between its markers.

    .venv/bin/python -m benchmarks.fleet --machines 4,20,50,100 --json many.json
    .venv/bin/python -m benchmarks.hall.page --add many.json           # into docs/figures/fleet.json, then page and curves again
    .venv/bin/python -m benchmarks.hall.page                           # page and curves again

What is added replaces what there was of the same kind and tree. `--tree old` says that all trials of a file are of the older one.
"""

import argparse
import json
import re
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

from benchmarks.hall import curves, holds
from benchmarks.hall.trial import OWN

FIGURES = OWN / "docs" / "figures" / "fleet.json"
PAGE = OWN / "docs" / "explanation" / "fleet.md"
TREES = {"old": "before", "new": "now"}
_BULKY = ("nodes", "looks")
Trials = Sequence[dict[str, Any]]


def added(figures: dict[str, Any], file: Path, tree: str | None) -> dict[str, Any]:
    """Return the figures with those of a file of the benchmark, in place of what there was of that kind and tree."""
    given = json.loads(file.read_text())
    about = {key: given[key] for key in ("measured", "command", "cpu", "cores")}
    trials = [about | {name: value for name, value in trial.items() if name not in _BULKY} for trial in given["trials"]]
    for trial in trials:
        trial["tree"] = tree or trial["tree"]
    replaced = {trial["tree"] for trial in trials}
    kept = [trial for trial in figures.get(given["kind"], []) if trial["tree"] not in replaced]
    return figures | {given["kind"]: sorted([*kept, *trials], key=lambda trial: (trial["machines"], trial["tree"] != "old"))}


def table(head: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    """Return a table of Markdown."""
    lines = [head, ["---"] * len(head), *rows]
    return "\n".join("| " + " | ".join(cells) + " |" for cells in lines)


def many(trials: Trials) -> str:
    """Return the table of what a message costs, by the number of machines."""
    head = [
        "machines",
        "",
        "µs a message",
        "of a core",
        "broker, µs",
        "age, median",
        "95 %",
        "99 %",
        "within 1 s",
        "memory",
        "switches a message",
    ]
    rows = []
    for trial in trials:
        own, broker, age = trial["used"]["processors"], trial["used"]["broker"], trial["age_ms"]
        kept = trial["in_time_pct"]
        rows.append(
            [
                str(trial["machines"]),
                TREES[trial["tree"]],
                _cost(trial),
                f"{100 * own['cores']:.0f} %",
                f"{broker['us_a_message']:,.0f}",
                *(_ms(age and age[quantile]) for quantile in ("p50", "p95", "p99")),
                "–" if kept is None else f"{kept:.0f} %",
                f"{own['pss_mb']:.0f} MB",
                f"{own['switches_a_message']:.1f}",
            ]
        )
    return table(head, rows)


def stages(trials: Trials) -> str:
    """Return the table of where the time of the processors goes, of the last trial that has stages, in each tree."""
    last = {trial["tree"]: trial for trial in trials if trial.get("stages")}
    named = [tree for tree in TREES if tree in last]
    names = sorted({name for tree in named for name in last[tree]["stages"]}, key=lambda name: -_us(last[named[-1]], name))
    head = ["stage", *(f"{TREES[tree]}, {last[tree]['machines']} machines, µs" for tree in named)]
    return table(head, [[name, *(f"{_us(last[tree], name):.1f}" for tree in named)] for name in names])


def one_against_all(trials: Trials) -> str:
    """Return the table of one processor against all."""
    rows = []
    for tree, word in TREES.items():
        us = {len(t["processors"][0]): t["used"]["processors"]["us_a_message"] for t in trials if t["tree"] == tree}
        if len(us) == 2:
            machines = next(t["machines"] for t in trials if t["tree"] == tree)
            rows.append([word, str(machines), *(f"{us[count]:,.0f}" for count in sorted(us)), f"{max(us.values()) / us[1]:.1f}"])
    return table(["", "machines", "one, µs a message", "twelve, µs", "times"], rows)


def storm(trials: Trials) -> str:
    """Return the table of machines that are born at once."""
    rows = [
        [
            f"{t['machines']}, {t['hz']:g} Hz",
            TREES[t["tree"]],
            f"{t['live']}, after {t['live_s']} s",
            f"{min(t['twin_nodes'].values(), default=0)}, after {t['twins_s']} s",
            f"{t['cpu_s']['processors']:.1f} s",
            f"{t['rss_mb']:.0f} MB",
        ]
        for t in trials
    ]
    return table(["machines", "", "in the mirror", "with all twins born", "CPU time", "memory"], rows)


def idle(trials: Trials) -> str:
    """Return the table of machines that say nothing."""
    rows = [
        [
            str(t["machines"]),
            TREES[t["tree"]],
            f"{100 * t['used']['processors']['cores']:.1f} %",
            f"{t['used']['processors']['cores'] / t['machines'] * 1e6:.0f}",
            f"{t['used']['processors']['pss_mb']:.0f} MB",
        ]
        for t in trials
    ]
    return table(["machines", "", "of a core", "µs a machine and second", "memory"], rows)


def soak(trials: Trials) -> str:
    """Return the table of a long trial."""
    rows = []
    for t in trials:
        age, used = t["age_ms"] or {}, t["used"]
        rows.append(
            [
                f"{t['machines']}, {t['seconds'] / 60:.0f} min",
                TREES[t["tree"]],
                f"{100 * used['processors']['cores']:.0f} + {100 * used['broker']['cores']:.0f} %",
                _ms(age.get("p99")),
                f"{used['processors']['pss_mb']:.0f} MB, {t['slope_mb_an_hour']} MB/h",
                str(t["queue_depth_max"]),
                str(t["store_waiting_max"]),
                str(t["missing"]),
            ]
        )
    head = [
        "machines",
        "",
        "processors + broker",
        "age at 99 %",
        "memory",
        "queue at most",
        "samples before the store",
        "missing in ledgers",
    ]
    return table(head, rows)


def conditions(figures: dict[str, list[dict[str, Any]]]) -> str:
    """Return when and by which commands the figures were measured, and what else the computer did meanwhile."""
    rows = []
    for kind, trials in figures.items():
        for tree, word in TREES.items():
            own = [trial for trial in trials if trial["tree"] == tree]
            for measured, command in sorted({(trial["measured"], trial["command"]) for trial in own}):
                ran = [trial for trial in own if trial["command"] == command]
                other = max((trial.get("elsewhere_cores", 0.0) for trial in ran), default=0.0)
                late = max((trial.get("late_ms_99", 0.0) for trial in ran), default=0.0)
                rows.append([kind, word, measured, f"`{command}`", f"{other:.1f}", f"{late:.0f} ms"])
    return table(["figures", "", "measured", "command", "cores busy elsewhere, at most", "load late at 99 %, at most"], rows)


TABLES: dict[str, Callable[[Trials], str]] = {
    "many": many,
    "stages": stages,
    "one_against_twelve": one_against_all,
    "storm": storm,
    "idle": idle,
    "soak": soak,
}


def filled(text: str, figures: dict[str, list[dict[str, Any]]]) -> str:
    """Return a page with what stands between `<!-- fleet NAME -->` and `<!-- end -->` written again."""

    def written(found: re.Match[str]) -> str:
        kind = found[1]
        if kind == "conditions":
            body = conditions(figures)
        else:
            trials = figures.get("many" if kind == "stages" else kind, [])
            asked = [trial for trial in trials if kind != "stages" or trial.get("stages")]
            body = TABLES[kind](asked) if asked else "Not measured yet."
        return f"<!-- fleet {kind} -->\n{body}\n<!-- end -->"

    return re.sub(r"<!-- fleet (\w+) -->\n.*?<!-- end -->", written, text, flags=re.DOTALL)


def _cost(trial: dict[str, Any]) -> str:
    """Return what a message costs; where the processors fall behind, each of those that they have dealt with."""
    own = trial["used"]["processors"]
    if holds.has_kept_up(trial):
        return f"{own['us_a_message']:,.0f}"
    return f"{own['us_a_folded']:,.0f}, does not keep up" if own.get("us_a_folded") else "does not keep up"


def _us(trial: dict[str, Any], stage: str) -> float:
    return float(trial["stages"].get(stage, {}).get("us_a_message", 0.0))


def _ms(age: float | None) -> str:
    """Return an age in a unit that can be read."""
    if age is None:
        return "–"
    return f"{age:.0f} ms" if age < 1000.0 else f"{age / 1000.0:.1f} s"


def main() -> None:
    """Add what is given, then write page and curves."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--add", type=Path, action="append", default=[], help="a JSON file of the benchmark")
    parser.add_argument("--tree", choices=tuple(TREES), help="of which all trials of the files are")
    chosen = parser.parse_args()
    figures = json.loads(FIGURES.read_text()) if FIGURES.exists() else {}
    for file in chosen.add:
        figures = added(figures, file, chosen.tree)
    FIGURES.parent.mkdir(exist_ok=True)
    FIGURES.write_text(json.dumps(figures, indent=1, ensure_ascii=False) + "\n")
    PAGE.write_text(filled(PAGE.read_text(), figures))
    curves.draw(figures.get("many", []), OWN / "docs" / "pictures" / "fleet.svg")


if __name__ == "__main__":
    main()
