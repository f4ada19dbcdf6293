"""The runner of a page's commands: what it takes for a command, what fits, and that it notices what does not."""

from pathlib import Path

import pytest

from tests.docs.console import Step, Terminals, fits, steps

PAGE = """
Say hello:

```console
$ echo hello
hello
$ true
```

<!-- file name.txt -->
```toml
a = 1
```

<!-- exit 1 -->
```console
$ false
```

```
cnctwin watch
```
"""


def test_commands_and_files_are_found_in_their_order() -> None:
    assert steps(PAGE) == [
        Step("echo hello", "hello\n"),
        Step("true"),
        Step("a = 1\n", note="file name.txt"),
        Step("false", note="exit 1"),
    ]


@pytest.mark.parametrize(
    ("shown", "printed", "fit"),
    [
        ("hello", "hello\n", True),
        ("hello", "hello, you\n", False),
        ("took … s", "took 3.2 s\n", True),
        ("took … s", "took 3.2 min\n", False),
        ("a\n…\nd", "a\nb\nc\nd\n", True),
        ("a\n…\nd", "a\nb\nc\n", False),
        ("| a | 1 |", "|  a  |  1  |", True),
        ("", "", True),
        ("", "a warning", False),
    ],
)
def test_what_is_shown_fits_what_is_printed(shown: str, printed: str, fit: bool) -> None:
    assert fits(shown, printed) is fit


def test_a_page_is_done_in_one_folder_and_a_wrong_line_is_noticed(tmp_path: Path) -> None:
    terminals = Terminals(tmp_path, {"WORD": "hello"}, {"1883": "4711"})
    try:
        terminals.do(Step("port = 1883\n", note="file port.toml"))
        terminals.do(Step("cat port.toml", "port = 1883\n"))
        terminals.do(Step("echo ready; sleep 600", "ready\n", "keeps running"))
        terminals.do(Step("test -e made || { touch made; exit 3; }; echo $WORD", "hello\n", "until shown"))
        terminals.do(Step("echo no; false", "no\n", "exit 1"))
        assert (tmp_path / "port.toml").read_text() == "port = 4711\n"
        with pytest.raises(AssertionError, match="instead of\nbye"):
            terminals.do(Step("echo hello", "bye\n"))
        with pytest.raises(AssertionError, match="ended with"):
            terminals.do(Step("true", "ready\n", "keeps running"))
    finally:
        terminals.close()
