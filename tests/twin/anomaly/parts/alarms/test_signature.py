"""The likeness of alarms: its bounds, what 1.0 means, and what it does not look at."""

from hypothesis import given
from hypothesis import strategies as st

from tests.twin.anomaly.parts.alarms.examples import signature
from twin.anomaly.parts.alarms.signature import SHARES_MAX, Share, Signature, envelope, likeness, signature_of

SHARES = st.builds(
    Share, st.sampled_from("abcdefgh"), st.sampled_from(["seconds", "cut"]), st.floats(-50, 50).map(lambda x: round(x, 2))
)
SIGNATURES = st.builds(
    lambda shares, tool: signature_of({(one.signal, one.scale): one for one in shares}.values(), "O1", "O1", tool),
    st.lists(SHARES, max_size=12),
    st.sampled_from([None, 1, 5]),
)


@given(one=SIGNATURES, other=SIGNATURES)
def test_it_is_symmetric_and_within_bounds(one: Signature, other: Signature) -> None:
    assert 0.0 <= likeness(one, other) <= 1.0
    assert likeness(one, other) == likeness(other, one)


@given(one=SIGNATURES)
def test_an_alarm_is_wholly_like_itself(one: Signature) -> None:
    assert likeness(one, one) == (1.0 if one.shares else 0.0)
    assert len(one.shares) <= SHARES_MAX


def test_size_does_not_matter_and_direction_does() -> None:
    assert likeness(signature(3.0, 1.0), signature(12.0, 4.0)) == 1.0
    assert likeness(signature(3.0, 1.0), signature(-3.0, -1.0)) == 0.0


def test_another_scale_of_the_same_signals_is_nearly_as_like() -> None:
    one, other = (signature_of([Share("spindle_load_pct", scale, 3.0)], "O1|T5|1", "O1", 5) for scale in ("seconds", "cut"))
    assert likeness(one, other) == 0.95


@given(one=SIGNATURES, other=SIGNATURES)
def test_an_envelope_has_the_largest_of_both(one: Signature, other: Signature) -> None:
    both = {share[:2]: share.left for share in envelope(one, other).shares}
    for share in one.shares[:1]:
        assert abs(both[share[:2]]) >= abs(share.left)
    assert envelope(one, other).largest >= max(one.largest, other.largest / 1.1) - 1e-9
    assert envelope(one, one) is one


def test_another_tool_or_program_is_less_like() -> None:
    own = signature()
    assert likeness(own, signature(tool=6)) == likeness(own, signature(program="O2")) == 0.9
    assert likeness(own, signature(tool=6, program="O2")) == 0.8


def test_what_is_not_known_is_left_out() -> None:
    assert signature_of([Share("a", "cut", float("nan")), Share("b", "cut", float("inf"))], "O1", None, None).shares == ()
