"""current.json: which version counts, and which is kept warm."""

from pathlib import Path

import pytest

from twin.models.errors import PointerError
from twin.models.pointer import Pointer, pointer_of, resolve, seconds, warm

FOLDER = Path("models/residual/vmc")
TEXT = Pointer("new", "old", "2026-11-22T00:10:00Z", "2026-11-24T00:10:00Z", "it won").text


def test_what_was_written_is_read_back() -> None:
    assert pointer_of(TEXT) == Pointer("new", "old", "2026-11-22T00:10:00Z", "2026-11-24T00:10:00Z", "it won")


def test_a_folder_without_a_pointer_is_the_model_itself() -> None:
    assert resolve(FOLDER, None) == FOLDER and warm(FOLDER, None, 0.0) is None


def test_the_champion_counts_and_the_one_before_is_warm_for_48_hours() -> None:
    promoted_s = seconds("2026-11-22T00:10:00Z")
    assert resolve(FOLDER, TEXT) == FOLDER / "new"
    assert warm(FOLDER, TEXT, promoted_s) == FOLDER / "old"
    assert warm(FOLDER, TEXT, promoted_s + 48 * 3600 - 1) == FOLDER / "old"
    assert warm(FOLDER, TEXT, promoted_s + 48 * 3600) is None


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("", "is not JSON"),
        ("[]", "holds no object"),
        ("{}", "champion is None"),
        ('{"champion": ""}', "champion is ''"),
        ('{"champion": "../../etc"}', "champion is '../../etc'"),
        ('{"champion": ".."}', "champion is '..'"),
        ('{"champion": "a", "previous": 3}', "previous is 3"),
        ('{"champion": "a", "warm_until": "soon"}', "warm_until is 'soon'"),
        ('{"champion": "a", "warm_until": 5}', "warm_until is 5"),
        ('{"champion": "%s"}' % ("a" * 201), "champion is"),
        ("[" * 100_000, "is not JSON"),
    ],
)
def test_a_pointer_that_names_no_folder_beside_it_is_refused(text: str, said: str) -> None:
    with pytest.raises(PointerError, match=r"current\.json") as raised:
        resolve(FOLDER, text)
    assert said in str(raised.value) and "\n" not in str(raised.value)
