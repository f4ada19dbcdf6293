"""The table of figures that a person reads."""

from typing import Any

from rich.table import Table

from cnctwin.figures.table import By, Row
from cnctwin.terminal.console import standard_output
from cnctwin.terminal.moment import moment_text

_SHOWN = {
    By.MACHINE: ("machine", "shifts", "planned_s", "production_s", "unknown_s", "parts"),
    By.SHIFT: ("machine", "shift", "begin", "planned_s", "production_s", "unknown_s", "parts"),
    By.PART: ("machine", "program", "shift", "begin", "end", "ideal_s", "active_s", "performance", "energy_kwh", "quality"),
    By.PROGRAM: ("machine", "program", "parts", "good", "scrap", "ideal_s", "active_s", "performance", "energy_a_part_kwh"),
}
_RATIOS = ("availability", "performance", "quality", "oee", "energy_kwh")
_HEADS = {
    "planned_s": "planned s",
    "production_s": "production s",
    "unknown_s": "not heard s",
    "availability": "avail.",
    "performance": "perf.",
    "oee": "OEE",
    "energy_kwh": "kWh",
    "energy_a_part_kwh": "kWh a part",
    "ideal_s": "ideal s",
    "active_s": "actual s",
}
_STOPS_SHOWN = 3


def show(rows: list[Row], by: By, time_zone: str) -> None:
    """Print the rows as a table with times in a zone, then the longest stops of each, then why figures are missing."""
    console = standard_output()
    if not rows:
        console.print("no shift begins, and no part ends, in this stretch")
        return
    names = _SHOWN[by] if by in (By.PART, By.PROGRAM) else (*_SHOWN[by], *_RATIOS)
    shown = Table()
    for name in names:
        shown.add_column(_HEADS.get(name, name), no_wrap=True)
    for row in rows:
        shown.add_row(*(_cell(name, row.get(name), time_zone) for name in names))
    console.print(shown)
    if any(name in ("begin", "end") for name in names) or any(row.get("stops") for row in rows):
        console.print(f"times in {time_zone}", markup=False)
    reasons: dict[str, None] = {}
    if (beside_s := sum(row.get("beside_s", 0.0) for row in rows)) >= 1.0:
        reasons[f"{beside_s:.0f} s made in breaks or outside shifts, not counted"] = None
    for row in rows:
        stops = list(row.get("stops", {}).items())[:_STOPS_SHOWN]
        if stops:
            where = " ".join(filter(None, (row["machine"], row.get("shift"), moment_text(row["begin"], time_zone))))
            console.print(
                f"{where}: " + "; ".join(f"{reason} {stop['s']:.0f} s ({stop['n']})" for reason, stop in stops), markup=False
            )
        reasons |= dict.fromkeys(f"{name}: {why}" for name, why in row.get("why", {}).items() if name != "oee")
    for reason in reasons:
        console.print(reason, markup=False)


def _cell(name: str, value: Any, time_zone: str) -> str:
    if value is None:
        return "–"
    if name in ("begin", "end"):
        return moment_text(value, time_zone)[5:16]
    if name in ("availability", "performance", "quality", "oee"):
        return f"{100.0 * value:.1f} %"
    return f"{value:.3f}" if "kwh" in name else f"{value:.0f}" if isinstance(value, float) else str(value)
