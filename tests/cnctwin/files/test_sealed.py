"""A sealed text opens only with its own salt and text, and only its owner may read it before."""

import json
import stat
from pathlib import Path

import pytest

from cnctwin.files.sealed import SealError, read_sealed, seal, write_sealed


def test_a_file_gives_back_what_was_sealed(tmp_path: Path) -> None:
    sealed = seal('{"added": 1}')
    write_sealed(sealed, tmp_path / "sealed.json")
    assert read_sealed(tmp_path / "sealed.json") == sealed
    assert stat.S_IMODE((tmp_path / "sealed.json").stat().st_mode) == 0o600
    assert [path.name for path in tmp_path.iterdir()] == ["sealed.json"]


@pytest.mark.parametrize("key", ["text", "salt", "sha256"])
def test_a_file_that_was_changed_is_refused(tmp_path: Path, key: str) -> None:
    path = tmp_path / "sealed.json"
    write_sealed(seal("one"), path)
    path.write_text(json.dumps(json.loads(path.read_text()) | {key: "other"}))
    with pytest.raises(SealError, match="not those that were sealed"):
        read_sealed(path)


@pytest.mark.parametrize("text", [None, "", "[]", "{}"])
def test_a_file_that_holds_nothing_sealed_is_refused_by_name(tmp_path: Path, text: str | None) -> None:
    path = tmp_path / "sealed.json"
    if text is not None:
        path.write_text(text)
    with pytest.raises(SealError, match=r"sealed\.json: holds nothing sealed"):
        read_sealed(path)
