"""Markup: text in which everything that is not markup already has been escaped.

>>> tag("p", "1 < 2", tag("b", "!"), class_="note")
'<p class="note">1 &lt; 2<b>!</b></p>'
"""

import html
import re
from collections.abc import Iterable

VOID = frozenset({"br", "col", "meta"})
_NOT_IN_HTML = re.compile("[^\t\n\x20-\x7e\xa0-\ud7ff\ue000-\ufdcf\ufdf0-\ufffd\U00010000-\U0010fffd]")
"""Control characters, lone surrogates and noncharacters: no page may have them, however they are written."""


class Markup(str):
    """Text that is markup, so that it is not escaped again."""

    __slots__ = ()


def escaped(text: str) -> Markup:
    """The text as markup; a character that no page may have as U+FFFD."""
    return text if isinstance(text, Markup) else Markup(html.escape(_NOT_IN_HTML.sub("\ufffd", str(text)), quote=True))


def joined(parts: Iterable[str | None], between: str = "") -> Markup:
    """The parts one after another, each escaped where it is not markup; None is nothing."""
    return Markup(escaped(between).join(escaped(part) for part in parts if part is not None))


def tag(name: str, /, *inside: str | None, **attributes: str | float | bool | None) -> Markup:
    """An element. An attribute's `_` is written `-`, a last one is dropped (`class_`); None and False leave it out."""
    written = [name]
    for key, value in attributes.items():
        spelled = key.rstrip("_").replace("_", "-")
        if value is True:
            written.append(spelled)
        elif value is not None and value is not False:
            written.append(f'{spelled}="{escaped(f"{value:.6g}" if isinstance(value, float) else str(value))}"')
    opened = f"<{' '.join(written)}>"
    return Markup(opened if name in VOID else f"{opened}{joined(inside)}</{name}>")


def each(name: str, parts: Iterable[str], /, **attributes: str | float | bool | None) -> Markup:
    """The same element around each part."""
    return joined(tag(name, part, **attributes) for part in parts)


def section(identity: str, title: str, lead: str | None, *inside: str | None) -> Markup:
    """A section of the page: its title, what it says in a sentence, and what shows it."""
    return tag(
        "section",
        tag("header", tag("h2", title, id=identity), tag("p", lead, class_="lead") if lead else None),
        *inside,
        aria_labelledby=identity,
    )


def tile(term: str, value: str, meaning: str) -> Markup:
    """A figure that matters: its name, its value, and its meaning in a few words."""
    return tag("div", tag("dt", term), tag("dd", value, class_="value"), tag("dd", meaning, class_="meaning"))


def scrollable(label: str, inside: str) -> Markup:
    """Return markup that may be wider than a small screen; it can be scrolled with the keyboard too."""
    return tag("div", inside, class_="scroll", tabindex="0", role="region", aria_label=label)
