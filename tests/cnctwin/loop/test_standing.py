"""The standing of a machine's gap, and a drift of the machine beside it."""

from cnctwin.loop.standing import standing_of
from sparkplug.metric import Reading
from sparkplug.quality import Quality
from twin.vocabulary.twin_signals import GAP_GROWING, GAP_GROWING_SIGNAL, MACHINE_DRIFT, MACHINE_DRIFT_BASIS

WORDS = "the load of all tools and programs has risen since 1970-01-01T00:00:02Z; to name the cause: cnctwin gap case"


def reading(name: str, value: object, quality: Quality = Quality.GOOD) -> Reading:
    return Reading(name, value, 3000, quality, None, None, False)  # type: ignore[arg-type]


def test_a_drift_of_the_machine_is_a_gap_that_grows() -> None:
    standing = standing_of([reading(MACHINE_DRIFT, True), reading(MACHINE_DRIFT_BASIS, WORDS)])
    assert standing.is_open
    assert standing.grows == WORDS.partition(";")[0]
    assert standing.since_ms == 2000


def test_a_gap_that_grows_goes_before_a_drift() -> None:
    told = [reading(MACHINE_DRIFT, True), reading(GAP_GROWING, True), reading(GAP_GROWING_SIGNAL, "spindle_temp_c in steady")]
    assert standing_of(told).grows == "spindle_temp_c in steady"


def test_no_drift_opens_nothing() -> None:
    assert not standing_of([reading(MACHINE_DRIFT, False), reading(MACHINE_DRIFT_BASIS, WORDS)]).is_open
    assert not standing_of([reading(MACHINE_DRIFT, True, Quality.STALE), reading(MACHINE_DRIFT_BASIS, WORDS)]).is_open
