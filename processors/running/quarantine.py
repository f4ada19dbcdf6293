"""The quarantine of the host session as health metrics of each processor."""

import json
from collections.abc import Sequence

from sparkplug.admission.refusal import Quarantined

ROWS_MAX = 20


def quarantine_health(rows: Sequence[Quarantined]) -> dict[str, int | str]:
    """Return the number of nodes and devices of which something is refused, and the first `ROWS_MAX` as a JSON list."""
    told = [
        {
            "node": str(row.node),
            "device": row.device,
            "reason": row.reason.value,
            "text": row.text,
            "since_ms": row.since_ms,
            "count": row.times,
        }
        for row in rows[:ROWS_MAX]
    ]
    return {"quarantined": len(rows), "quarantine": json.dumps(told, ensure_ascii=False)}
