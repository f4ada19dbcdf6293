"""The page: all sections in the order in which they are read, its style and its script inside."""

from cnctwin.reports.gap.causes import candidates, causes
from cnctwin.reports.gap.constants import constants
from cnctwin.reports.gap.document import document, own_text
from cnctwin.reports.gap.heat_map import where
from cnctwin.reports.gap.learned import learned
from cnctwin.reports.gap.markup import tag
from cnctwin.reports.gap.patterns import patterns
from cnctwin.reports.gap.subsystems import subsystems
from cnctwin.reports.gap.traces import traces
from cnctwin.reports.gap.untold import cannot_be_told, judged, next_experiment, notes
from cnctwin.reports.gap.verdict import figures, headline
from cnctwin.reports.gap.waterfall import how_far
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
        subsystems(diagnosis),
        where(diagnosis),
        traces(diagnosed),
        how_far(diagnosis),
        causes(diagnosis),
        learned(diagnosis),
        constants(diagnosis),
        candidates(diagnosis),
        patterns(diagnosis),
        cannot_be_told(diagnosis),
        next_experiment(diagnosis),
        notes(diagnosis),
        judged(diagnosed),
    )
    style, script = (own_text("cnctwin.reports.gap", name) for name in ("report.css", "report.js"))
    return document(f"{title} – sim-to-real gap", main, style=style, script=script)
