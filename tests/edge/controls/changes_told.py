"""The tool changes that an edge has told in an hour of production, for whatever protocol."""

from collections.abc import Iterable

from edge.sample import EdgeSample


def changes_told(published: Iterable[EdgeSample], switched_on_s: float) -> list[tuple[float, float]]:
    """When `tool_change_active` is true, in the machine's own seconds; one that is open at the end lasts for ever."""
    told, since_s, is_active = list[tuple[float, float]](), 0.0, False
    for sample in published:
        if sample.signal != "tool_change_active":
            continue
        at_s = sample.timestamp_ms / 1000 - switched_on_s
        if is_active and not sample.value:
            told.append((since_s, at_s))
        elif not is_active and sample.value:
            since_s = at_s
        is_active = bool(sample.value)
    return [*told, (since_s, float("inf"))] if is_active else told
