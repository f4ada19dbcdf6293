"""docs/how-to/recording.md is true: its map can be read, its paths are there, and its table is that of the catalogue."""

import re
from pathlib import Path

from cnctwin.importing.column_map import read_map
from twin.effects.catalogue import catalogue

ROOT = Path(__file__).parents[3]
PAGE = (ROOT / "docs" / "how-to" / "recording.md").read_text(encoding="utf-8")


def test_the_map_of_the_page_is_one(tmp_path: Path) -> None:
    (text,) = re.findall(r"```toml\n(.*?)```", PAGE, re.S)
    (tmp_path / "columns.toml").write_text(text, encoding="utf-8")
    assert set(read_map(tmp_path / "columns.toml").columns) == set(re.findall(r"(?m)^\[columns\.(\w+)\]", text))


def test_each_effect_stands_beside_the_columns_in_which_it_shows() -> None:
    effects = catalogue()
    told: dict[str, tuple[str, ...]] = {}
    for columns, names in re.findall(r"(?m)^\| (`[^|]*`) \| (`[^|]*`) \|$", PAGE.split("## What a recording can tell")[1]):
        told |= dict.fromkeys(re.findall(r"`(\w+)`", names), tuple(re.findall(r"`([^`]+)`", columns)))
    assert told == {effect.name: tuple(effect.shows_in) for effect in effects.values()}


def test_paths_and_links_of_the_page_lead_somewhere() -> None:
    assert [path for path in re.findall(r"`(cnctwin/[\w./]+)`", PAGE) if not (ROOT / path).exists()] == []
    links = re.findall(r"\]\(([\w./-]+)", PAGE)
    assert links and all((ROOT / "docs" / "how-to" / link).exists() for link in links)
