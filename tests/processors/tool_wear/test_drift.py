"""The drift of the machine: batches come and go without an alarm, what stays is told, with the command that names its cause."""

import json
from random import Random

from processors.tool_wear.config import Config
from processors.tool_wear.drift import Drift, after_part, in_values, in_words, is_drifting
from twin.wear.joint import MATERIAL, Joint, renewed
from twin.wear.machine import Wear

CONFIG = Config(healthy_blocks=60)
BLOCK_S = CONFIG.block_h * 3600.0


def after(blocks: int, *, drift: float = 0.0, from_block: int = 0, anchors: int = 3, seed: int = 1) -> tuple[Drift, int | None]:
    """Return the drift after so many blocks of twenty parts and two batches each, and the block in which it alarmed first."""
    chance, found, told = Random(seed), Drift(), None
    for block in range(blocks):
        for part in range(20):
            if part % 10 == 0:
                batch = chance.gauss(0.0, 0.03)
            level = batch + (drift if block >= from_block else 0.0)
            at_s = BLOCK_S * (block + part / 20.0)
            found = after_part(CONFIG, found, Wear(joint=renewed(Joint(), MATERIAL, level, 1e-6), at_s=at_s, anchors=anchors))
        if told is None and is_drifting(CONFIG, found)[0]:
            told = block
    return found, told


def test_a_healthy_machine_is_silent() -> None:
    assert [after(500, seed=seed)[1] for seed in range(4)] == [None] * 4


def test_a_drift_that_stays_is_told_with_the_command() -> None:
    found, told = after(180, drift=0.06, from_block=100)
    assert told is not None
    assert 100 <= told < 130
    words = in_words(CONFIG, found, "vmc")
    assert "risen since 1970-02-0" in words
    assert "cnctwin gap case --store STORE --machine vmc" in words
    values = json.loads(in_values(found))
    assert 4.0 < values["pct"] < 9.0
    assert f"by {values['pct']:+.1f} % lately" in words
    assert values["since"] == 1000 * found.chart.since_s
    assert in_values(after(70)[0]) == "{}"


def test_before_the_healthy_blocks_nothing_is_judged() -> None:
    found, _ = after(30)
    drifts, reason = is_drifting(CONFIG, found)
    assert drifts is None
    assert "being learned" in reason


def test_parts_without_sharp_tools_tell_nothing() -> None:
    assert after(100, anchors=1)[0].baseline.blocks == 0
