"""docs/reference/http.md: every route of the HTTP interface, from its OpenAPI document."""

from typing import Any

from cnctwin.api.application import create_app
from cnctwin.api.live.plant import LivePlant
from cnctwin.api.sources import Sources

HEAD = """\
# HTTP routes

For whoever writes a program against `cnctwin serve`: every route with its parameters. Examples, and who may ask, are on [the HTTP interface](api.md); a running
server has the same as `/openapi.json`, with the shapes of all answers, and as a page at `/routes`. This page is written by `scripts/reference`.
"""


def page() -> str:
    """Return the page: routes in the order of the document."""
    lines = [HEAD]
    for path, methods in create_app(Sources(LivePlant())).openapi()["paths"].items():
        for method, route in methods.items():
            lines += [f"## {method.upper()} {path}\n", " ".join(route.get("description", "").split()) + "\n"]
            if route.get("parameters"):
                lines += ["| parameter | in | meaning |", "|---|---|---|", *map(_row, route["parameters"]), ""]
    return "\n".join(lines).rstrip() + "\n"


def _row(one: dict[str, Any]) -> str:
    meaning = one.get("description", "") or one.get("schema", {}).get("description", "")
    need = "" if one.get("required") else "; may be left out"
    return f"| `{one['name']}` | {one['in']}{need} | {' '.join(meaning.split())} |".replace("\\|", "|")
