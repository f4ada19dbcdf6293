"""The routes' answers as pydantic models: the contracts of the OpenAPI document."""

from typing import Annotated, Any, Literal

from pydantic import BaseModel, ConfigDict, Field

Plain = bool | int | float | str | None
T = Annotated[int, Field(description="ms since 1970, UTC")]
MachineName = Annotated[str, Field(examples=["vmc"])]


class Answer(BaseModel):
    """The root of all answers: more keys may come."""

    model_config = ConfigDict(extra="allow")


class Problem(BaseModel):
    """Every refusal."""

    error: str = Field(examples=["machine 'vmx' is not known; there are lathe, vmc"])


class ValueObject(Answer):
    """A reading."""

    value: Plain = Field(examples=[37.25])
    t: T
    unit: str | None = Field(examples=["%"])
    quality: Literal["good", "stale", "bad"]
    reason: str | None = None
    provenance: str = Field(description="measured, modelled or inferred", examples=["measured"])
    meaning: str | None = None


class State(Answer):
    """All that is known of a machine now."""

    machine: MachineName
    now: T
    online: bool
    behind: str | None = Field(None, description="which processors are behind, and how far: the twin's values are so old")
    refused: str | None = Field(None, description="which devices are in quarantine, and why: nothing of them is taken")
    described: str | None = Field(None, description="which machines' descriptions have a fault: what was live before stays so")
    measured: dict[str, ValueObject]
    twin: dict[str, ValueObject]


class FleetItem(Answer):
    """A machine in short; null = not known."""

    machine: MachineName
    online: bool
    exec_state: Plain = None
    program: Plain = None
    tool_number: Plain = None
    alarm: Plain = None
    spindle_load_pct: Plain = None
    spindle_rpm: Plain = None
    alert_state: Plain = None
    score: Plain = None
    threshold: Plain = None
    gated: Plain = None
    growing: Plain = None
    residual_k: Plain = None
    gap: float | None = Field(None, description="largest standing gap of any signal, rms over its floor")
    gap_reason: str | None = Field(None, description="why there is no gap; null where there is one")
    last_t: int | None = None


class Part(Answer):
    """One part of the installation, and what to do where it is not as it should be."""

    part: str
    state: Literal["ok", "degraded", "missing", "off"]
    reason: str = ""
    do: str = ""


class Health(Answer):
    """`degraded` where any part is; the answer is 200 all the same."""

    status: Literal["ok", "degraded"]
    now: T
    parts: list[Part]


class Ready(Answer):
    """The state of the server; 503 where it cannot serve."""

    ready: bool


class Column(Answer):
    """One signal; all lists have one length, those of windows are empty where samples came as they are."""

    signal: str
    unit: str | None
    t: list[int]
    value: list[Plain]
    quality: list[str]
    reason: list[str | None]
    low: list[float | None]
    high: list[float | None]
    count: list[int]


class History(BaseModel):
    """Columns of a stretch of time."""

    model_config = ConfigDict(populate_by_name=True)
    machine: MachineName
    from_: int = Field(alias="from")
    to: int
    every_ms: int | None
    source: Literal["store", "memory"]
    reason: str | None = None
    columns: list[Column]


class Events(Answer):
    """The events of a machine, oldest first. `left_out` oldest ones there was no room for.

    `descriptions`: those that held at the beginning, and each that came later, where there is a store
    """

    machine: MachineName
    source: Literal["store", "memory"]
    left_out: int
    events: list[dict[str, Any]]
    descriptions: list[dict[str, Any]] = Field(default_factory=list)


class Figures(Answer):
    """Production figures (docs/how-to/production.md): rows by machine, shift, part or program; unknown is null."""

    from_: T = Field(alias="from")
    to: T
    by: Literal["machine", "shift", "part", "program"]
    time_zone: str = Field("UTC", description="of the shift calendar; times here are ms since 1970", examples=["Europe/Berlin"])
    left_out: int = Field(0, description="rows that were beyond the limit: the oldest")
    refused: int = Field(0, description="records that had not the shape of one")
    note: str = Field("", description="why there is no row; empty where there is one")
    rows: list[dict[str, Any]]


class Parts(Answer):
    """As-built records (docs/reference/part_record.schema.json), newest first."""

    machine: MachineName
    source: Literal["store", "memory"]
    parts: list[dict[str, Any]]


class Validation(Answer):
    """The twin against ground truth; `t` is null where it was never judged (docs/how-to/validation.md)."""

    machine: MachineName
    t: int | None
    verdict: str | None
    figures: list[dict[str, Any]]
    nights: list[dict[str, Any]]
    retrain: bool
    retrain_reason: str | None
    over_in_a_row: dict[str, int]


class Replayed(Answer):
    """The processors run again, beside what they published then (docs/how-to/replay.md); at most a hundred differences."""

    machine: MachineName
    equal: bool
    compared: int
    differences: list[dict[str, Any]]
    descriptions: list[dict[str, Any]]
    seconds: float
    speed: float
    sha256: str
    processors: list[dict[str, Any]]
