"""What an hour has to hold, each as a function that lists what does not hold.

The truth is what the adapter told, by time stamp, and what the agent stored of it, by instance and sequence number.
"""

import re
from bisect import bisect_left, bisect_right
from collections import defaultdict
from collections.abc import Iterator

from cnctwin.standins.mtconnect_agent.stamp import stamp_text
from cnctwin.standins.simulated_control.state import ToolChange, states, tool_changes
from edge.controls.mtconnect.documents import timestamp_ms
from edge.sample import EMPTY, UNAVAILABLE, EdgeSample
from tests.edge.controls.changes_told import changes_told
from tests.edge.controls.mtconnect.agent_hour import SWITCHED_ON_S, Hour

KEYS = {
    "spindle_rpm": "Srpm",
    "spindle_load_pct": "Sload",
    "spindle_temp_c": "Stemp",
    "spindle_override_pct": "Sovr",
    "feed_mm_min": "Fact",
    "feed_override_pct": "Fovr",
    "rapid_override_pct": "Frapidovr",
    "program": "program",
    "nc_block": "block",
    "nc_line": "line",
    "exec_state": "execution",
    "controller_mode": "mode",
    "tool_number": "Tool_number",
    "coolant_on": "coolant",
    "ambient_temp_c": "room_temp",
} | {
    f"axis_{letter}_{name}": f"{letter.upper()}{key}"
    for letter in "xyz"
    for name, key in (("pos_mm", "abs"), ("load_pct", "load"))
}
"""By signal, what the machine's adapter calls it."""
DEBOUNCE_S = 2.0
TOLERANCE_S = 0.002  # two stamps in whole milliseconds
FEED_TOLERANCE_MM_MIN = 0.01  # the agent converts it to mm/s, and the edge back
_RESTARTED = re.compile(r"agent restarted: instance (\d+) ended somewhere after sequence (\d+)")
Told = dict[str, list[tuple[int, str]]]


def told_by_key(hour: Hour) -> Told:
    """Each text that the machine's adapter told, by key, with its time stamp in ms."""
    told: Told = defaultdict(list)
    for moment in hour.moments:
        at_ms = timestamp_ms(stamp_text(SWITCHED_ON_S + moment.at_s))
        assert at_ms is not None
        for key, text in moment.values.items():
            told[key].append((at_ms, text.upper()))
    return told


def _texts(told: Told, key: str, at_ms: int) -> set[str]:
    """Return what stood at this time; several where several were told in one millisecond."""
    after = bisect_right(told[key], (at_ms, "\uffff"))
    last = told[key][max(after - 4, 0) : after]
    return {text for told_ms, text in last if told_ms == at_ms} or {last[-1][1]}


def _is_value(signal: str, value: object, reason: str | None, text: str) -> bool:
    if text == "":
        return value is None and (reason or "").startswith(EMPTY)
    if isinstance(value, bool):
        return value == (text == "ON")
    if isinstance(value, int | float):
        return abs(value - float(text)) <= (FEED_TOLERANCE_MM_MIN if signal == "feed_mm_min" else 1e-9)
    return value == text


def true_instance(instance: str) -> str:
    """Which life of the agent it was, where the number on the way was made another's."""
    return "1" + instance[1:]


def values_that_were_not_told(hour: Hour) -> Iterator[str]:
    """Taken samples that are not what the agent stored under that number, or not what the adapter had told by then."""
    told = told_by_key(hour)
    for instance, sample in hour.taken:
        stored = hour.observations[true_instance(instance)].get(sample.sequence)
        if stored is None or timestamp_ms(stored.timestamp) != sample.timestamp_ms:
            yield f"{sample} of instance {instance}: the agent has {stored}"
        elif (stored.item.name or "") != KEYS.get(sample.signal):
            yield f"{sample} is of {stored.item.name}"
        elif stored.is_unavailable:
            if (sample.value, sample.reason) != (None, UNAVAILABLE):
                yield f"{sample}, and it was unavailable"
        elif not any(
            _is_value(sample.signal, sample.value, sample.reason, text)
            for text in _texts(told, KEYS[sample.signal], sample.timestamp_ms)
        ):
            yield f"{sample}: told was {_texts(told, KEYS[sample.signal], sample.timestamp_ms)}"


def values_published_that_were_not_taken(hour: Hour) -> list[EdgeSample]:
    """Published values of signals of the machine for which there is no such observation."""
    taken = {(sample.signal, sample.timestamp_ms, sample.value) for _, sample in hour.taken}
    return [
        sample
        for sample in hour.published
        if sample.observations and (sample.signal, sample.timestamp_ms, sample.value) not in taken
    ]


def lost(hour: Hour) -> list[dict[str, range]]:
    """For each hole, the sequence numbers of each life of the agent that it covers."""
    covered = []
    for hole in hour.holes:
        instance, first = true_instance(hole.instance), hole.gap.first_sequence
        ranges = {}
        if found := _RESTARTED.fullmatch(hole.gap.reason):
            before, ended = true_instance(found[1]), int(found[2])
            if before == instance:  # it only looked like another, and its numbers went on
                first = ended + 1
            else:
                ranges[before] = range(ended + 1, max(hour.observations[before]) + 1)
        covered.append(ranges | {instance: range(first, hole.gap.last_sequence + 1)})
    return covered


def observations_neither_taken_nor_in_a_hole(hour: Hour) -> Iterator[str]:
    """What the agent stored of this machine since the edge joined, and the edge neither took nor stated as lost."""
    covered: dict[str, list[range]] = defaultdict(list)
    for ranges in lost(hour):
        for instance, numbers in ranges.items():
            covered[instance].append(numbers)
    taken: dict[str, set[int]] = defaultdict(set)
    for instance, sample in hour.taken:
        taken[true_instance(instance)].add(sample.sequence)
    for instance, sequences in hour.documented.items():
        mapped = hour.observations[true_instance(instance)]
        taken[true_instance(instance)] |= {number for number in sequences if mapped[number].item.name not in KEYS.values()}
    joined, first = hour.joined
    for instance, stored in hour.observations.items():
        for sequence, observation in stored.items():
            if sequence in taken[instance] or (instance == joined and sequence < first):
                continue
            if not any(sequence in numbers for numbers in covered[instance]):
                yield f"{observation} of instance {instance}"


def observations_taken_twice(hour: Hour) -> Iterator[str]:
    """Sequence numbers that gave two samples; a baseline after a hole may show what lies before it and in it."""
    seen, holes = set[tuple[str, int]](), hour.holes
    for instance, sample in hour.taken:
        number = sample.sequence
        if (instance, number) in seen and not (
            sample.is_baseline
            and any(hole.instance == instance and hole.gap.first_sequence <= number <= hole.gap.last_sequence for hole in holes)
        ):
            yield f"{sample} of instance {instance}"
        seen.add((instance, number))


def holes_that_state_too_little(hour: Hour) -> list[str]:
    """Holes in which more of their instance was lost than they say."""
    taken = {(instance, sample.sequence) for instance, sample in hour.taken}
    found = []
    for hole in hour.holes:
        numbers = range(hole.gap.first_sequence, hole.gap.last_sequence + 1)
        stored = hour.observations[true_instance(hole.instance)]
        documented = hour.documented.get(hole.instance, set())
        missing = sum((hole.instance, number) not in taken and number not in documented for number in numbers if number in stored)
        if missing > hole.gap.lost:
            found.append(f"{hole}: {missing} are missing")
    return found


def unseen_s(hour: Hour) -> list[tuple[float, float]]:
    """Times of which nothing can be known: holes, by the stamps around them, and the agent without its adapter.

    What happened so shortly before that it had not stood for `debounce_s` yet is not known either.
    """
    unseen = list(hour.without_adapter)
    for ranges in lost(hour):
        stamps = {
            stored.timestamp
            for instance, numbers in ranges.items()
            for number in range(numbers.start - 1, numbers.stop)
            if (stored := hour.observations[instance].get(number)) is not None
        }
        times = [_at_s(stamp) for stamp in stamps]
        unseen += [(min(times), max(times))] if times else []
    return [(from_s - DEBOUNCE_S, to_s) for from_s, to_s in unseen]


def _at_s(text: str) -> float:
    at_ms = timestamp_ms(text)
    assert at_ms is not None
    return at_ms / 1000 - SWITCHED_ON_S


def true_changes(hour: Hour) -> list[ToolChange]:
    """All changes of the machine that were over before the end."""
    return [change for change in tool_changes(states(hour.moments)) if change.to_s < hour.moments[-1].at_s - 3.0]


def changes_seen(hour: Hour) -> list[ToolChange]:
    """The true changes that no hole touches."""
    unseen = unseen_s(hour)
    return [change for change in true_changes(hour) if not any(a <= change.to_s and change.from_s <= b for a, b in unseen)]


def changes_told_wrongly(hour: Hour) -> list[str]:
    """Changes that were seen and not told once, with the time stamps that the machine gave them."""
    told, found = changes_told(hour.published, SWITCHED_ON_S), []
    for change in changes_seen(hour):
        overlapping = [(a, b) for a, b in told if a <= change.to_s and change.from_s <= b]
        if len(overlapping) != 1 or not _fits(change, *overlapping[0]):
            found.append(f"{change} was told as {overlapping}")
    return found


def _fits(change: ToolChange, from_s: float, to_s: float) -> bool:
    return abs(from_s - change.from_s) <= TOLERANCE_S and abs(to_s - change.to_s) <= TOLERANCE_S


def changes_made_up(hour: Hour) -> list[str]:
    """Changes told, or parts of them, that lie neither in a true one nor in a hole."""
    covered = sorted([*unseen_s(hour), *((change.from_s, change.to_s) for change in tool_changes(states(hour.moments)))])
    covered += [(hour.moments[-1].at_s - 3.0, float("inf"))]
    found = []
    for told_from_s, to_s in changes_told(hour.published, SWITCHED_ON_S):
        at_s = told_from_s
        for a, b in covered:
            if a <= at_s + TOLERANCE_S:
                at_s = max(at_s, b + TOLERANCE_S) if b >= at_s - TOLERANCE_S else at_s
        if at_s < to_s or at_s == told_from_s:
            found.append(f"{told_from_s:.2f} to {to_s:.2f}, nothing of the kind at {at_s:.2f}")
    return found


def tools_told_wrongly(hour: Hour) -> list[str]:
    """Changes that were seen, and after which another number stands than that of the tool that came in."""
    numbers = [sample for sample in hour.published if sample.signal == "tool_number"]
    times = [sample.timestamp_ms / 1000 - SWITCHED_ON_S for sample in numbers]
    found = []
    for change in changes_seen(hour):
        at = bisect_left(times, change.to_s + TOLERANCE_S) - 1
        if at < 0 or numbers[at].value != change.tool_number or abs(times[at] - change.to_s) > TOLERANCE_S:
            found.append(f"{change}: told {numbers[at]}")
    return found
