"""The page: all sections in the order in which they are read, its style and its script inside.

The page may load nothing from anywhere and run nothing but its own script: its policy names both by their SHA-256, so that a
machine whose name is `<script>` is only a machine with a strange name.
"""

import base64
import hashlib
from functools import cache
from importlib.resources import files

from cnctwin.gap_report.causes import candidates, causes
from cnctwin.gap_report.heat_map import where
from cnctwin.gap_report.markup import Markup, tag
from cnctwin.gap_report.patterns import patterns
from cnctwin.gap_report.traces import traces
from cnctwin.gap_report.untold import cannot_be_told, judged, next_experiment, notes
from cnctwin.gap_report.verdict import figures, headline
from cnctwin.gap_report.waterfall import how_far
from twin.gap.diagnosis import Diagnosed


def report_html(diagnosed: Diagnosed, title: str) -> str:
    """The whole page as text, to be written as UTF-8.

    title: what was diagnosed, as the case calls it; it is the title of the window as well
    """
    diagnosis = diagnosed.diagnosis
    main = tag(
        "main",
        headline(diagnosis, title),
        figures(diagnosis),
        where(diagnosis),
        traces(diagnosed),
        how_far(diagnosis),
        causes(diagnosis),
        candidates(diagnosis),
        patterns(diagnosis),
        cannot_be_told(diagnosis),
        next_experiment(diagnosis),
        notes(diagnosis),
        judged(diagnosed),
    )
    body = tag("body", main, tag("script", Markup(_own("report.js"))))
    return f"<!doctype html>\n{tag('html', _head(title), body, lang='en')}\n"


def _head(title: str) -> Markup:
    policy = (
        f"default-src 'none'; style-src '{_hash('report.css')}'; script-src '{_hash('report.js')}'; "
        "img-src data:; base-uri 'none'; form-action 'none'"
    )
    return tag(
        "head",
        tag("meta", charset="utf-8"),
        tag("meta", http_equiv="Content-Security-Policy", content=policy),
        tag("meta", name="viewport", content="width=device-width, initial-scale=1"),
        tag("meta", name="color-scheme", content="light dark"),
        tag("meta", name="referrer", content="no-referrer"),
        tag("title", f"{title} – sim-to-real gap"),
        tag("style", Markup(_own("report.css"))),
    )


@cache
def _own(name: str) -> str:
    """A file of this package; none of them may end the element that it is put in."""
    text = files("cnctwin.gap_report").joinpath(name).read_text(encoding="utf-8")
    assert "</s" not in text and "<!--" not in text, f"{name} would end its own element"
    return text


@cache
def _hash(name: str) -> str:
    return "sha256-" + base64.b64encode(hashlib.sha256(_own(name).encode()).digest()).decode()
