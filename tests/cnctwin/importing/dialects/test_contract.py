"""Every dialect, discovered, with the sample that is named as its module: recognised by it alone, whole, cut and spoiled."""

import random
from pathlib import Path

import pyarrow as pa
import pytest

from cnctwin.errors import UsageError
from cnctwin.importing.column_map import FileOptions
from cnctwin.importing.dialects import contract
from cnctwin.importing.dialects.contract import Dialect, Piece
from cnctwin.importing.dialects.discovery import dialect_of, discover, read_head

SAMPLES = Path(__file__).parent / "samples"
MODULES = {
    path.stem
    for path in Path(contract.__file__).parent.glob("*.py")
    if "DIALECT = " in path.read_text() and path.stem != "contract"
}


def sample_of(module: str) -> Path:
    (found,) = SAMPLES.glob(f"{module}.*")
    return found


def pieces_of(dialect: Dialect, path: Path) -> list[Piece]:
    return list(dialect.reads(path, read_head(path), FileOptions()).pieces())


def test_each_dialect_has_a_sample_and_each_sample_a_dialect() -> None:
    assert {path.stem for path in SAMPLES.iterdir()} == MODULES
    assert len(discover()) == len(MODULES) == len({dialect.name for dialect in discover()})


@pytest.mark.parametrize("module", sorted(MODULES))
def test_a_sample_is_recognised_by_its_own_dialect_and_by_no_other_that_is_sure(module: str) -> None:
    head = read_head(sample_of(module))
    sure = [dialect for dialect in discover() if not dialect.is_fallback and dialect.recognises(head)]
    found = dialect_of(sample_of(module), head)
    assert sure == ([] if found.is_fallback else [found])
    assert __import__(f"cnctwin.importing.dialects.{module}", fromlist=["DIALECT"]).DIALECT is found


@pytest.mark.parametrize("module", sorted(MODULES))
def test_pieces_have_the_columns_that_the_content_names_and_can_be_read_again(module: str) -> None:
    path = sample_of(module)
    dialect = dialect_of(path, read_head(path))
    content = dialect.reads(path, read_head(path), FileOptions())
    assert len({column.name for column in content.columns}) == len(content.columns)
    rows = 0
    for piece in content.pieces():
        assert [*piece.values] == [column.name for column in content.columns if column.track == piece.track]
        assert len({len(values) for values in piece.values.values()}) == 1
        rows += len(next(iter(piece.values.values())))
    assert rows >= 3
    for number, track in enumerate(content.tracks):
        assert track.column is None or any(c.name == track.column and c.track == number for c in content.columns)
    again = [piece.values for piece in content.pieces()]
    assert list(again) == [piece.values for piece in pieces_of(dialect, path)]


@pytest.mark.parametrize("module", sorted(MODULES))
def test_a_file_that_is_cut_or_spoiled_is_read_as_far_as_it_goes_or_refused_in_one_line(module: str, tmp_path: Path) -> None:
    whole = sample_of(module).read_bytes()
    chance = random.Random(20)
    outcomes = set()
    for trial in range(60):
        spoiled = bytearray(whole[: chance.randrange(1, len(whole))] if trial % 2 else whole)
        for _ in range(trial % 5):
            spoiled[chance.randrange(len(spoiled))] = chance.randrange(256)
        path = tmp_path / "spoiled"
        path.write_bytes(spoiled)
        try:
            head = read_head(path)
            read = pieces_of(dialect_of(path, head), path)
        except UsageError as error:
            assert "\n" not in str(error)
            outcomes.add("refused")
            continue
        assert all(isinstance(values, pa.Array) for piece in read for values in piece.values.values())
        outcomes.add("read")
    assert "read" in outcomes
