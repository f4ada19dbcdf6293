"""Measure what vibration at the edge costs: one sensor's stream through the fold, beside scipy's filter on the same samples.

    python -m benchmarks.edges.accelerometer [--seconds 20]

Prints the share of one core (CPU time over the signal's own time) for each sample rate: the frame's decoding, and the fold with
all that it gives. The processor's filter (numpy, scipy) does the same work in the same run.
"""

import argparse
import math
import random
import time

import numpy as np

from edge.accelerometer.fold import State, step
from edge.accelerometer.frame import Block, Frames, encode
from edge.accelerometer.section import AccelerometerSection, Publish
from twin import vibration


def stream(rate_hz: float, seconds: float) -> list[Block]:
    """Noise and a sine on gravity, in blocks of 0.1 s."""
    chance, size = random.Random(1), round(rate_hz / 10.0)
    level = [1.0 + 0.4 * math.sin(0.05 * number) + chance.gauss(0.0, 0.1) for number in range(size)]
    return [Block(number, rate_hz, 1 + number * 100_000, tuple(level)) for number in range(round(seconds * 10.0))]


def shares(rate_hz: float, seconds: float) -> tuple[float, float, float]:
    """Decoding, fold and scipy, each as a share of a core."""
    sent = stream(rate_hz, seconds)
    wires = [encode(block) for block in sent]
    began_s = time.process_time()
    frames = Frames()
    blocks = [block for wire in wires for block in frames.feed(wire)]
    decoded_s = time.process_time()
    section, state = AccelerometerSection(publish=Publish.BOTH), State()
    for block in blocks:
        state, _ = step(section, state, block, 0.0)
    folded_s = time.process_time()
    filters = vibration.band(rate_hz)
    carried = vibration.started(filters, blocks[0].samples_g[0])
    for block in blocks:
        samples_g = np.array(block.samples_g)
        carried, acceleration, velocity = vibration.filtered(filters, carried, samples_g)
        vibration.tallied(samples_g, acceleration, velocity)
    scipy_s = time.process_time()
    return (decoded_s - began_s) / seconds, (folded_s - decoded_s) / seconds, (scipy_s - folded_s) / seconds


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seconds", type=float, default=20.0)
    seconds = parser.parse_args().seconds
    print(f"{'rate':>10}{'decoding':>12}{'fold':>12}{'scipy':>12}   share of a core")
    for rate_hz in (5_120.0, 10_000.0, 25_600.0, 51_200.0):
        decoding, fold, scipy = shares(rate_hz, seconds)
        print(f"{rate_hz:8.0f}Hz{decoding:12.2%}{fold:12.2%}{scipy:12.2%}")


if __name__ == "__main__":
    main()
