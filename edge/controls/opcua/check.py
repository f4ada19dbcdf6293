"""A preview of an edge for OPC UA: one connection, one read of each node, the alarms of now, the same parser, no broker."""

import asyncio
import contextlib
import time
from collections.abc import Coroutine
from typing import Any, TypeVar

from edge.adapter import Row
from edge.controls.opcua.alarm_samples import Heard, since_text
from edge.controls.opcua.alarm_table import Alarm, listed
from edge.controls.opcua.config import Config
from edge.controls.opcua.cursor import parse, start
from edge.controls.opcua.library import require
from edge.controls.opcua.spindle_tool import index_in_spindle
from edge.errors import ConnectionLostError
from edge.sweep import Fact, Sweep

T = TypeVar("T")
AT_ONCE = 100
REFRESH_S_MAX = 3.0


def describe(config: Config) -> list[Row]:
    """Return what would be published for the server that the configuration names; a row of its own where nothing is encrypted."""
    require()
    facts = run(_read(config))
    sweep = Sweep("check", 0, round(time.time() * 1000), facts)
    cursor, found = parse(config, start(config), sweep.encode())
    last = {sample.signal: sample for sample in found.samples}
    rows = []
    for offer in found.offers or ():
        sample = last.get(offer.signal)
        value, reason = (None, "not reported yet") if sample is None else (sample.value, sample.reason)
        rows.append(Row(offer.signal, offer.source, offer.declared.unit, offer.native_unit, value, reason))
    rows += alarm_rows(cursor.heard)
    if config.source.security == "none":
        warning = 'opcua.security = "none": anyone in between can read and alter what the control says'
        rows.append(Row("(warning)", config.source.url, "", "", None, warning))
    return rows


def alarm_rows(heard: Heard) -> list[Row]:
    """Return the alarms that are there for a person to read."""
    return [_alarm_row(heard.source, alarm) for alarm in listed(heard.table)]


def _alarm_row(source: str, alarm: Alarm) -> Row:
    acknowledged = {True: "acknowledged", False: "not acknowledged", None: "whether it is acknowledged is not told"}
    parts = [
        alarm.text,
        "" if alarm.severity is None else f"severity {alarm.severity}",
        "gone" if alarm.active is False else "active",
        acknowledged[alarm.acknowledged],
        "" if (since := since_text(alarm)) is None else f"since {since}",
    ]
    return Row(f"(alarm) {alarm.code}".strip(), source, "", "", ", ".join(filter(None, parts)), None)


def run(work: Coroutine[Any, Any, T]) -> T:
    """The result of this work, in a loop of its own."""
    return asyncio.run(work)


async def _read(config: Config) -> tuple[Fact, ...]:
    from edge.controls.opcua import resolve, session  # noqa: PLC0415  asyncua is an extra

    async with session.opened(config) as client:
        try:
            values = await read_all(config, client, await resolve.resolve(config, client))
            return (*values, *await read_events(config, client))
        except session.FAILURES as error:
            raise ConnectionLostError(session.one_line(config, error)) from error


async def read_events(config: Config, client: Any) -> tuple[Fact, ...]:
    """Return the alarms that are there, as the events of a refresh; or why they cannot be had."""
    from edge.controls.opcua import event_session, session  # noqa: PLC0415  asyncua is an extra

    published: list[Any] = []
    some = asyncio.Event()

    def heard(result: Any) -> None:
        published.append(result.NotificationMessage.NotificationData or ())
        some.set()

    watched = await session.watch(config, client, (), REFRESH_S_MAX, heard)
    listening = await event_session.listen(config, client, watched.subscription)
    if listening is None:
        return ()
    watch = event_session.EventWatch(client, watched.subscription, listening, time.monotonic)
    facts = [watch.about, *filter(None, (await watch.tick(),))]
    end_s = time.monotonic() + REFRESH_S_MAX
    while watch.is_waiting and (left_s := end_s - time.monotonic()) > 0:
        with contextlib.suppress(TimeoutError):
            await asyncio.wait_for(some.wait(), left_s)
        some.clear()
        while published:
            facts += watch.facts(published.pop(0))
    return (*facts, event_session.refresh_fault("it does not end")) if watch.is_waiting else tuple(facts)


async def read_all(config: Config, client: Any, nodes: Any) -> tuple[Fact, ...]:
    """One value of each node, those that are not there with the reason; then those of the tool in the spindle."""
    from edge.controls.opcua import life_reader, plain, session, tool_reader  # noqa: PLC0415  asyncua is an extra

    facts = await session.unit_facts(config, client, [(one.key, one.node) for one in nodes if one.node is not None])
    facts += [Fact(one.key, fault=one.fault) for one in nodes if one.node is None]
    there = [one for one in nodes if one.node is not None]
    for begin in range(0, len(there), AT_ONCE):
        some = there[begin : begin + AT_ONCE]
        values = await session.read_values(client, [one.node for one in some])
        facts += [
            plain.as_fact(one.key, value, element=one.point.element, stamps=config.source.timestamps)
            for one, value in zip(some, values, strict=True)
        ]
    namespaces = await client.get_namespace_array()
    tools = tool_reader.ToolReader(config, client, namespaces, time.monotonic)
    tools.heard(facts)
    cursor, _ = parse(config, start(config), Sweep("check", 0, 1, tuple(facts)).encode())
    life = life_reader.LifeReader(client, nodes, namespaces, time.monotonic)
    of_life = await life.tick(index_in_spindle(cursor.tools, config.source.spindle_place))
    return (*facts, *await tools.tick(), *of_life)
