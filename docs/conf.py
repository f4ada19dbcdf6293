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
LINK = re.compile(r"\[([^\]\n]+)\]\(((?:\.\./)+(?!\w+:)[^)#\s]+)\)")
DOCS = Path(__file__).parent


def adapt(_app: Any, docname: str, source: list[str]) -> None:
    """Take what a Git host shows as it stands to a site: an index page's list is its sidebar, and a folder of the code has no page."""
    page = (DOCS / docname).parent
    source[0] = LINK.sub(lambda found: f"`{found[1]}`" if (page / found[2]).is_dir() else found[0], source[0])
    if docname.rpartition("/")[2] == "index":
        pages = "\n".join(dict.fromkeys(LISTED.findall(source[0])))
        source[0] += f"\n```{{toctree}}\n:hidden:\n\n{pages}\n```\n"


def setup(app: Any) -> dict[str, bool]:
    """Read each page through `adapt`."""
    app.connect("source-read", adapt)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
