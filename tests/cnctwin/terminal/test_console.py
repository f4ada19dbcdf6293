"""Standard output: a table in a pipe is as wide as the reader asks for."""

import pytest

from cnctwin.terminal.console import WIDTH_ELSEWHERE, standard_output


@pytest.mark.parametrize(
    ("columns", "width"), [("150", 150), ("60", 60), ("", WIDTH_ELSEWHERE), ("wide", WIDTH_ELSEWHERE), (None, WIDTH_ELSEWHERE)]
)
def test_a_pipe_is_as_wide_as_columns_says(columns: str | None, width: int, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("COLUMNS", raising=False)
    monkeypatch.setenv("TERM", "dumb")
    if columns is not None:
        monkeypatch.setenv("COLUMNS", columns)
    assert standard_output().width == width
