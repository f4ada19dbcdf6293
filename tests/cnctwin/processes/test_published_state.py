"""States that processes publish, as they come over the wire."""

import pytest

from cnctwin.processes import published_state


@pytest.mark.parametrize("payload", [b"", b"null", b"[]", b"\xff", b"{" * 10, b"[" * 100_000])
def test_what_is_no_state_is_an_empty_one_without_an_age(payload: bytes) -> None:
    state = published_state.parsed(payload)
    assert state == {}
    assert published_state.age_s(state, 90.0) == float("inf")


@pytest.mark.parametrize("at", [None, 7, "", "yesterday", "0001-01-01T00:00:00+23:59"])
def test_a_time_that_is_none_gives_no_age(at: object) -> None:
    assert published_state.age_s({"at": at}, 90.0) == float("inf")
