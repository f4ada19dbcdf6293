"""The dashboard of production figures, drawn from the store: OEE with its parts, where planned time goes, parts and energy."""

from dashboard_source import words
from dashboard_source.board import DAY_S, HOUR_S, Board, Draw, Limit, Panel, Reading, View
from twin.vocabulary import twin_signals as twin

HOLD_S = DAY_S  # a figure of a shift is what it is until it is told again
SHARES = (Limit(None, words.RED), Limit(0.6, words.YELLOW), Limit(0.85, words.GREEN))


def _figure(signal: str, legend: str, *, fleet: bool = False) -> Reading:
    return Reading(signal=signal, legend=legend, fleet=fleet, hold_s=HOLD_S, draw=Draw.STEP)


def _sum(name: str, legend: str) -> Reading:
    return Reading(signal=f"{twin.TWIN_PREFIX}{name}", legend=legend, hold_s=2 * HOUR_S, draw=Draw.STEP)


PRODUCTION = Board(
    uid="cnctwin-production",
    title="Production",
    says="OEE of the shift that runs, its parts by ISO 22400-2, and where planned time goes. By reason: page and CSV.",
    last="now-24h",
    refresh="1m",
    panels=(
        Panel(
            title="OEE of all machines",
            says=f"{twin.OEE}: availability times performance times quality; none where one of them is not known.",
            series=(_figure(twin.OEE, "{}", fleet=True),),
            unit="percentunit",
            low=0.0,
            width=24,
        ),
        Panel(
            title="OEE and its parts",
            says="Of the shift so far. Performance is over the twin's ideal time, and can be above 1.",
            series=(
                _figure(twin.OEE, "OEE"),
                _figure(twin.AVAILABILITY, "availability"),
                _figure(twin.PERFORMANCE, "performance"),
                _figure(twin.QUALITY, "quality"),
            ),
            unit="percentunit",
            low=0.0,
        ),
        Panel(
            title="Availability of all machines",
            says=f"{twin.AVAILABILITY}: production time over planned busy time, of what was heard.",
            series=(_figure(twin.AVAILABILITY, "{}", fleet=True),),
            view=View.FIGURE,
            unit="percentunit",
            limits=SHARES,
        ),
        Panel(
            title="Where planned time goes",
            says="Seconds of the shift so far by time element: APT, AUST, ADET, ADOT; and what nobody heard.",
            series=(
                _sum("planned_s", "planned"),
                _sum("production_s", "production"),
                _sum("setup_s", "setup"),
                _sum("delay_s", "delay"),
                _sum("down_s", "down, an alarm"),
                _sum("unknown_s", "not heard"),
            ),
            unit="s",
        ),
        Panel(
            title="Parts of the shift",
            says="Made, and what is known of their quality.",
            series=(_sum("parts_made", "made"), _sum("parts_good", "good"), _sum("parts_scrap", "scrap")),
        ),
        Panel(
            title="Energy of the spindle drive",
            says="Of the shift so far; right: of the last part.",
            series=(
                _sum("shift_energy_kwh", "shift"),
                Reading(
                    signal=twin.PART_ENERGY_KWH,
                    legend="last part",
                    unit="kwatth",
                    right=True,
                    hold_s=HOLD_S,
                    draw=Draw.STEP,
                ),
            ),
            unit="kwatth",
        ),
    ),
)
