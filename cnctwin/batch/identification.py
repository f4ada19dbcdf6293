"""An identification as JSON: for the command line, and for a job."""

from dataclasses import asdict
from typing import Any

from twin.identification.identify import Identification


def identification_json(found: Identification) -> dict[str, Any]:
    """Everything, for a program to read."""
    return {
        "estimates": [asdict(e) | {"identifiable": e.identifiable} for e in found.estimates],
        "misfits": found.misfits,
        "unknown": found.unknown,
        "notes": found.notes,
        "gaps": [asdict(row) | {"ratio": row.ratio} for row in found.gaps],
    }
