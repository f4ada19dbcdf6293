"""The documentation at /docs/, where `scripts/docs` has built it; else a page that says so."""

from pathlib import Path
from typing import Any

from fastapi import FastAPI, Request
from fastapi.responses import HTMLResponse, RedirectResponse, Response
from starlette.staticfiles import StaticFiles

from cnctwin.page import SITE

POLICY = (
    "default-src 'self'; script-src 'self' 'unsafe-inline'; style-src 'self' 'unsafe-inline'; img-src 'self' data:; "
    "object-src 'none'; base-uri 'none'; form-action 'self'; frame-ancestors 'none'"
)
"""The site's Content-Security-Policy: its theme keeps light or dark by a script in the page; nothing comes from elsewhere."""
NOT_BUILT = (
    '<!doctype html><html lang="en"><head><meta charset="utf-8"><title>cnctwin</title></head><body>'
    "<h1>The documentation is not built here</h1><p>Run <code>scripts/docs</code> in the folder of the project, and load this "
    "page again. The same pages are Markdown in its folder <code>docs</code>.</p></body></html>"
)


class SiteFiles(StaticFiles):
    """The site's files; a browser asks each time whether they have changed."""

    def file_response(self, *arguments: Any, **options: Any) -> Response:
        """Return the file, with the site's policy."""
        response = super().file_response(*arguments, **options)
        response.headers.update({"Cache-Control": "no-cache", "Content-Security-Policy": POLICY})
        return response


def serve_documentation(app: FastAPI, site: Path = SITE) -> None:
    """Serve the site at /docs/; /docs leads there."""
    files = SiteFiles(directory=site, html=True, check_dir=False)

    @app.get("/docs", include_in_schema=False)
    async def docs() -> Response:
        return RedirectResponse("docs/")

    @app.get("/docs/{path:path}", include_in_schema=False)
    async def page(path: str, request: Request) -> Response:
        if not (site / "index.html").is_file():
            return HTMLResponse(NOT_BUILT, 404)
        return await files.get_response(path or "index.html", request.scope)
