"""The reports of runners and bridges, once a second, as JSON on the compacted topic `health`: the form that both sides share."""

import json
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Annotated, Any, Literal

from pydantic import Field, TypeAdapter

BRIDGE_PREFIX = "bridge."
"""Keys of bridges begin with it; those of runners with the names of their processors."""
_Name = Annotated[str, Field(min_length=1, max_length=200)]
_Count = Annotated[int, Field(ge=0, le=2**62)]
_Amount = Annotated[float, Field(ge=0.0, le=1e12, allow_inf_nan=False)]


@dataclass(frozen=True, slots=True, kw_only=True)
class RunnerReport:
    """The state of a runner; counts are since it was started, and never fall while it lives.

    t: when it was made, UTC in ms
    ledgers: of each processor its ledger, its machines and what else it counts, partitions that have gone included
    """

    format: Literal[1] = 1
    t: _Count
    processors: Annotated[tuple[_Name, ...], Field(min_length=1, max_length=100)]
    partitions: _Count
    records: _Count
    lag_records: _Count
    lag_s: _Amount
    busy_pct: _Amount
    transactions: _Count
    transactions_aborted: _Count
    rebalances: _Count
    restored_s: _Amount
    lost_by_retention: _Count
    repeated: _Count
    dead_letters: _Count
    faults: _Count = 0
    fault: Annotated[str, Field(max_length=10_000)] = ""
    ledgers: Annotated[dict[_Name, dict[_Name, _Count]], Field(max_length=100)]


@dataclass(frozen=True, slots=True, kw_only=True)
class BridgeReport:
    """The state of a bridge; counts are since it was started. t: when it was made, UTC in ms."""

    format: Literal[1] = 1
    t: _Count
    bridge: _Name
    events: _Count
    delivered: _Count
    waiting: _Count
    dropped: _Count
    busy_pct: _Amount


Report = RunnerReport | BridgeReport
_RUNNER, _BRIDGE = TypeAdapter(RunnerReport), TypeAdapter(BridgeReport)


def payload_of(report: Report) -> bytes:
    """Return a report as JSON."""
    return _BRIDGE.dump_json(report) if isinstance(report, BridgeReport) else _RUNNER.dump_json(report)


def parsed(payload: bytes) -> Report:
    """Return the report in a payload. Raises ValueError where there is none of this format."""
    try:
        told: Any = json.loads(payload)
    except RecursionError as error:
        raise ValueError("nested too deeply") from error
    is_bridge = isinstance(told, Mapping) and "bridge" in told
    return _BRIDGE.validate_python(told) if is_bridge else _RUNNER.validate_python(told)
