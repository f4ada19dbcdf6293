"""What the interface tells beside live values: alerts, a gap with its diagnosis, events, parts, validation, a replay."""

import time
import zlib
from datetime import UTC, datetime
from typing import Any

from tests.cnctwin.page.anomaly_document import anomaly
from tests.cnctwin.page.diagnosis_document import diagnosis
from tests.cnctwin.page.fake_server import Answer, Shop, now_ms
from tests.cnctwin.page.figures_document import figures
from tests.cnctwin.page.simulated_shop import CYCLE_S


def iso(t_ms: float) -> str:
    return datetime.fromtimestamp(t_ms / 1000.0, UTC).isoformat(timespec="milliseconds").replace("+00:00", "Z")


def alert(machine: str, name: str, severity: str, phase: str, ago_s: float, **more: Any) -> dict[str, Any]:
    """An alert as the processor writes it."""
    began = now_ms() - round(ago_s * 1000)
    return {
        "status": "resolved" if phase == "resolved" else "firing",
        "labels": {"machine": machine, "alertname": name, "severity": severity},
        "annotations": {
            "summary": f"{machine}: {more.pop('sentence', name)}",
            "description": more.pop("description", ""),
            "advice": more.pop("advice", ""),
        },
        "startsAt": iso(began),
        "endsAt": iso(began + 90_000) if phase == "resolved" else "0001-01-01T00:00:00Z",
        "fingerprint": f"{zlib.crc32(f'{machine} {name}'.encode()):016x}",
        "phase": phase,
        "severity": severity,
        "severities": [severity],
        "episode": began,
        "since": iso(began),
        "unknown": "",
        "flapping": False,
        "acknowledged_by": "",
        "comment": "",
        "silenced_by": "",
        "undelivered": False,
        "told": ["phone"],
        **more,
    }


def alerts(machines: list[str]) -> dict[str, Any]:
    """Some of each phase."""
    first, other = machines[0], machines[-1]
    return {
        "at": iso(now_ms()),
        "now": now_ms(),
        "available": True,
        "reason": None,
        "alerts": [
            alert(
                first,
                "rule_spindle_overload",
                "high",
                "firing",
                75,
                sentence="Spindle load 131 % for 4 s, limit 120 %",
                description="program BASE-PLATE.NC, tool 5, line 210",
                advice="Check the tool for wear and packed chips, and the feed and its override.",
            ),
            alert(
                first,
                "anomaly_alarm",
                "medium",
                "firing",
                320,
                sentence="Load of axis Z 31 % above 12 earlier parts",
                description="lines 210 to 260, program BASE-PLATE.NC, tool 5",
            ),
            alert(
                other,
                "gap_growing",
                "medium",
                "acknowledged",
                5400,
                acknowledged_by="ada",
                comment="spindle bearing ordered",
                description="spindle_temp_c, steady, risen since 06:00",
            ),
            alert(other, "machine_offline", "high", "pending", 12),
            alert(first, "rule_stuck_feed", "high", "resolved", 9000),
        ],
        "alerts_not_shown": 0,
        "silences": [
            {
                "id": "1c2d3e4f",
                "matchers": {"machine": other, "alertname": "score_drift"},
                "starts": iso(now_ms() - 3.6e6),
                "ends": iso(now_ms() + 7.2e6),
                "by": "ada",
                "comment": "new tool holder",
            }
        ],
        "receivers": {
            "phone": {
                "delivered": 14,
                "failed": 1,
                "waiting": 0,
                "held_back": 0,
                "muted": False,
                "last_error": "",
                "last_delivered": iso(now_ms() - 75_000),
            }
        },
        "failures": [],
        "commands": [],
        "malformed": 0,
        "overflowed": 0,
    }


def gap(machine: str, found: dict[str, Any] | None) -> dict[str, Any]:
    """The standing gap, and a diagnosis where there is one."""
    now = now_ms()

    def value(number: float | bool | str | None, unit: str | None = "floors", reason: str | None = None) -> dict[str, Any]:
        return {
            "value": number,
            "t": now - 20_000,
            "unit": unit,
            "quality": "bad" if reason else "good",
            "provenance": "inferred",
            **({"reason": reason} if reason else {}),
        }

    rows = [
        ("spindle_temp_c", None, 3.1),
        ("spindle_temp_c", "warm_up", 4.4),
        ("spindle_temp_c", "steady", 2.7),
        ("spindle_temp_c", "cool_down", None),
        ("spindle_load_pct", None, 1.4),
        ("spindle_load_pct", "air", 1.1),
        ("spindle_load_pct", "cutting:BASE-PLATE.NC", 1.9),
        ("spindle_rpm", None, 0.8),
    ]
    means = {"spindle_temp_c": value(-0.9, "K"), "spindle_load_pct": value(0.31, "%"), "spindle_rpm": value(4.0, "rev/min")}
    standing = [
        {
            "signal": signal,
            "regime": regime,
            "gap": value(number, reason=None if number else "less than 60 s of this regime seen"),
            "mean": None if regime else means[signal],
        }
        for signal, regime, number in rows
    ]
    return {
        "machine": machine,
        "now": now,
        "standing": standing,
        "growing": value(True, None),
        "growing_signal": value("spindle_temp_c, steady: risen since 2026-11-19T06:00Z", None),
        "window": {"from": now - 7_200_000, "to": now},
        "left_out_pct": value(18.4, "%"),
        "basis": "spindle_temp_c: thermal network, floor 0.3 K configured. healthy: assumed, the first 336 h that were seen",
        "diagnosis": found,
        "diagnosis_reason": None if found else f"no diagnosis of {machine} yet",
        "diagnosis_do": None if found else f"cnctwin gap diagnose CASE --out diagnoses/{machine}",
        "report": f"gap/{machine}/report" if found else None,
    }


def part_record(machine: str, number: int, end: int) -> dict[str, Any]:
    """As the processor `events` writes it, in short."""
    force = {"mean": 80.0, "max": 301.6}
    return {
        "version": 1,
        "machine": machine,
        "program": "BASE-PLATE.NC",
        "part_number": number,
        "began": iso(end - CYCLE_S * 1000),
        "ended": iso(end),
        "ended_by": "completed",
        "complete": number > 1,
        "reasons": [] if number > 1 else ["its beginning was not seen"],
        "cycle": {"cycle_time_s": CYCLE_S if number > 1 else None, "active_s": CYCLE_S, "interruptions": 0},
        "tools": [{"tool": tool, "changes": 1, "active_s": 9.0, "force_n": force} for tool in (None, 1, 2, 5)],
        "temperature": {"signal": "spindle_temp_c", "unit": "°C", "min": 23.0, "max": 38.9, "mean": 36.2},
        "gap": {"gap_spindle_temp_c": {"mean": 3.0, "end": 3.1}},
        "t": end,
    }


def validation(machine: str) -> dict[str, Any]:
    """A night: one figure within its budget, one over it, one that could not be judged."""
    figure = {"on": "", "samples": 86400, "hours": 7.5, "blocks": 60, "basis": ""}
    figures = [
        {
            **figure,
            "quantity": "temperature",
            "measure": "mae",
            "value": 0.84,
            "low": 0.71,
            "high": 0.98,
            "unit": "K",
            "budget": 2.0,
            "verdict": "within",
            "reason": None,
        },
        {
            **figure,
            "quantity": "force",
            "measure": "mape",
            "value": 23.1,
            "low": 20.4,
            "high": 26.0,
            "unit": "%",
            "budget": 20.0,
            "verdict": "over",
            "reason": None,
        },
        {
            **figure,
            "quantity": "vibration",
            "measure": "r",
            "value": None,
            "low": None,
            "high": None,
            "unit": "",
            "budget": 0.85,
            "verdict": "not observable",
            "reason": "the machine offers no vibration_rms_g",
        },
    ]
    nights = [{"night": "2026-11-20", "verdict": "within"}, {"night": "2026-11-21", "verdict": "over"}]
    return {
        "machine": machine,
        "t": now_ms() - 6 * 3_600_000,
        "verdict": "over",
        "figures": figures,
        "nights": nights,
        "retrain": False,
        "retrain_reason": None,
        "over_in_a_row": {"force_mape": 1},
    }


RESULT = {
    "sentence": "29.5 s become 24.5 s, 16.9 % less",
    "seconds": {"before": 29.48, "after": 24.51},
    "files": {"optimised.nc": 812, "report.html": 90_000},
}


def job(name: str, kind: str, state: str, **more: Any) -> dict[str, Any]:
    """A job in short, as the consumer tells it."""
    times = {"accepted_ms": now_ms() - 90_000, "changed_ms": now_ms(), "started_ms": now_ms() - 60_000, "ended_ms": None}
    told = {"attempt": 1, "progress_pct": 0.0, "doing": "", "reason": "", "sentence": "", "place": None}
    return {"id": name, "kind": kind, "machine": "vmc", "state": state, **times, **told, **more}


def jobs() -> dict[str, Any]:
    """One that runs, one that waits, one of each end."""
    over = {"ended_ms": now_ms() - 20_000, "progress_pct": 100.0}
    running = job("optimise-2", "optimise", "running", progress_pct=42.0, doing="evolution 42 of 100", attempt=2, place=0)
    return {
        "now": now_ms(),
        "available": True,
        "reason": None,
        "offers_files": True,
        "disk_trouble": "",
        "jobs": [
            running,
            job("diagnose-1", "diagnose", "queued", place=1, started_ms=None),
            job("optimise-1", "optimise", "done", sentence=RESULT["sentence"], **over),
            job("identify-1", "identify", "failed", reason="case = 'vmc': its process was killed 3 times", **over),
        ],
    }


def tell_all(shop: Shop) -> None:
    """Give the shop all of these."""
    machines = list(shop.numbers)
    started = time.time()
    shop.answers["/alerts"] = lambda _path, _body: (200, alerts(machines))
    shop.answers["/alerts/[^/]+/acknowledge"] = lambda _path, body: (
        200,
        {"done": True, "text": f"acknowledged by {(body or {})['by']}"},
    )
    shop.answers["/figures"] = lambda _path, asked: figures(asked or {})
    shop.answers["/anomaly/[^/]+"] = lambda path, _body: (200, anomaly(path.rpartition("/")[2]))
    for machine in machines:
        _tell_machine(shop, machine, machine == machines[0], started)
    shop.answers["/jobs"] = lambda _path, body: (
        200,
        jobs() if "job" not in (body or {}) else {"id": "new-1", "answer": "accepted"},
    )
    shop.answers["/jobs/optimise-1"] = lambda _path, _body: (200, {**jobs()["jobs"][2], "result": RESULT})
    shop.answers["/jobs/[^/]+/cancel"] = lambda _path, _body: (200, {"id": "optimise-2", "answer": "cancelled"})
    shop.answers["/twin/replay"] = lambda _path, body: (200, _replayed(body or {}))


CHANGED = "description 9b1c77aa2e01 live: promoted by anna: coolant cools"
FAULTY = "machines/vmc.toml: thermal.resistance_k_per_w: must be above 0"


def _tell_machine(shop: Shop, machine: str, is_first: bool, started: float) -> None:
    def events(_path: str, asked: dict[str, Any] | None) -> Answer:
        start, end = int((asked or {})["from"]), int((asked or {})["to"])
        middle = (start + end) // 2
        found = [
            {"t": start + 20_000, "until": None, "kind": "tool_change", "text": "T2 in the spindle"},
            {"t": middle, "until": middle + 4000, "kind": "alert", "text": "spindle overload: load 131 % for 4 s"},
            {"t": middle + 10_000, "until": None, "kind": "description", "text": CHANGED},
            {"t": middle + 20_000, "until": end - 30_000, "kind": "description_fault", "text": FAULTY},
            {"t": middle + 30_000, "until": middle + 39_000, "kind": "stop", "text": "feed hold, 9 s, by the operator"},
            {"t": end - 40_000, "until": None, "kind": "hole", "text": "12 messages lost between edge and broker"},
        ]
        live = [(start - 60_000, "description 3f2a1bc4d5e6 live: described"), (middle + 10_000, CHANGED)]
        descriptions = [{"t": t, "role": "live", "version": text.split()[1], "text": text} for t, text in live]
        descriptions.append(
            {"t": middle + 5_000, "role": "challenger", "version": "9b1c", "text": "description 9b1c challenger: filed"}
        )
        return 200, {"machine": machine, "from": start, "to": end, "events": found, "descriptions": descriptions}

    shop.answers[f"/twin/{machine}"] = lambda _path, _body: (200, {"machine": machine, "step": None, "reason": "no loop runs"})
    shop.answers[f"/gap/{machine}"] = lambda _path, _body: (200, gap(machine, diagnosis() if is_first else None))
    shop.answers[f"/events/{machine}"] = events
    shop.answers[f"/parts/{machine}"] = lambda _path, _body: (
        200,
        {"machine": machine, "parts": [part_record(machine, n, round(1000 * (started - 60.0 * n))) for n in range(3, 0, -1)]},
    )
    shop.answers[f"/validation/{machine}"] = lambda _path, _body: (
        (200, validation(machine)) if is_first else (200, {"machine": machine, "t": None, "figures": [], "nights": []})
    )


def _replayed(body: dict[str, Any]) -> dict[str, Any]:
    return {
        "machine": body["machine"],
        "from": body["from"],
        "to": body["to"],
        "equal": True,
        "compared": 18204,
        "differences": [],
        "seconds": 1.9,
        "speed": 157.0,
    }
