"""A preview of an edge for OPC UA: one connection, one read of each node, the same parser as in operation, no broker."""

import asyncio
import time
from collections.abc import Coroutine
from typing import Any, TypeVar

from edge.adapter import Row
from edge.controls.opcua.config import Config
from edge.controls.opcua.cursor import parse, start
from edge.controls.opcua.library import require
from edge.errors import ConnectionLostError
from edge.sweep import Fact, Sweep

T = TypeVar("T")
AT_ONCE = 100


def describe(config: Config) -> list[Row]:
    """Return what would be published for the server that the configuration names; a row of its own where nothing is encrypted."""
    require()
    facts = run(_read(config))
    sweep = Sweep("check", 0, round(time.time() * 1000), facts)
    _, found = parse(config, start(config), sweep.encode())
    last = {sample.signal: sample for sample in found.samples}
    rows = []
    for offer in found.offers or ():
        sample = last.get(offer.signal)
        value, reason = (None, "not reported yet") if sample is None else (sample.value, sample.reason)
        rows.append(Row(offer.signal, offer.source, offer.declared.unit, offer.native_unit, value, reason))
    if config.source.security == "none":
        warning = 'opcua.security = "none": anyone in between can read and alter what the control says'
        rows.append(Row("(warning)", config.source.url, "", "", None, warning))
    return rows


def run(work: Coroutine[Any, Any, T]) -> T:
    """The result of this work, in a loop of its own."""
    return asyncio.run(work)


async def _read(config: Config) -> tuple[Fact, ...]:
    from edge.controls.opcua import resolve, session  # noqa: PLC0415  asyncua is an extra

    async with session.opened(config) as client:
        try:
            return await read_all(config, client, await resolve.resolve(config, client))
        except session.FAILURES as error:
            raise ConnectionLostError(session.one_line(config, error)) from error


async def read_all(config: Config, client: Any, nodes: Any) -> tuple[Fact, ...]:
    """One value of each node, those that are not there with the reason."""
    from edge.controls.opcua import plain, session  # noqa: PLC0415  asyncua is an extra

    facts = [Fact(one.key, fault=one.fault) for one in nodes if one.node is None]
    there = [one for one in nodes if one.node is not None]
    for begin in range(0, len(there), AT_ONCE):
        some = there[begin : begin + AT_ONCE]
        values = await session.read_values(client, [one.node for one in some])
        facts += [
            plain.as_fact(one.key, value, element=one.point.element, stamps=config.source.timestamps)
            for one, value in zip(some, values, strict=True)
        ]
    return tuple(facts)
