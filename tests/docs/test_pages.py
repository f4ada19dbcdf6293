"""The pages of docs/: each has a kind and a place in its index, says whom it is for, and its links and anchors lead somewhere."""

import re
from pathlib import Path

import pytest

from tests.test_house_rules import tracked

ROOT = Path(__file__).parents[2]
DOCS = ROOT / "docs"
KINDS = ("tutorials", "how-to", "reference", "explanation", "decisions")
PAGES = sorted(path for kind in KINDS for path in (DOCS / kind).glob("*.md"))
AT_THE_ROOT = {"index.md", "evidence.md"}
LINK = re.compile(r"\]\(((?!\w+:)[^)\s]+)\)")
NAMED = re.compile(r"(?<![\w/.-])docs/[\w./-]+?\.md\b")
FOR_WHOM = re.compile(
    r"\bfor (whoever|anyone|everyone|those|people|programs|readers|looking|two people|a technician|the engineer)\b", re.I
)


def name_of(path: Path) -> str:
    return path.relative_to(ROOT).as_posix()


def anchors(text: str) -> set[str]:
    """Return the anchors that a Git host gives the headings of a page."""
    plain = re.sub(r"^```.*?^```$", "", text, flags=re.MULTILINE | re.DOTALL)
    found: set[str] = set()
    for heading in re.findall(r"^#+ (.*)$", plain, re.MULTILINE):
        slug = re.sub(r"[^\w\- ]", "", re.sub(r"\]\([^)]*\)", "", heading).lower()).strip().replace(" ", "-")
        number = 0
        while (unique := f"{slug}-{number}" if number else slug) in found:
            number += 1
        found.add(unique)
    return found


def broken(path: Path) -> list[str]:
    """Return the links of a page that lead nowhere."""
    found = []
    for link in LINK.findall(re.sub(r"^```.*?^```$", "", path.read_text(encoding="utf-8"), flags=re.MULTILINE | re.DOTALL)):
        file, _, anchor = link.partition("#")
        target = (path.parent / file).resolve() if file else path
        if not target.exists() or (
            anchor and target.suffix == ".md" and anchor not in anchors(target.read_text(encoding="utf-8"))
        ):
            found.append(link)
    return found


def test_a_link_that_leads_nowhere_is_found(tmp_path: Path) -> None:
    page = tmp_path / "page.md"
    page.write_text(
        "# A page: `code`\n## Twice\n## Twice\n[a](#a-page-code) [b](#twice-1) [c](page.md#twice) [d](#thrice) [e](no.md)\n"
    )
    assert broken(page) == ["#thrice", "no.md"]


@pytest.mark.parametrize("page", [ROOT / "README.md", ROOT / "CONTRIBUTING.md", *sorted(DOCS.rglob("*.md"))], ids=name_of)
def test_links_and_anchors_of_a_page_lead_somewhere(page: Path) -> None:
    assert broken(page) == []


def test_every_page_has_a_kind_and_a_place_in_its_index() -> None:
    assert {path.name for path in DOCS.glob("*.md")} <= AT_THE_ROOT
    for kind in KINDS:
        listed = set(re.findall(r"\]\(([\w-]+\.md)\)", (DOCS / kind / "index.md").read_text(encoding="utf-8")))
        assert listed == {path.name for path in (DOCS / kind).glob("*.md")} - {"index.md"}, kind


@pytest.mark.parametrize("page", [path for path in PAGES if path.parent.name != "decisions"], ids=name_of)
def test_a_page_begins_with_whom_it_is_for(page: Path) -> None:
    text = page.read_text(encoding="utf-8")
    first = text.partition("\n")[2].strip().partition("\n\n")[0]
    assert FOR_WHOM.search(first), (
        f"the first paragraph of {name_of(page)} says whom the page is for, and what they have at its end"
    )


def test_a_page_that_a_file_of_the_project_names_is_there() -> None:
    missing = set()
    for path in tracked():
        if (
            path.suffix in {".py", ".toml", ".md", ".js", ".yml", ".conf", ".service", ".acl", ".xml", ".ipynb"}
            or not path.suffix
        ):
            try:
                named = NAMED.findall(path.read_text(encoding="utf-8"))
            except UnicodeDecodeError:
                continue
            missing |= {f"{name_of(path)}: {name}" for name in named if not (ROOT / name).exists()}
    assert missing == set()
