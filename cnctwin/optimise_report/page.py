"""The page: what came out, what binds, how sure it is, and how it was found, in the order in which an engineer asks.

It has no script at all, and looks as the report of a gap does: the same style, with what is its own behind it.
"""

from cnctwin.gap_report.document import document, own_text
from cnctwin.gap_report.markup import tag
from cnctwin.optimise_report.binding import binding
from cnctwin.optimise_report.course import course
from cnctwin.optimise_report.difference import difference
from cnctwin.optimise_report.front import front
from cnctwin.optimise_report.headline import figures, headline
from cnctwin.optimise_report.kept import left_alone, limits, notes
from cnctwin.optimise_report.lines import lines
from cnctwin.optimise_report.resimulated import resimulated
from cnctwin.optimise_report.search import search
from cnctwin.optimise_report.sensitivity import sensitivity
from cnctwin.optimise_report.totals import totals
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
    style = own_text("cnctwin.gap_report", "report.css") + own_text("cnctwin.optimise_report", "optimise.css")
    return document(f"{answer.name} – feed and speed for each line", main, style=style)
