"""The document around a report: one file that is whole by itself.

It may load nothing from anywhere and run nothing but its own script: its policy names style and script by their SHA-256, so that
a machine whose name is `<script>` is only a machine with a strange name.
"""

import base64
import hashlib
from functools import cache
from importlib.resources import files

from cnctwin.reports.gap.markup import Markup, tag


def document(title: str, main: Markup, *, style: str, script: str = "") -> str:
    """The whole page as text, to be written as UTF-8. style, script: by `own_text`; without a script none may run."""
    body = tag("body", main, tag("script", Markup(script)) if script else None)
    return f"<!doctype html>\n{tag('html', _head(title, style, script), body, lang='en')}\n"


def _head(title: str, style: str, script: str) -> Markup:
    scripts = f"script-src '{_hash(script)}'; " if script else ""
    policy = f"default-src 'none'; style-src '{_hash(style)}'; {scripts}img-src data:; base-uri 'none'; form-action 'none'"
    return tag(
        "head",
        tag("meta", charset="utf-8"),
        tag("meta", http_equiv="Content-Security-Policy", content=policy),
        tag("meta", name="viewport", content="width=device-width, initial-scale=1"),
        tag("meta", name="color-scheme", content="light dark"),
        tag("meta", name="referrer", content="no-referrer"),
        tag("title", title),
        tag("style", Markup(style)),
    )


@cache
def own_text(package: str, name: str) -> str:
    """A file of a package of ours; none of them may end the element that it is put in."""
    text = files(package).joinpath(name).read_text(encoding="utf-8")
    assert "</s" not in text and "<!--" not in text, f"{name} would end its own element"
    return text


@cache
def _hash(text: str) -> str:
    return "sha256-" + base64.b64encode(hashlib.sha256(text.encode()).digest()).decode()
