"""GET /figures: OEE, stops, parts and energy by machine, shift, part or program, as JSON or as CSV."""

from typing import Annotated, Any, Literal

from fastapi import APIRouter, Query
from fastapi.responses import Response

from cnctwin.api.answers import Figures
from cnctwin.api.errors import ApiError
from cnctwin.api.routes.history import MS_MAX
from cnctwin.api.routes.plant import BUSY, UNKNOWN, unknown_machine
from cnctwin.api.samples import samples_of
from cnctwin.api.sources import Sources
from cnctwin.figures.comma_separated import to_csv
from cnctwin.figures.documents import read_records
from cnctwin.figures.table import Asked, By, table, time_zone_of
from sparkplug.clock import now_ms
from twin.vocabulary.twin_signals import PRODUCTION, PRODUCTION_NOW

DAY_MS = 86_400_000
MACHINE_DAYS_MAX = 400
ROWS_MAX = 5000
NOTHING = "the processor production has published nothing of this stretch; `cnctwin figures` folds the store itself"

FromMs = Annotated[int | None, Query(alias="from", ge=0, le=MS_MAX, description="ms since 1970; else a day before `to`")]
ToMs = Annotated[int | None, Query(alias="to", ge=0, le=MS_MAX, description="ms since 1970; else now")]


def figure_routes(sources: Sources) -> APIRouter:
    """The route."""
    router = APIRouter(tags=["history"])
    csv = {"content": {"text/csv": {}}, "description": "The rows; as CSV with `format=csv`"}

    @router.get("/figures", response_model=Figures, responses={200: csv, **UNKNOWN, **BUSY})
    async def figures(
        machine: Annotated[str | None, Query(description="One machine; without it, all", max_length=200)] = None,
        from_ms: FromMs = None,
        to_ms: ToMs = None,
        by: Annotated[By, Query(description="The rows")] = By.SHIFT,
        format: Annotated[Literal["json", "csv"], Query(description="JSON, or CSV to download")] = "json",  # noqa: A002
    ) -> Any:
        """OEE by ISO 22400-2 with its parts, stops by reason, parts and energy: of shifts that begin, and parts that end, in
        [from, to). At most 400 machine-days. What is not known is null; `why` says the reason."""
        end_ms = now_ms() if to_ms is None else to_ms
        start_ms = max(end_ms - DAY_MS, 0) if from_ms is None else from_ms
        machines = await _machines(sources, machine)
        if not 0 < (end_ms - start_ms) * max(len(machines), 1) <= MACHINE_DAYS_MAX * DAY_MS:
            raise ApiError(
                400,
                f"from {start_ms} to {end_ms} of {len(machines)} machines is no stretch of at most {MACHINE_DAYS_MAX} "
                "machine-days; give a shorter one, or one machine",
            )
        texts = [text for name in machines for text in await _records(sources, name, start_ms, end_ms)]
        rows, refused, time_zone = await sources.store.work(lambda: _rows(texts, Asked(by, start_ms, end_ms)))
        left_out = max(len(rows) - ROWS_MAX, 0)
        rows = rows[left_out:]
        if format == "csv":
            name = f'attachment; filename="figures-{by}.csv"'
            return Response(to_csv(rows, by), media_type="text/csv", headers={"Content-Disposition": name})
        head = {"from": start_ms, "to": end_ms, "by": str(by), "time_zone": time_zone, "left_out": left_out, "refused": refused}
        return {**head, "note": "" if rows else NOTHING, "rows": rows}

    return router


def _rows(texts: list[str], asked: Asked) -> tuple[list[dict[str, Any]], int, str]:
    shifts, parts, refused = read_records(texts)
    return table(shifts, parts, asked), refused, time_zone_of(shifts)


async def _machines(sources: Sources, machine: str | None) -> list[str]:
    """Return the machines that are asked for. Raises ApiError where one is not known."""
    known = set(sources.live.machines())
    if sources.store.configured and machine not in known:
        known |= set(await sources.store.ask(lambda store: store.machines()))
    if machine is not None and machine not in known:
        raise unknown_machine(machine, sorted(known))
    return sorted(known) if machine is None else [machine]


async def _records(sources: Sources, machine: str, from_ms: int, to_ms: int) -> list[str]:
    """Return what `production` has published: a shift tells of itself within a day after it began; and the shift that runs."""
    found, _ = await samples_of(sources, machine, (PRODUCTION,), from_ms, min(to_ms + DAY_MS, MS_MAX))
    texts = [one.value for one in found.get(PRODUCTION, ()) if isinstance(one.value, str)]
    now = sources.live.readings(machine).get(PRODUCTION_NOW) if machine in sources.live.machines() else None
    return [now.value, *texts] if now is not None and isinstance(now.value, str) else texts
