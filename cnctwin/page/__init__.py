"""The page: hand-written HTML, CSS and ES modules, uPlot beside its licence. No build step; it loads nothing from elsewhere."""

from pathlib import Path

WEB = Path(__file__).parent / "web"
"""The files that are served: `index.html` at `/`, the folder at `/page/`."""
SITE = Path(__file__).parent / "site"
"""The documentation as `scripts/docs` builds it, served at `/docs/`; it is missing where nobody has built it."""
