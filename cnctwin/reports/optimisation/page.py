"""The page: what came out, what binds, how sure it is, and how it was found, in the order in which an engineer asks.

It has no script at all, and looks as the report of a gap does: the same style, with what is its own behind it.
"""

from cnctwin.reports.gap.document import document, own_text
from cnctwin.reports.gap.markup import tag
from cnctwin.reports.optimisation.binding import binding
from cnctwin.reports.optimisation.course import course
from cnctwin.reports.optimisation.difference import difference
from cnctwin.reports.optimisation.front import front
from cnctwin.reports.optimisation.headline import figures, headline
from cnctwin.reports.optimisation.kept import left_alone, limits, notes
from cnctwin.reports.optimisation.lines import lines
from cnctwin.reports.optimisation.resimulated import resimulated
from cnctwin.reports.optimisation.search import search
from cnctwin.reports.optimisation.sensitivity import sensitivity
from cnctwin.reports.optimisation.totals import totals
from twin.optimisation.answer import Optimised


def report_html(answer: Optimised) -> str:
    """The whole page as text, to be written as UTF-8. Below 300 kB for any program: long tables are cut and say so."""
    main = tag(
        "main",
        headline(answer),
        figures(answer),
        totals(answer),
        course(answer),
        binding(answer),
        lines(answer),
        front(answer),
        sensitivity(answer),
        search(answer),
        resimulated(answer),
        difference(answer),
        left_alone(answer),
        notes(answer),
        limits(answer),
    )
    style = own_text("cnctwin.reports.gap", "report.css") + own_text("cnctwin.reports.optimisation", "optimise.css")
    return document(f"{answer.name} – feed and speed for each line", main, style=style)
