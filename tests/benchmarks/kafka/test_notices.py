"""The judge of a kill run's notifications: it finds each fault, and lets pass what a body had no room for."""

from collections.abc import Sequence

from benchmarks.kafka.notices import judged
from benchmarks.kafka.webhook import Received
from processors.alerts.body import iso
from processors.alerts.outbox import DELIVERED, FAILED
from processors.alerts.state import Severity
from processors.alerts.statement import FIRING, PASSED, RESOLVED, Statement

ONE, TWO = 1_790_000_000_000, 1_790_000_060_000
"""The beginnings of two episodes."""


class Course:
    """Notifications as they come about: in the log, and at the receiver, where each is named by its place."""

    def __init__(self) -> None:
        self.emitted: dict[str, tuple[Statement, ...]] = {}
        self.received: list[Received] = []
        self.fates: dict[str, str] = {}

    def told(
        self, *news: tuple[str, int, str], shown: Sequence[int] | None = None, comes: int = 1, fate: str = DELIVERED
    ) -> None:
        """Have a notification of alerts made, and come; `shown`: the places of those that its body shows, else all."""
        key = str(len(self.emitted))
        self.emitted[key] = tuple(Statement(alert, begin, what, 0, Severity.HIGH) for alert, begin, what in news)
        seen = range(len(news)) if shown is None else shown
        alerts = [(news[at][0], iso(news[at][1]), FIRING if news[at][2] == FIRING else RESOLVED) for at in seen]
        self.received += [Received(key, tuple(alerts), len(news) - len(alerts))] * comes
        self.fates[key] = fate

    def faults(self) -> tuple[int, int, int, int]:
        """The number of notifications that are doubled, lost, unknown and out of order."""
        found = judged(self.emitted, self.received, self.fates)
        assert found.faults == found.doubled + found.lost + found.unknown + found.disordered
        assert bool(found.lost or found.disordered) == bool(found.first)
        return found.doubled, found.lost, found.unknown, found.disordered


def test_alerts_that_fire_and_are_resolved_in_turn_are_well() -> None:
    course = Course()
    for begin in (ONE, TWO):
        course.told(("a", begin, FIRING), ("b", begin, FIRING))
        course.told(("a", begin, RESOLVED))
        course.told(("b", begin, RESOLVED))
    found = judged(course.emitted, course.received, course.fates)
    assert (found.faults, found.firing, found.resolved, found.delivered) == (0, 4, 4, 6)
    assert (found.left_out, found.unseen, found.passed) == (0, 0, 0)


def test_a_notification_that_comes_twice_is_doubled() -> None:
    course = Course()
    course.told(("a", ONE, FIRING), comes=2)
    assert course.faults() == (1, 0, 0, 0)


def test_a_notification_that_never_comes_is_lost_unless_it_is_said_to_have_failed() -> None:
    course = Course()
    course.told(("a", ONE, FIRING), comes=0)
    assert course.faults() == (0, 1, 0, 0)
    course.fates["0"] = FAILED
    assert course.faults() == (0, 0, 0, 0)


def test_a_notification_that_stands_nowhere_is_unknown() -> None:
    course = Course()
    course.received.append(Received("stray", ()))
    assert course.faults() == (0, 0, 1, 0)


def test_an_alert_that_is_resolved_before_it_fires_is_out_of_order() -> None:
    course = Course()
    course.told(("a", ONE, FIRING))
    course.told(("a", ONE, RESOLVED))
    course.received.reverse()
    assert course.faults() == (0, 0, 0, 2)


def test_an_episode_that_is_told_after_the_next_one_is_out_of_order() -> None:
    course = Course()
    course.told(("a", TWO, FIRING))
    course.told(("a", ONE, RESOLVED))
    assert course.faults() == (0, 0, 0, 1)


def test_a_firing_that_a_body_left_out_passes_also_of_a_new_episode() -> None:
    course = Course()
    for unseen, begin in enumerate((ONE, TWO), 1):
        course.told(("a", begin, FIRING), ("b", begin, FIRING), shown=[0])
        course.told(("b", begin, RESOLVED))
        found = judged(course.emitted, course.received, course.fates)
        assert (found.faults, found.left_out, found.unseen) == (0, unseen, unseen)


def test_no_firing_passes_but_one_that_a_body_before_left_out() -> None:
    of_another = Course()
    of_another.told(("a", ONE, FIRING), ("b", ONE, FIRING), shown=[0])
    of_another.told(("c", ONE, RESOLVED))
    assert of_another.faults() == (0, 0, 0, 1)
    of_an_older_episode = Course()
    of_an_older_episode.told(("a", ONE, FIRING), ("b", ONE, FIRING), shown=[0])
    of_an_older_episode.told(("b", TWO, RESOLVED))
    assert of_an_older_episode.faults() == (0, 0, 0, 1)
    too_late = Course()
    too_late.told(("a", ONE, FIRING), ("b", ONE, FIRING), shown=[0])
    too_late.told(("b", ONE, RESOLVED))
    too_late.received.reverse()
    assert too_late.faults() == (0, 0, 0, 1)


def test_no_more_firings_pass_than_a_body_says_that_it_left_out() -> None:
    course = Course()
    course.told(("a", ONE, FIRING), ("b", ONE, FIRING), ("c", ONE, FIRING), shown=[0])
    course.received[0] = course.received[0]._replace(left_out=1)
    course.told(("b", ONE, RESOLVED), ("c", ONE, RESOLVED))
    assert course.faults() == (0, 0, 0, 1)


def test_a_firing_passes_whose_notification_failed_and_no_other() -> None:
    course = Course()
    course.told(("a", ONE, FIRING), comes=0, fate=FAILED)
    course.told(("a", ONE, RESOLVED))
    assert course.faults() == (0, 0, 0, 0)
    course.told(("b", ONE, RESOLVED))
    assert course.faults() == (0, 0, 0, 1)


def test_an_episode_that_was_over_before_anybody_was_told_is_resolved_at_once() -> None:
    course = Course()
    course.told(("a", ONE, PASSED))
    found = judged(course.emitted, course.received, course.fates)
    assert (found.faults, found.passed, found.unseen) == (0, 1, 0)
