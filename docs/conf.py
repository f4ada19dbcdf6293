"""The documentation as a site, by Sphinx: `scripts/docs` builds it, docs/decisions/0028-the-pages-are-a-site.md says why so."""

import re
from pathlib import Path
from typing import Any

project = "cnctwin"
extensions = ["myst_parser"]
exclude_patterns = ["notebooks", "figures", "pictures"]
html_theme = "furo"
html_title = "cnctwin"
html_favicon = "../cnctwin/page/web/sign.svg"
html_copy_source = False
html_show_copyright = False
html_show_sphinx = False
myst_heading_anchors = 4
highlight_language = "none"  # a block that names no language is a terminal's
LISTED = re.compile(r"^[*|-].*?\]\(((?!\w+:)[^)#\s]+\.md)\)", re.MULTILINE)
OUTSIDE = re.compile(r"\[`?([^\]\n`]+)`?\]\(((?:\.\./)+(?!\w+:)[^)#\s]+)(?:#[^)\s]*)?\)")
NAMES = {"file", "files", "File", "Files", "configuration", "code"}
"""Texts of links that say nothing without the link."""
DOCS = Path(__file__).parent


def adapt(_app: Any, docname: str, source: list[str]) -> None:
    """Make a page of a Git host one of a site: a link to the code is a name, and the list of an index page is the sidebar."""
    page = (DOCS / docname).parent

    def named(found: re.Match[str]) -> str:
        target = (page / found[2]).resolve()
        inside = target.is_relative_to(DOCS)
        return (
            found[0] if inside else f"{found[1]} (`{target.relative_to(DOCS.parent)}`)" if found[1] in NAMES else f"`{found[1]}`"
        )

    source[0] = OUTSIDE.sub(named, source[0])
    if docname.rpartition("/")[2] == "index":
        pages = "\n".join(dict.fromkeys(LISTED.findall(source[0])))
        source[0] += f"\n```{{toctree}}\n:hidden:\n\n{pages}\n```\n"


def setup(app: Any) -> dict[str, bool]:
    """Read each page through `adapt`."""
    app.connect("source-read", adapt)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
