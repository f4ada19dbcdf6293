"""The difference of the two programs, as `diff -u` has it: what goes begins with −, what comes with +, whatever the colour."""

from cnctwin.reports.gap.markup import Markup, joined, section, tag
from cnctwin.reports.optimisation.headline import counted
from cnctwin.reports.optimisation.quantity import shortened
from twin.optimisation.answer import Optimised

LINES_MAX = 300
BYTES_MAX = 50_000
WIDTH_MAX = 160
_KIND = (("+++", "file"), ("---", "file"), ("@@", "hunk"), ("+", "comes"), ("-", "goes"))


def difference(answer: Optimised) -> Markup:
    """The section."""
    given = answer.diff.splitlines()
    title = "What changes in the program"
    if not given:
        return section("diff", title, "Nothing: the program stays as it is, letter for letter.")
    comes = sum(kind_of(line) == "comes" for line in given)
    goes = sum(kind_of(line) == "goes" for line in given)
    changed, more = min(comes, goes), comes - goes
    parted = [f"{counted(changed, 'line')} changed"] if changed or not more else []
    if more:
        parted.append(f"{counted(abs(more), 'line')} {'added' if more > 0 else 'removed'}")
    lead = f"{', '.join(parted)}; what is not shown here stays as it was, letter for letter."
    shown = _within(given)
    parts = [tag("pre", joined(shown, "\n"), class_="diff", tabindex="0", role="region", aria_label="Difference of the programs")]
    if len(given) > len(shown):
        text = (
            f"{len(given) - len(shown):,} of {len(given):,} lines of the difference are left out here; "
            "it is whole in the answer's JSON, under diff, and the rewritten program is a file of its own."
        )
        parts.append(tag("p", text, class_="note cut"))
    return section("diff", title, lead, *parts)


def _within(given: list[str]) -> list[Markup]:
    """As many lines from the beginning as a page should hold."""
    shown: list[Markup] = []
    room = BYTES_MAX
    for line in given[:LINES_MAX]:
        shown.append(_line(line))
        room -= len(shown[-1].encode())
        if room < 0:
            break
    return shown


def kind_of(line: str) -> str:
    """
    >>> kind_of("+G1 X10. F500"), kind_of("@@ -1,3 +1,3 @@"), kind_of(" M30")
    ('comes', 'hunk', '')
    """
    return next((kind for sign, kind in _KIND if line.startswith(sign)), "")


def _line(line: str) -> Markup:
    text, kind = shortened(line, WIDTH_MAX), kind_of(line)
    return tag("span", text, class_=kind) if kind else joined([text])
