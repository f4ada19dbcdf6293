"""`cnctwin gap diagnose`, `gap score` and `gap check`: the sim-to-real gap from the command line."""

import json
import sys
import time
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from functools import partial
from pathlib import Path
from typing import Any

from rich.console import Console
from rich.table import Table

from cnctwin.commands.twin import working, write
from cnctwin.errors import UsageError
from cnctwin.reports.gap.page import report_html
from twin.case import Case, read_case
from twin.gap.diagnose import diagnose as diagnosed
from twin.gap.diagnosis import Diagnosed, Diagnosis, Verdict
from twin.gap.score_of import Score, score_of
from twin.machine import machine_to_toml, read_machine

CORES = 2
FILES = ("diagnosis.json", "report.html", "twin.toml")


def diagnose(folder: Path, out: Path, *, as_json: bool, console: Console) -> int:
    """Diagnose a case and write diagnosis.json, report.html and twin.toml; exit code 1 where a gap is left unknown."""
    case = read_case(folder)
    with working("diagnosing") as say:
        found = in_threads(case, lambda what: say(f"diagnosing: {what}"))
    texts = (found.diagnosis.to_json(), report_html(found, case.name), machine_to_toml(found.twin))
    write(lambda: out.mkdir(parents=True, exist_ok=True), out)
    for name, text in zip(FILES, texts, strict=True):
        write(partial((out / name).write_text, text, encoding="utf-8"), out / name)
    if as_json:
        sys.stdout.write(texts[0])
    else:
        _print(found, out, console)
    return 1 if found.diagnosis.verdict in (Verdict.UNKNOWN, Verdict.PARTLY) else 0


def in_threads(case: Case, progress: Callable[[str], None] = lambda _: None) -> Diagnosed:
    """The diagnosis of a case, its axes side by side: the kernels let go of the interpreter."""
    with ThreadPoolExecutor(CORES) as pool:
        return diagnosed(case, clock=time.monotonic, progress=progress, side_by_side=pool.map)


def _print(answer: Diagnosed, out: Path, console: Console) -> None:
    found = answer.diagnosis
    unseen = "that were not fitted" if any(not trace.fitted for trace in answer.traces) else "that were fitted, which flatters"
    console.print(found.sentence, style="bold", highlight=False, soft_wrap=True)
    gap = found.gap
    console.print(
        f"gap {gap.before:.3g} → {gap.after:.3g} × what repeats; closed {100 * gap.closure:.1f} % "
        f"({100 * gap.closure_low:.1f} to {100 * gap.closure_high:.1f}), on runs {unseen}; "
        f"as stated {gap.as_stated:.3g}",
        highlight=False,
        soft_wrap=True,
    )
    for title, sentences in (
        ("where", [cell.sentence for cell in found.where[:5] if cell.discovered] + [p.sentence for p in found.patterns[:3]]),
        ("not to be known from these recordings", found.not_identifiable[:6]),
        ("found on the way", found.notes),
    ):
        if sentences:
            console.print(f"\n[bold]{title}[/]")
        for sentence in sentences:
            console.print(f"· {sentence}", markup=False, highlight=False, soft_wrap=True)
    if found.causes:
        console.print(causes_table(found))
    if found.next_experiment is not None:
        console.print("\n[bold]next experiment[/]")
        console.print(found.next_experiment.why, markup=False, highlight=False, soft_wrap=True)
    console.print(f"\n{', '.join(FILES)} in {out} ({found.seconds:.0f} s)", markup=False, highlight=False, soft_wrap=True)


def causes_table(found: Diagnosis) -> Table:
    """What was found, with intervals."""
    causes = Table(title="causes", title_justify="left")
    for column in ("effect", "on", "parameters (90 %)", "share", "not to be told from"):
        causes.add_column(column, justify="right" if column == "share" else "left")
    for cause in found.causes:
        parameters = ", ".join(
            f"{k} {v.value:.4g} ({v.low:.4g} … {v.high:.4g}) {v.unit}".strip() for k, v in cause.parameters.items()
        )
        rivals = ", ".join(str(e) for e in cause.indistinguishable_from)
        causes.add_row(cause.effect, cause.on, parameters, f"{100 * cause.closure:.1f} %", rivals)
    return causes


def score(twin: Path, folder: Path, *, as_json: bool, console: Console) -> None:
    """The gap of a twin on all runs of a case."""
    case = read_case(folder)
    machine = read_machine(twin)
    with working("scoring"):
        found = score_of(machine, case)
    if as_json or not console.is_terminal:
        sys.stdout.write(json.dumps(score_json(found)) + "\n")
        return
    signals = Table(title=f"{machine.machine.name} on {case.name}: {found.gap:.3g} × what repeats", title_justify="left")
    for column in ("signal", "rms", "floor", "unit", "×"):
        signals.add_column(column, justify="left" if column in ("signal", "unit") else "right")
    for signal, one in found.by_signal.items():
        signals.add_row(signal, f"{one.rms:.4g}", f"{one.floor:.4g}", one.unit, f"{one.rms / one.floor:.2f}")
    console.print(signals)


def score_json(found: Score) -> dict[str, Any]:
    """As `cli.md` has it."""
    by_signal = {s: {"rms": _digits(v.rms), "floor": _digits(v.floor), "unit": v.unit} for s, v in found.by_signal.items()}
    return {"gap": _digits(found.gap), "by_signal": by_signal}


def _digits(value: float) -> float:
    return float(f"{value:.6g}")


def diagnosed_alone(case: Case) -> Diagnosed:
    """As a worker of the blind check does it, which has one core."""
    return diagnosed(case, clock=time.monotonic)


def check(cases: int, seed: int, *, workers: int, as_json: bool, console: Console) -> int:
    """The blind check: cases of an independent plant whose effects are withheld; exit code 1 where a target is missed."""
    from cnctwin.blind_check.check import run_check
    from cnctwin.blind_check.table import check_json, missed, table

    if cases < 1:
        raise UsageError(f"--cases {cases}: at least one")
    with working("blind check") as say:
        result = run_check(cases, seed, diagnosed_alone, workers=workers, progress=say)
    sys.stdout.write(json.dumps(check_json(result)) + "\n" if as_json else table(result) + "\n")
    return 1 if missed(result) else 0
