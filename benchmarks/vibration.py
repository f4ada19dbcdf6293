#!/usr/bin/env python3
"""Measure what one second of raw acceleration at 10 kHz costs, beside scipy's plain band-pass and rms, in one run.

    .venv/bin/python benchmarks/vibration.py [--seconds N] [--block-s S] [--json]

`processor` is the whole fold of processors/vibration.py: tuples of an array metric in, five figures a second out, state carried
as plain numbers. `twin` is what of it filters and adds up. `scipy` is one `sosfilt` (10 to 1000 Hz) and one rms a block: no
velocity, no moments, its state an array. The runs take turns, a second each; each figure is the median of its seconds, CPU
time. Read the ratios.
"""

import argparse
import json
import math
import time
from collections.abc import Callable, Sequence
from statistics import median
from types import MappingProxyType
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.signal import butter, sosfilt

from processors.contract import Sample, SampleKind
from processors.vibration import BLOCK, PROCESSOR, RATE
from sparkplug.metric import Reading
from sparkplug.quality import Quality
from twin.vibration import Tally, band, figures, filtered, started, tallied, together

RATE_HZ = 10_000.0
Blocks = list[NDArray[np.float64]]


def second_of_blocks(block_s: float, number: int) -> Blocks:
    """One second: gravity, 100 Hz, noise."""
    at_s = np.arange(round(RATE_HZ)) / RATE_HZ + number
    signal = 1.0 + 0.2 * np.sin(2.0 * math.pi * 100.0 * at_s) + np.random.default_rng(number).normal(0.0, 0.05, at_s.size)
    return np.array_split(signal, round(1.0 / block_s))


def by_processor() -> Callable[[Sequence[tuple[float, ...]]], object]:
    """The fold, given samples as its engine gives them; they are made before the clock runs, as the decoder makes them."""
    config = PROCESSOR.config()
    state, at_s = PROCESSOR.initial(config), 0.0
    row: dict[str, Reading] = {RATE: Reading(RATE, RATE_HZ, 0, Quality.GOOD, "Hz", None, False)}
    view = MappingProxyType(row)

    def run(blocks: Sequence[tuple[float, ...]]) -> object:
        nonlocal state, at_s
        outputs: object = None
        for block in blocks:
            at_s += len(block) / RATE_HZ
            row[BLOCK] = Reading(BLOCK, block, round(at_s * 1000.0), Quality.GOOD, "g", None, False)
            state, published = PROCESSOR.step(config, state, Sample("vmc", SampleKind.DATA, at_s, view, (BLOCK,)))
            outputs = published or outputs
        return outputs

    return run


def by_twin() -> Callable[[Blocks], object]:
    """Filters, moments, figures."""
    filters = band(RATE_HZ)
    carried = started(filters, 1.0)

    def run(blocks: Blocks) -> object:
        nonlocal carried
        tally = Tally()
        for block in blocks:
            carried, acceleration, velocity = filtered(filters, carried, block)
            tally = together(tally, tallied(block, acceleration, velocity))
        return figures(tally)

    return run


def by_scipy() -> Callable[[Blocks], object]:
    """The plain way: the band's rms."""
    sections = butter(4, (10.0, 1000.0), "bandpass", output="sos", fs=RATE_HZ)
    state = np.zeros((sections.shape[0], 2))

    def run(blocks: Blocks) -> object:
        nonlocal state
        squares = 0.0
        for block in blocks:
            band_g, state = sosfilt(sections, block, zi=state)
            squares += float(np.sqrt(np.mean(band_g * band_g)))
        return squares

    return run


def measure(seconds: int, block_s: float) -> dict[str, float]:
    """CPU seconds for one second of signal, by each."""
    ways: dict[str, Callable[[Any], object]] = {"processor": by_processor(), "twin": by_twin(), "scipy": by_scipy()}
    spent: dict[str, list[float]] = {name: [] for name in ways}
    for number in range(seconds + 2):
        blocks = second_of_blocks(block_s, number)
        tuples = [tuple(block.tolist()) for block in blocks]
        for name, run in ways.items():
            given: Any = tuples if name == "processor" else blocks
            begin = time.process_time()
            run(given)
            spent[name].append(time.process_time() - begin)
    return {name: median(times[2:]) for name, times in spent.items()}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seconds", type=int, default=100)
    parser.add_argument("--block-s", type=float, default=0.1)
    parser.add_argument("--json", action="store_true")
    given = parser.parse_args()
    found = measure(given.seconds, given.block_s)
    if given.json:
        print(json.dumps(found))
        return
    print(f"{'':12}{'ms a second':>14}{'real time / it':>16}{'it / scipy':>12}")
    for name, cpu_s in found.items():
        print(f"{name:12}{1000.0 * cpu_s:14.3f}{1.0 / cpu_s:16,.0f}{cpu_s / found['scipy']:12.2f}")


if __name__ == "__main__":
    main()
