"""The report of an import: a table for a person, or JSON for a program."""

import json
from collections.abc import Iterator
from pathlib import Path

from rich.console import Console

from cnctwin.importing.recorded_files import Account
from cnctwin.terminal.table import text_table

NS = 1_000_000_000


def as_json(account: Account, out: Path) -> str:
    """Return the account as JSON."""
    written = account.written
    told = {
        "out": str(out),
        "rows": written.rows,
        "seconds": (written.last_ns - written.first_ns) / NS,
        "step_s": written.step_s,
        "files": [{"file": name, "kind": kind, "rows": account.rows[name]} for name, kind in account.files.items()],
        "columns": {
            name: {
                "from": source.name,
                "unit": source.unit or None,
                "scale": source.scale,
                "offset": source.offset,
                "values": account.tallies[name].values,
                "left_out": account.tallies[name].faults,
            }
            for name, source in account.columns.items()
        },
        "not_taken": list(account.left_out),
        "left_out": {name: dict(faults) for name, faults in account.faults.items()},
        "remarks": list(account.remarks),
    }
    return json.dumps(told, ensure_ascii=False, indent=2) + "\n"


def show(account: Account, out: Path, console: Console) -> None:
    """Print the account."""
    written = account.written
    rows = []
    for name, source in account.columns.items():
        tally = account.tallies[name]
        between = f"{tally.low:.6g} … {tally.high:.6g}" if tally.low <= tally.high else ""
        scaled = f" · {source.scale:.6g}" if source.scale != 1.0 else ""
        moved = f" {source.offset:+.6g}" if source.offset else ""
        rows.append(
            (name, f"{source.name}{f' [{source.unit}]' if source.unit else ''}{scaled}{moved}", str(tally.values), between)
        )
    console.print(text_table(("column", "from", "values", "between"), rows))
    seconds = (written.last_ns - written.first_ns) / NS
    step = f", a row every {written.step_s:g} s" if written.step_s else ""
    for line in (f"{out}: {written.rows} rows in {seconds:g} s{step}", *_lines(account)):
        console.print(line, markup=False, highlight=False, soft_wrap=True)


def _lines(account: Account) -> Iterator[str]:
    for name, faults in account.faults.items():
        for what, count in faults.items():
            yield f"{name}: left out {count} {what}"
    for name, tally in account.tallies.items():
        for what, count in tally.faults.items():
            example = f", such as {tally.example!r}" if tally.example else ""
            yield f"{name}: {count} values are {what}{example}"
    if account.left_out:
        yield f"not taken: {', '.join(account.left_out)}"
    yield from account.remarks
