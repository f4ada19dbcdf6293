"""Common mode: the published rule to the letter, the residual, and that the stream and arrays agree to the bit."""

import subprocess
import sys

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from twin.anomaly.common_mode import Adjusted, CommonModeRule, Method, adjust_frame, adjust_frames

PUBLISHED = {
    # own raw, is own gated, peers' raw, are peers gated, factor: adjusted, common mode
    "alone": (0.2, False, [], [], 0.5, 0.2, False),
    "peers are normal": (0.2, False, [-0.1, -0.2], [False, False], 0.5, 0.2, False),
    "one peer at exactly the factor": (0.2, False, [0.1, -0.2], [False, False], 0.5, 0.0, True),
    "a peer just below the factor": (0.2, False, [0.0999, -0.2], [False, False], 0.5, 0.2, False),
    "a peer that is worse": (0.2, False, [0.9], [False], 0.8, 0.0, True),
    "raw of 0 is no disturbance": (0.0, False, [0.5], [False], 0.5, 0.0, False),
    "raw below 0 stays as it is": (-0.05, False, [0.5], [False], 0.5, -0.05, False),
    "raw below 0 with a peer below it": (-0.05, False, [-0.01], [False], 0.5, -0.05, False),
    "gated": (0.2, True, [-0.1], [False], 0.5, 0.0, False),
    "gated below 0": (-0.2, True, [-0.1], [False], 0.5, 0.0, False),
    "gated and common": (0.2, True, [0.2], [False], 0.5, 0.0, True),
    "a peer that is not known": (0.2, False, [None, -0.1], [False, False], 0.5, 0.2, False),
    "a gated peer hides the fault": (0.2, False, [0.4, -0.1], [True, False], 0.5, 0.0, True),
    "the own score is not known": (None, False, [0.4], [False], 0.5, None, False),
    "a factor above 1": (0.2, False, [0.25], [False], 1.5, 0.2, False),
}


def first_of(rule: CommonModeRule, own: float | None, is_gated: bool, peers: list, are_peers_gated: list[bool]) -> Adjusted:
    """Return the first machine of a frame, judged beside its peers."""
    return adjust_frame(rule, [own, *peers], [is_gated, *are_peers_gated])[0]


@pytest.mark.parametrize("case", PUBLISHED.values(), ids=PUBLISHED.keys())
def test_the_published_rule_to_the_letter(case: tuple) -> None:
    own, is_gated, peers, are_gated, factor, adjusted, is_common = case
    judged = first_of(CommonModeRule(factor=factor), own, is_gated, peers, are_gated)
    assert (judged.score, judged.is_common) == (adjusted, is_common)


@pytest.mark.parametrize("excludes", [False, True])
def test_a_peer_in_its_own_tool_change_hides_a_fault_unless_gated_peers_are_left_out(excludes: bool) -> None:
    rule = CommonModeRule(factor=0.5, exclude_gated_peers=excludes)
    faulty, changing, quiet, _ = adjust_frame(rule, [0.2, 0.5, -0.1, -0.1], [False, True, False, False])
    assert faulty.score == (0.2 if excludes else 0.0)
    assert faulty.is_common is not excludes
    assert (faulty.peer, faulty.peers) == ((2, 2) if excludes else (1, 3))
    assert changing.score == 0.0
    assert quiet.score == -0.1


RESIDUAL = {
    # own z, peers' z, are peers gated: adjusted, common mode
    "alone": (6.0, [], [], 6.0, False),
    "one peer: it is the centre": (6.0, [5.0], [False], 1.0, True),
    "two peers: the largest": (6.0, [0.0, 5.0], [False, False], 1.0, True),
    "three peers: the median": (6.0, [0.0, 1.0, 50.0], [False] * 3, 5.0, False),
    "four peers: mean of the middle two": (6.0, [0.0, 1.0, 2.0, 50.0], [False] * 4, 4.5, False),
    "four peers, one gated: the median of three": (6.0, [0.0, 1.0, 2.0, 50.0], [False, False, False, True], 5.0, False),
    "quiet peers prove nothing": (6.0, [-3.0, -3.0, -3.0], [False] * 3, 6.0, False),
    "a fault in a disturbance keeps its size": (16.0, [10.0, 9.0, 11.0], [False] * 3, 6.0, True),
    "unknown peers do not count": (6.0, [None, None, 1.0], [False] * 3, 5.0, False),
}


@pytest.mark.parametrize("case", RESIDUAL.values(), ids=RESIDUAL.keys())
def test_the_residual(case: tuple) -> None:
    own, peers, are_gated, adjusted, is_common = case
    judged = first_of(CommonModeRule(Method.RESIDUAL), own, False, peers, are_gated)
    assert (judged.score, judged.is_common) == (adjusted, is_common)
    assert first_of(CommonModeRule(Method.RESIDUAL), own, True, peers, are_gated).score == 0.0


RULES = [
    CommonModeRule(),
    CommonModeRule(factor=0.8, exclude_gated_peers=True),
    CommonModeRule(Method.RESIDUAL),
]
ONE = st.one_of(st.none(), st.floats(-5, 5), st.sampled_from([0.0, 0.25, 0.5, 1.0]))
FRAMES = st.integers(1, 6).flatmap(
    lambda machines: st.lists(
        st.lists(st.tuples(ONE, st.booleans()), min_size=machines, max_size=machines), min_size=1, max_size=5
    )
)


@pytest.mark.parametrize("rule", RULES, ids=lambda rule: f"{rule.method}-{rule.exclude_gated_peers}")
@given(frames=FRAMES)
def test_the_stream_and_arrays_agree_to_the_bit(rule: CommonModeRule, frames: list[list[tuple[float | None, bool]]]) -> None:
    scores = np.array([[np.nan if score is None else score for score, _ in frame] for frame in frames])
    adjusted, common = adjust_frames(rule, scores, np.array([[gated for _, gated in frame] for frame in frames]))
    for row, frame in enumerate(frames):
        judged = adjust_frame(rule, [score for score, _ in frame], [gated for _, gated in frame])
        told = np.array([np.nan if one.score is None else one.score for one in judged])
        assert np.array_equal(told, adjusted[row], equal_nan=True)
        assert [one.is_common for one in judged] == common[row].tolist()


@given(scores=st.lists(st.floats(-5, 5), min_size=1, max_size=8), factor=st.floats(0.01, 2.0))
def test_the_published_rule_never_raises_a_score(scores: list[float], factor: float) -> None:
    for one, raw in zip(adjust_frame(CommonModeRule(factor=factor), scores, [False] * len(scores)), scores, strict=True):
        assert one.score in (raw, 0.0)


def test_a_factor_that_makes_everything_common_is_refused() -> None:
    with pytest.raises(ValueError, match="factor is 0"):
        CommonModeRule(factor=0.0)


def test_the_stream_needs_no_numpy() -> None:
    asked = "import sys, twin.anomaly.common_mode, twin.anomaly.alarm; sys.exit('numpy' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", asked], check=False).returncode == 0
