"""The table: a line for each method, and below it recall and delay by kind, new programs, false alerts by occasion."""

from collections import Counter
from collections.abc import Callable, Iterator, Sequence

import numpy as np

from benchmarks.evaluation.events import Detections, delays_s, false_alerts_a_week, recall
from benchmarks.evaluation.intervals import share
from benchmarks.evaluation.range_based import range_based
from benchmarks.scored.judged import OCCASIONS, Judged, is_kind
from benchmarks.simulated_cell.fault import SIZES, Fault, FaultKind, Overlap
from twin.intervals import Estimate, bootstrapped

SOON_S = 60.0


def of_faults(parts: Sequence[Judged], wanted: Callable[[Fault], bool]) -> list[Detections]:
    """Return the detections of some faults only, of each machine."""
    return [part.of(wanted) for part in parts]


def row(parts: Sequence[Judged], rng: np.random.Generator) -> dict[str, str]:
    """A line of the table."""
    large = of_faults(parts, lambda fault: fault.size >= 1.0)
    delays = delays_s(large)

    def mean(figure: Callable[[Judged], float]) -> Callable[[Sequence[Judged]], float]:
        return lambda some: float(np.nanmean([figure(part) for part in some])) if some else float("nan")

    measured = [range_based(part.events, part.alarms) for part in parts]
    precise = bootstrapped([one.precision for one in measured if has_figure(one.precision)], _mean, rng)
    recalled = bootstrapped([one.recall for one in measured if has_figure(one.recall)], _mean, rng)
    return {
        "false/week": str(false_alerts_a_week([part.detections for part in parts])),
        **{f"size {size:g}": str(recall(of_faults(parts, lambda fault, size=size: fault.size == size))) for size in SIZES},
        **{
            f"≥1 {overlap.value}": str(recall(of_faults(parts, lambda f, o=overlap: f.size >= 1.0 and f.overlap is o)))
            for overlap in Overlap
        },
        "≥1 within 60 s": str(soon(large)),
        "delay s": f"{np.median(delays):.0f}" if delays else "-",
        "range P": str(precise),
        "range R": str(recalled),
        "VUS-PR": str(bootstrapped(parts, mean(lambda part: part.vus), rng)),
        "no threshold": str(sum(not part.has_threshold for part in parts)),
    }


def soon(parts: Sequence[Detections]) -> Estimate:
    """Share of the faults that were found within a minute."""
    every = [delay for part in parts for delay in part.delays_s]
    return share(sum(delay is not None and delay <= SOON_S for delay in every), len(every))


def _mean(some: Sequence[float]) -> float:
    return float(np.mean(some))


def has_figure(value: float) -> bool:
    """Return False for NaN."""
    return not np.isnan(value)


def details(parts: Sequence[Judged]) -> Iterator[str]:
    """Recall by kind and size with the median delay, new programs from their second part on, false alerts by occasion."""
    for kind in FaultKind:
        every = of_faults(parts, is_kind(kind))
        if not any(one.delays_s for one in every):
            continue
        sizes = [recall(of_faults(parts, is_kind(kind, size))) for size in SIZES]
        late = delays_s(of_faults(parts, lambda fault, kind=kind: fault.kind is kind and fault.size >= 1.0))
        shown = "  ".join(
            f"{size:g}: {estimate}" for size, estimate in zip(SIZES, sizes, strict=True) if has_figure(estimate.value)
        )
        yield f"  {kind.value:14s} {shown}  ≥1 median delay {np.median(late):.0f} s" if late else f"  {kind.value:14s} {shown}"
    later = [part.of(lambda fault: fault.size >= 1.0, lambda where: where.is_new and where.number >= 1) for part in parts]
    yield f"  new program, from its second part, ≥1: {recall(later)} of {sum(len(one.delays_s) for one in later)}"
    counted = Counter(name for part in parts for name in part.false)
    yield "  false alerts: " + ", ".join(f"{name} {counted[name]}" for name in OCCASIONS)
