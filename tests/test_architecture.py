"""docs/explanation/architecture.md is true: every path on it is there, and every room of the house is on it."""

import re
from pathlib import Path

import pytest

ROOT = Path(__file__).parent.parent
PAGE = (ROOT / "docs" / "explanation" / "architecture.md").read_text(encoding="utf-8")
PATH = re.compile(r"`((?:sparkplug|twin|edge|processors|cnctwin|tests|docs)/[\w./-]*(?:/|\.\w+))`")
LINK = re.compile(r"\]\(([\w./-]+)\)")
WAYS = ("The way of a sample", "The way of a recording", "The way of an alert")


def paths() -> list[str]:
    """Every path that the page names in code, but patterns such as `processors/<name>.py`."""
    return sorted(set(PATH.findall(PAGE)))


@pytest.mark.parametrize("path", paths())
def test_a_path_of_the_page_is_there(path: str) -> None:
    assert (ROOT / path).exists()


def test_links_of_the_page_lead_somewhere() -> None:
    assert [link for link in LINK.findall(PAGE) if not (ROOT / "docs" / "explanation" / link).exists()] == []


@pytest.mark.parametrize("way", WAYS)
def test_each_way_names_the_files_that_it_passes(way: str) -> None:
    section = PAGE.split(f"## {way}\n")[1].split("\n## ")[0]
    files = [path for path in PATH.findall(section) if Path(path).suffix]
    assert len(files) >= 10


@pytest.mark.parametrize("package", ["cnctwin", "cnctwin/memory"])
def test_every_room_is_in_the_picture(package: str) -> None:
    picture = PAGE.split("```")[1]
    rooms = [one.name for one in (ROOT / package).iterdir() if (one / "__init__.py").exists()]
    assert [room for room in rooms if not re.search(rf"\b{room}\b", picture)] == []
