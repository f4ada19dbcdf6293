"""`cnctwin validate`: judge a stretch, keep it among the nights, say and publish what came out."""

import json
import sys
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from rich.console import Console
from rich.table import Table

from cnctwin.errors import UsageError
from cnctwin.memory.store.opening import default_place, open_store
from cnctwin.terminal.spinner import working
from cnctwin.terminal.still_needed import StillNeeded
from cnctwin.validation.budgets import TABLE, Budgets, budgets_of, tables_of
from cnctwin.validation.cycle_time import Cycle, Cycles, texts_of
from cnctwin.validation.cycles import cycle_of_run, cycles_of, names_of
from cnctwin.validation.evidence import Evidence, of_run, of_store, with_truth
from cnctwin.validation.figure import Figure, Verdict
from cnctwin.validation.history import kept, retraining, validation_of
from cnctwin.validation.model import Twin
from cnctwin.validation.night import figures_of, night_of, worst
from cnctwin.validation.published import publish
from sparkplug.broker import BrokerAddress
from twin.machine import read_machine
from twin.runlog import read_run
from twin.vocabulary.program_names import ENDINGS


@dataclass(frozen=True, slots=True)
class ValidationRequest:
    """The command's request: see its options. from_ms, to_ms: of a store; out: folder of the history"""

    machine: str
    store: str | None
    runs: tuple[Path, ...]
    truth: tuple[Path, ...]
    from_ms: int
    to_ms: int
    programs: Path | None
    config: Path | None
    twin: Path | None
    out: Path
    keeps: bool
    group: str


def validate(
    asked: ValidationRequest, broker: BrokerAddress | None, session_file: Path | None, *, as_json: bool, console: Console
) -> int:
    """The exit code: 1 where a figure is over its budget."""
    tables = tables_of(asked.config)
    budgets = budgets_of(tables.get(TABLE, {}), str(asked.config))
    twin = Twin(None if asked.twin is None else read_machine(asked.twin), tables)
    if asked.runs and asked.truth and len(asked.truth) != len(asked.runs):
        raise UsageError(f"{len(asked.truth)} truth files for {len(asked.runs)} runs: give one for each, in their order")
    if not asked.runs and len(asked.truth) > 1:
        raise UsageError("a stretch of the store takes one truth file; judge several one after the other")
    with working("comparing") as say:
        found = _of_runs(asked, twin, budgets) if asked.runs else _of_store(asked, twin, budgets, say)
    figures = worst([figures for _, figures in found])
    night = night_of(asked.machine, figures, [evidence for evidence, _ in found], twin, time.time())
    if asked.keeps:
        kept(night, asked.machine, asked.out)
        told = validation_of(asked.machine, asked.out)
        if told["nights"] and told["nights"][-1]["night"] != night["night"]:
            told = {**told, **_head(night)}  # an older night was judged again
    else:
        nights = [night]
        reason = retraining(nights)
        told = {**_head(night), "machine": asked.machine, "nights": nights, "retrain": False, "retrain_reason": reason}
        told["over_in_a_row"] = {}
    missing = still_missing(figures, found[0][0].from_s, found[0][0].to_s)
    if as_json:
        retrain = {name: told[name] for name in ("retrain", "retrain_reason")}
        sys.stdout.write(json.dumps({**night, **retrain, "still_missing": missing}) + "\n")
    else:
        _print(night, figures, missing, told, console)
    if broker is not None:
        publish(told, broker, asked.group, session_file)
    return 1 if night["verdict"] == Verdict.OVER else 0


def _head(night: Mapping[str, Any]) -> dict[str, Any]:
    return {name: night[name] for name in ("t", "verdict", "figures")}


def _of_runs(asked: ValidationRequest, twin: Twin, budgets: Budgets) -> list[tuple[Evidence, list[Figure]]]:
    found = []
    for place, path in enumerate(asked.runs):
        log = read_run(path)
        evidence = of_run(log, asked.machine)
        if asked.truth:
            evidence = with_truth(evidence, read_run(asked.truth[place]), budgets.truth_offset_s_max)
        cycles, why = cycle_of_run(log)
        texts = _beside(path, cycles) | texts_of(asked.programs, names_of(cycles))
        found.append((evidence, figures_of(twin, evidence, Cycles(cycles, texts, why), budgets)))
    return found


def _beside(path: Path, cycles: Sequence[Cycle]) -> dict[str, Path]:
    """The program of a run lies beside it: same name, with the ending of a program."""
    texts = (path.with_suffix(ending) for ending in ENDINGS)
    text = next((one for one in texts if one.is_file()), None)
    return {} if text is None else dict.fromkeys(names_of(cycles), text)


def _of_store(asked: ValidationRequest, twin: Twin, budgets: Budgets, say: Any) -> list[tuple[Evidence, list[Figure]]]:
    where = asked.store or str(default_place())
    store = open_store(where, writable=False)
    try:
        say("reading the store")
        evidence = of_store(store, asked.machine, asked.from_ms, asked.to_ms, where)
        if asked.truth:
            evidence = with_truth(evidence, read_run(asked.truth[0]), budgets.truth_offset_s_max)
        cycles: list[Cycle] = []
        why = "no NC texts are given: --programs names a folder with them"
        if asked.programs is not None:
            say("reading programs")
            cycles, why = cycles_of(store, asked.machine, asked.from_ms, asked.to_ms)
        texts = texts_of(asked.programs, names_of(cycles))
        say("comparing")
        return [(replace(evidence), figures_of(twin, evidence, Cycles(cycles, texts, why), budgets))]
    finally:
        store.close()


def _print(
    night: Mapping[str, Any], figures: Sequence[Figure], missing: Sequence[str], told: Mapping[str, Any], console: Console
) -> None:
    table = Table(title=f"{night['machine']}, night of {night['night']}: {night['verdict']}", title_justify="left")
    for column in ("what", "value", "95 %", "budget", "rests on", "verdict"):
        table.add_column(column, justify="right" if column in ("value", "95 %", "budget") else "left", overflow="fold")
    for one in figures:
        value = "–" if one.value is None else f"{one.value:.3g} {one.unit}".strip()
        interval = "–" if one.low is None or one.high is None else f"{one.low:.3g} … {one.high:.3g}"
        rests = "–" if not one.samples else f"{one.samples} in {one.hours:.3g} h, {one.blocks} blocks"
        table.add_row(one.key, value, interval, f"{'≥' if one.measure == 'r' else '≤'} {one.budget:g}", rests, str(one.verdict))
    console.print(table)
    for line in _reasons([one for one in figures if one.value is not None]):
        console.print(line, markup=False, highlight=False, soft_wrap=True)
    if missing:
        console.print("\n[bold]still missing[/]")
    for line in missing:
        console.print(f"· {line}", markup=False, highlight=False, soft_wrap=True)
    if (clock := night["clock"]) is not None:
        sure = f"(correlation {clock['r']:.3f}, elsewhere {clock['rival']:.3f})"
        console.print(f"the truth's clock: {clock['offset_s']:g} s, by {clock['by']} {sure}", highlight=False, soft_wrap=True)
    if told["retrain"]:
        console.print(f"retrain: {told['retrain_reason']}", style="bold red", markup=False, highlight=False, soft_wrap=True)


def still_missing(figures: Sequence[Figure], from_s: float, to_s: float) -> list[str]:
    """Return the plan for what could not be judged: what was seen, what is needed and when that will be; else the reason."""
    lines: dict[str, list[str]] = {}
    for one in figures:
        if one.value is None and one.hours_needed is not None:
            needed = StillNeeded("", one.hours, one.hours_needed, (to_s - from_s) / 3600.0, to_s)
            lines.setdefault(needed.sentence(), []).append(one.key)
        elif one.value is None:
            lines.setdefault(f": {one.reason}", []).append(one.key)
    return [f"{', '.join(keys)}{text}" for text, keys in lines.items()]


def _reasons(figures: Sequence[Figure]) -> list[str]:
    """Return what each rests on or lacks, once for those that share it."""
    said: dict[str, list[str]] = {}
    for one in figures:
        if text := "; ".join(part for part in (one.reason, one.basis) if part):
            said.setdefault(text, []).append(one.key)
    return [f"{', '.join(keys)}: {text}" for text, keys in said.items()]
