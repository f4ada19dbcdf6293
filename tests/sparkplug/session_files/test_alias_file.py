"""The aliases on the disk: the same ones after any restart, and a cost that grows with what is new."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from sparkplug.datatype import DataType
from sparkplug.edge_session import Aliases, EdgeNodeSession
from sparkplug.metric import MetricSpec, NodeId
from sparkplug.session_files.alias_file import AliasFile

KEYS = [(None, "bdSeq"), ("mill", "load"), ("mill", "Ω\n"), ("lathe", "load")]
ALIASES: Aliases = {key: alias for alias, key in enumerate(KEYS, start=1)}


def kept(file: Path, *tables: Aliases) -> Aliases:
    writer = AliasFile(file)
    writer.read()
    for table in tables:
        writer.keep(table)
    return AliasFile(file).read()


def test_what_is_kept_is_read_again(tmp_path: Path) -> None:
    file = tmp_path / "new" / "aliases"
    grown = [dict(list(ALIASES.items())[:count]) for count in range(len(KEYS) + 1)]
    assert kept(file, *grown) == ALIASES
    assert kept(file, {**ALIASES, ("drill", "load"): 5}) == {**ALIASES, ("drill", "load"): 5}
    assert len(file.read_text().splitlines()) == 5


def test_a_file_of_before_is_read_and_goes_on_in_the_new_form(tmp_path: Path) -> None:
    file = tmp_path / "aliases"
    file.write_text(json.dumps(KEYS))
    assert AliasFile(file).read() == ALIASES
    assert kept(file, {**ALIASES, ("drill", "load"): 5}) == {**ALIASES, ("drill", "load"): 5}
    file.write_text("[]")
    assert kept(file, ALIASES) == ALIASES


def test_a_row_that_was_torn_is_left_out_wherever_it_was_cut(tmp_path: Path) -> None:
    file = tmp_path / "aliases"
    kept(file, ALIASES)
    whole = file.read_bytes()
    for end in range(len(whole)):
        file.write_bytes(whole[:end])
        try:
            whole[:end].decode()
        except UnicodeDecodeError:
            continue  # a letter in two: said, and begun again, as below
        read = AliasFile(file).read()
        assert read == dict(list(ALIASES.items())[: whole[:end].count(b"\n")])
        assert kept(file, {**read, ("new", "one"): len(read) + 1}) == {**read, ("new", "one"): len(read) + 1}


@pytest.mark.parametrize("text", ["{}\n", "[1, 2]\n", '["a", "b"]\n["a", "b"]\n', "\udcff", "[" * 100_000, "[[1]]", "x\n"])
def test_a_file_that_is_none_is_said_and_replaced(tmp_path: Path, text: str, caplog: pytest.LogCaptureFixture) -> None:
    file = tmp_path / "aliases"
    file.write_bytes(text.encode("utf-8", "surrogateescape"))
    expected = "" if text == "[" * 100_000 else "no aliases can be read"  # no line of it was written to its end
    assert AliasFile(file).read() == {}
    assert expected in caplog.text
    assert kept(file, ALIASES) == ALIASES


def test_a_thousand_devices_are_written_once_each(tmp_path: Path) -> None:
    """The bytes written grow with the devices, and not with their square."""
    file, session = AliasFile(tmp_path / "aliases"), EdgeNodeSession(NodeId("cnc", "edge"))
    written: list[int] = []
    add, replace = file._add, file._replace

    def counted_add(path: Path, aliases: Aliases, new: int) -> None:
        written.append(new)
        add(path, aliases, new)

    def counted_replace(path: Path, aliases: Aliases) -> None:
        written.append(len(aliases))
        replace(path, aliases)

    file._add, file._replace = counted_add, counted_replace  # type: ignore[method-assign]
    for device in range(1000):
        session.declare_device(f"mill-{device}", [MetricSpec("load", DataType.DOUBLE), MetricSpec("feed", DataType.DOUBLE)], 1)
        file.keep(session.aliases)
        file.keep(session.aliases)  # on each tick
    assert sum(written) == len(session.aliases) == 2000


def test_where_the_disk_fails_the_table_is_written_whole_later(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    file = tmp_path / "aliases"
    keeper = AliasFile(file)
    keeper.keep(ALIASES)
    file.unlink()
    file.mkdir()
    grown = {**ALIASES, ("drill", "load"): 5}
    keeper.keep(grown)
    keeper.keep(grown)
    assert caplog.text.count("cannot be kept") <= 2
    file.rmdir()
    keeper.keep(grown)
    assert AliasFile(file).read() == grown
