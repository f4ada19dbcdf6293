"""A file that a person keeps has one key changed, and nothing else."""

import tomllib
from pathlib import Path

import pytest

from cnctwin.errors import UsageError
from cnctwin.setting_up.toml_text import with_key, without_table

FILE = Path("edge.toml")
TEXT = """# The lathe in hall 2.
[machine]
name = "lathe"

# Moved here in May.
[mtconnect]   # by the agent
url = "http://old:5000"   # ask Ada
count = 500

[signals.feed_mm_min]
data_item = "F # 1"
"""


def test_a_value_is_changed_and_its_comment_stays() -> None:
    changed = with_key(TEXT, "mtconnect", "url", "http://new:5000", FILE)
    assert changed == TEXT.replace('"http://old:5000"', '"http://new:5000"')


def test_a_value_with_a_sign_of_a_comment_in_it_is_a_value() -> None:
    assert with_key(TEXT, "signals.feed_mm_min", "data_item", "G", FILE) == TEXT.replace('"F # 1"', '"G"')


def test_a_key_is_added_at_the_end_of_its_table() -> None:
    changed = with_key(TEXT, "machine", "lost_after_s", 10.0, FILE)
    assert changed == TEXT.replace('name = "lathe"\n', 'name = "lathe"\nlost_after_s = 10.0\n')


def test_a_table_is_added_at_the_end() -> None:
    changed = with_key(TEXT, "broker", "url", "mqtt://b", FILE)
    assert changed == TEXT + '\n[broker]\nurl = "mqtt://b"\n'


def test_a_table_goes_and_the_comment_of_the_next_one_stays() -> None:
    assert without_table(TEXT, "machine", FILE) == TEXT.replace('[machine]\nname = "lathe"\n\n', "").replace(
        "2.\n# Moved", "2.\n\n# Moved"
    )


def test_what_is_not_there_need_not_be_removed() -> None:
    assert without_table(TEXT, "broker", FILE) == TEXT


@pytest.mark.parametrize(
    "text",
    [
        'machine = { name = "a" }\n',
        '[machine]\nname = """a\nb"""\n',
        '[ "machine" ]\nname = "a"\n',
    ],
    ids=["inline", "several lines", "quoted"],
)
def test_what_cannot_be_edited_is_refused_and_never_spoilt(text: str) -> None:
    try:
        changed = with_key(text, "machine", "name", "b", FILE)
    except UsageError as error:
        assert "by hand" in str(error)
    else:
        assert tomllib.loads(changed) == {"machine": {"name": "b"}}


def test_a_file_that_is_no_toml_is_refused() -> None:
    with pytest.raises(UsageError, match=r"edge\.toml: is not TOML"):
        with_key("[machine", "machine", "name", "b", FILE)
