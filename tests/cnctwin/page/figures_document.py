"""Production figures as the interface gives them: shifts with stops, parts, and a machine of which little is known."""

import json
from typing import Any

from cnctwin.figures.documents import PartTold, ShiftTold
from cnctwin.figures.table import Asked, By, table
from tests.cnctwin.page.fake_server import Answer, now_ms

HOUR_MS = 3_600_000
ZONE = "America/New_York"
HOSTILE = "<img src=x onerror=alert(1)>"


def told(began: int | None = None) -> tuple[list[ShiftTold], list[PartTold]]:
    began = now_ms() - 10 * HOUR_MS if began is None else began
    stops = {
        "feed hold": {"kind": "delay", "s": 1800.0, "n": 4},
        f"alarm: {HOSTILE}": {"kind": "down", "s": 900.0, "n": 1},
        "mode MANUAL": {"kind": "setup", "s": 2700.0, "n": 2},
    }
    times = {"planned_s": 27000.0, "production_s": 21600.0, "setup_s": 2700.0, "delay_s": 1800.0, "down_s": 900.0}
    shift: dict[str, Any] = {"kind": "shift", "id": "a", "machine": "vmc", "shift": "early", "begin": began, "calendar": True}
    shift |= times | {
        "end": began + 8 * HOUR_MS,
        "over": True,
        "unknown_s": 0.0,
        "beside_s": 0.0,
        "stops": stops,
        "energy_s": 28800.0,
    }
    part: dict[str, Any] = {"kind": "part", "machine": "vmc", "program": HOSTILE, "shift": "early", "shift_begin": began}
    part |= {"interrupted_s": 0.0, "unknown_s": 0.0, "ideal_s": 540.0, "active_s": 600.0, "complete": True, "energy_kwh": 0.42}
    ends = [began + n * 600_000 for n in range(1, 11)]
    parts = [part | {"id": str(end), "begin": end - 600_000, "end": end, "quality": "good"} for end in ends]
    parts[-1]["quality"] = "scrap"
    other = shift | {
        "id": "b",
        "machine": "mill-01",
        "unknown_s": 9000.0,
        "beside_s": 399.0,
        "production_s": 12600.0,
        "energy_kwh": None,
        "energy_s": 0.0,
    }
    shifts = [ShiftTold.model_validate(one) for one in (shift | {"energy_kwh": 12.5}, other)]
    return shifts, [PartTold.model_validate(one) for one in parts]


def figures(asked: dict[str, str], began: int | None = None) -> Answer:
    shifts, parts = told(began)
    by = By(asked["by"])
    rows = table(shifts, parts, Asked(by, int(asked["from"]), int(asked["to"])))
    wanted = asked.get("machine")
    rows = [json.loads(json.dumps(row)) for row in rows if wanted in (None, row["machine"])]
    return 200, {"from": int(asked["from"]), "to": int(asked["to"]), "by": by, "time_zone": ZONE, "note": "", "rows": rows}
