"""Vibration from raw blocks of acceleration: rms, velocity for the ISO zones, peak, crest factor, kurtosis, each over a window.

A block is an array metric, `vibration_block_g`, stamped with the time of its last sample; the next one is stamped its own length
later. Blocks are filtered as one stream (twin.vibration). A block that is lost, late by half its length, clipped, dead, of wrong
rate or length, or not of finite numbers breaks the stream: the figures are null with the reason, the filters start again, and the
first `settle_s` after it is not counted. A block longer than the window is a window.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Self

from pydantic import Field, NonNegativeFloat, PositiveFloat, PositiveInt, model_validator

from processors.config import ProcessorConfig
from processors.contract import Output, OutputSpec, Processor, Provenance, Sample, SampleKind
from processors.sample import why_unknown
from sparkplug.datatype import DataType
from twin.vocabulary import twin_signals
from twin.vocabulary.signals import VIBRATION_BLOCK_G, VIBRATION_SAMPLE_RATE_HZ

if TYPE_CHECKING:  # numpy is loaded with the first block
    from twin.vibration import Floats, Tally

BLOCK, RATE = VIBRATION_BLOCK_G, VIBRATION_SAMPLE_RATE_HZ
RMS, VELOCITY, PEAK = twin_signals.VIBRATION_RMS_G, twin_signals.VIBRATION_VELOCITY_MM_S, "twin/vibration_peak_g"
CREST, KURTOSIS = twin_signals.VIBRATION_CREST_FACTOR, twin_signals.VIBRATION_KURTOSIS
NAMES = (RMS, VELOCITY, PEAK, CREST, KURTOSIS)
RATE_HZ_MAX = 200_000.0
RATE_BANDS_MIN = 4.0
"""The same as in twin.vibration, which is not loaded before there is a block."""
BLOCK_MS_MIN = 10.0
"""The loss of a shorter block could not be seen from stamps in milliseconds."""
SAMPLES_MAX = 1_000_000
RATE_TOLERANCE = 0.01
LATE_KEPT = 0.9
"""The share of the sum of latenesses kept from block to block: stamps that are 5 % off their rate, block by block, are seen."""
AT_FULL_SCALE = 0.999
NUMBERS = frozenset({float, int})
G_MAX = 100_000.0
"""No accelerometer reaches it."""


class Config(ProcessorConfig):
    """The sensor and the band.

    sample_rate_hz: where no metric says it; block_samples: where every block has to be so long
    full_scale_g: of the sensor; a block that reaches it is clipped. Without it, clipping is not seen
    """

    sample_rate_hz: PositiveFloat | None = None
    block_samples: PositiveInt | None = None
    full_scale_g: PositiveFloat | None = None
    window_s: float = Field(default=1.0, ge=0.1, le=60.0)
    settle_s: NonNegativeFloat = 0.5
    silence_s_max: PositiveFloat = 5.0
    band_low_hz: PositiveFloat = 10.0
    band_high_hz: PositiveFloat = 1000.0

    @model_validator(mode="after")
    def _band_is_one(self) -> Self:
        if self.band_low_hz >= self.band_high_hz:
            raise ValueError(f"band_low_hz {self.band_low_hz:g} is not below band_high_hz {self.band_high_hz:g}")
        return self


@dataclass(frozen=True, slots=True)
class State:
    """The stream as far as it has come.

    rate_hz, stamp_ms, block_ms: rate, stamp and length of the last block; without a stamp the next block begins a stream
    late_ms: how far stamps are behind what the rate says, as a sum that forgets: jitter cancels in it, a wrong rate adds up
    acceleration, velocity: states of the filters; unsettled: samples that are still to be left out
    tally: of the present window, as twin.vibration.Tally holds it, flat
    why_not: what stands in place of figures, "" while there are some
    """

    rate_hz: float | None = None
    stamp_ms: int | None = None
    block_ms: float = 0.0
    late_ms: float = 0.0
    acceleration: tuple[tuple[float, float], ...] = ()
    velocity: tuple[tuple[float, float], ...] = ()
    unsettled: int = 0
    tally: tuple[float, ...] = ()
    why_not: str = f"no {BLOCK} yet"


def step(config: Config, state: State, sample: Sample) -> tuple[State, Sequence[Output]]:
    """Take a block in; say so where none comes any more."""
    if sample.kind is SampleKind.HOLE:
        return _broken(sample.detail)
    reading = sample.row.get(BLOCK)
    if reading is None:
        return _broken(f"{BLOCK} is not offered") if sample.kind is SampleKind.BIRTH else (state, ())
    if sample.kind is SampleKind.TICK:
        silent_ms = max(1000.0 * config.silence_s_max, 2.5 * state.block_ms)
        if state.stamp_ms is not None and 1000.0 * sample.at_s - state.stamp_ms > silent_ms:
            return _broken(f"no block for {silent_ms / 1000.0:g} s")
        return state, ()
    if (unknown := why_unknown(reading)) is not None:
        return (state, ()) if state.why_not == unknown else _broken(unknown)
    if BLOCK not in sample.changed or reading.timestamp_ms == state.stamp_ms:
        return state, ()
    rate_hz, no_rate = _rate(config, state, sample)
    if rate_hz is None:
        return _broken(no_rate)
    samples_g, no_samples = _samples(config, reading.value, rate_hz)
    if samples_g is None:
        return _broken(no_samples)
    return _streamed(config, state, samples_g, rate_hz, reading.timestamp_ms)


def _broken(reason: str) -> tuple[State, tuple[Output, ...]]:
    """No stream, and null figures that say why."""
    return State(why_not=reason), tuple(Output.null(name, reason) for name in NAMES)


def _rate(config: Config, state: State, sample: Sample) -> tuple[float | None, str]:
    """The sample rate: that of the metric, else the configured one; None with the reason."""
    rate_hz, reason = sample.number(RATE)
    if rate_hz is None:
        rate_hz = config.sample_rate_hz
    if rate_hz is None:
        return None, f"{reason}, and no sample_rate_hz is configured"
    least_hz = RATE_BANDS_MIN * config.band_high_hz
    if not least_hz <= rate_hz <= RATE_HZ_MAX:
        return None, f"the sample rate is outside {least_hz:g} to {RATE_HZ_MAX:g} Hz"
    is_same = state.rate_hz is not None and abs(rate_hz - state.rate_hz) <= RATE_TOLERANCE * state.rate_hz
    return (state.rate_hz if is_same else rate_hz), ""


def _samples(config: Config, value: object, rate_hz: float) -> tuple["Floats | None", str]:
    """The samples of a block in g; None with the reason."""
    import numpy as np  # noqa: PLC0415

    if not isinstance(value, tuple) or not NUMBERS.issuperset(map(type, value)):
        return None, f"{BLOCK} is no array of numbers"
    count, least = len(value), max(2, round(rate_hz * BLOCK_MS_MIN / 1000.0))
    if config.block_samples is not None and count != config.block_samples:
        return None, f"{BLOCK} has not the {config.block_samples} samples that are configured"
    if not least <= count <= SAMPLES_MAX:
        return None, f"{BLOCK} is shorter than {BLOCK_MS_MIN:g} ms or longer than {SAMPLES_MAX} samples"
    samples_g = np.array(value, dtype=np.float64)
    largest_g = float(np.abs(samples_g).max())  # NaN, where one is
    if not largest_g < G_MAX:
        return None, f"{BLOCK} holds what no sensor measures"
    if config.full_scale_g is not None and largest_g >= AT_FULL_SCALE * config.full_scale_g:
        return None, f"{BLOCK} reaches the full scale of {config.full_scale_g:g} g"
    if float(samples_g.min()) == float(samples_g.max()):
        return None, f"all samples of {BLOCK} are the same: is a sensor connected?"
    return samples_g, ""


def _streamed(
    config: Config, state: State, samples_g: "Floats", rate_hz: float, stamp_ms: int
) -> tuple[State, tuple[Output, ...]]:
    """The stream with one block more, and the figures where a window has become full."""
    from twin.vibration import Carried, band, filtered, started  # noqa: PLC0415

    filters = band(rate_hz, config.band_low_hz, config.band_high_hz)
    block_ms = 1000.0 * samples_g.size / rate_hz
    outputs: tuple[Output, ...] = ()
    held: tuple[float, ...] = ()
    late_ms = 0.0
    if state.stamp_ms is not None:
        late_ms = LATE_KEPT * state.late_ms + stamp_ms - (state.stamp_ms + block_ms)
        if reason := _interruption(rate_hz == state.rate_hz, late_ms, block_ms):
            late_ms, (state, outputs) = 0.0, _broken(reason)
    if state.stamp_ms is None:
        carried: Carried = started(filters, float(samples_g[0]))
        unsettled = round(config.settle_s * rate_hz)
    else:
        carried, unsettled, held = Carried(state.acceleration, state.velocity), state.unsettled, state.tally
    carried, acceleration_g, velocity_mm_s = filtered(filters, carried, samples_g)
    skipped = min(unsettled, samples_g.size)
    window = max(1, round(config.window_s * rate_hz))
    tally, full = _windows(held, window, samples_g[skipped:], acceleration_g[skipped:], velocity_mm_s[skipped:])
    if full.moments.samples:
        state, outputs = replace(state, why_not=""), _outputs(full)
    flat = tuple(map(float, (*tally.moments, tally.acceleration, tally.velocity)))
    after = State(rate_hz, stamp_ms, block_ms, late_ms, *carried, unsettled - skipped, flat, state.why_not)
    return after, outputs


def _interruption(is_same_rate: bool, late_ms: float, block_ms: float) -> str:
    """Why this block does not go on from the last one; "" where it does."""
    if not is_same_rate:
        return "the sample rate has changed"
    if late_ms > 0.5 * block_ms:
        return f"{BLOCK}: a block is missing, or its sample rate is lower than it says"
    return f"{BLOCK}: blocks come faster than their sample rate says" if late_ms < -0.5 * block_ms else ""


def _windows(held: tuple[float, ...], window: int, *signals: "Floats") -> tuple["Tally", "Tally"]:
    """The tally of the window that is not full yet, and that of all that have become full."""
    from twin.vibration import Moments, Tally, tallied, together  # noqa: PLC0415

    tally, full = Tally(), Tally()
    if held:
        tally = Tally(Moments(int(held[0]), *held[1:7]), held[7], held[8])
    at, count = 0, signals[0].size
    while at < count:
        end = min(count, at + window - tally.moments.samples)
        tally = together(tally, tallied(*(signal[at:end] for signal in signals)))
        at = end
        if tally.moments.samples == window:
            tally, full = Tally(), together(full, tally)
    return tally, full


def _outputs(tally: "Tally") -> tuple[Output, ...]:
    from twin.vibration import figures  # noqa: PLC0415

    found = figures(tally)
    values = (found.rms_g, found.velocity_mm_s, found.peak_g, found.crest_factor, found.kurtosis)
    return tuple(
        Output.null(name, "nothing shakes") if value is None else Output(name, round(value, 5))
        for name, value in zip(NAMES, values, strict=True)
    )


_DOUBLE, _MEASURED = DataType.DOUBLE, Provenance.MEASURED
PROCESSOR = Processor(
    name="vibration",
    version=1,
    inputs=frozenset({BLOCK, RATE}),
    outputs=(
        OutputSpec(RMS, _DOUBLE, "g", "acceleration in the band, rms of a window", _MEASURED, 0.0005),
        OutputSpec(
            VELOCITY, _DOUBLE, "mm/s", "velocity in the band, rms of a window: what ISO zones are stated in", _MEASURED, 0.005
        ),
        OutputSpec(PEAK, _DOUBLE, "g", "largest acceleration from the mean, of all that the sensor gives", _MEASURED, 0.001),
        OutputSpec(CREST, _DOUBLE, None, "that peak over the rms of the same signal; 1.41 for a sine", _MEASURED, 0.01),
        OutputSpec(
            KURTOSIS, _DOUBLE, None, "4th moment over the square of the 2nd; 1.5 for a sine, 3 for noise", _MEASURED, 0.01
        ),
    ),
    config=Config,
    state=State,
    initial=lambda _: State(),
    step=step,
)
