"""The wording of notifications in one language: titles, texts and sentences, rendered from its templates."""

import math
import re
from collections.abc import Iterable, Mapping, Sequence
from datetime import UTC, datetime
from functools import cache
from pathlib import Path
from typing import Any, NamedTuple, NoReturn
from urllib.parse import quote
from zoneinfo import ZoneInfo

from jinja2 import Template, TemplateError, Undefined, UndefinedError, meta
from jinja2.sandbox import ImmutableSandboxedEnvironment

from processors.alerts.lag import PLANT
from processors.alerts.phases import Flapping
from processors.alerts.state import ALERTS_MAX, Alert, Phase, Severity
from processors.alerts.statement import Statement
from processors.alerts.words.language import SUFFIX, Form, Language, Texts, language, language_in
from twin.vocabulary.twin_signals import RULE_PREFIX, RULE_VIBRATION, TWIN_PREFIX

SENTENCE_MAX, TITLE_MAX, TEXT_MAX, FILLED_MAX = 300, 200, 2000, 100_000
SHOWN_MS, SHOWN_MAX = 300_000, 50
_AXIS = re.compile(r"axis_([a-z]\d{0,2})_(.+)")
MINUTE_S, HOUR_S, DAY_S = 60.0, 3600.0, 86_400.0
SURPRISES = (TemplateError, ArithmeticError, ValueError, TypeError, LookupError, AttributeError, RecursionError, MemoryError)
"""Whatever a template of somebody's own may run into."""

KNOWN = frozenset(
    {
        *("kind", "alerts", "first", "count", "others", "machines", "notes", "who", "machine", "alert", "name", "signal_name"),
        *("severity", "is_on", "acknowledged_by", "unknown", "since", "ended", "lasting", "for_lasting", "why", "value", "limit"),
        *("unit", "lasted_s", "line", "signal", "side", "away", "away_unit", "against", "parts", "line_from", "line_to", "like"),
        *("likeness", "peers", "regime", "section", "way", "left", "left_low", "left_high", "program", "tool", "control", "news"),
        *("control_alarm", "fed", "busy", "runners", "partitions", "waiting", "processors", "remedy"),
        *("times", "within", "stays_away", "away_for"),
    }
)
"""The names that a template may use; a language of somebody's own that uses another is refused."""
TRIAL = Alert("machine", RULE_VIBRATION.removeprefix(TWIN_PREFIX), RULE_VIBRATION, "", Severity.HIGH, 0, Phase.FIRING)
"""The alert with which templates of somebody's own are tried."""


class Missing(Undefined):
    """A value that is not known. It is false and equals nothing; where it is to be written, the text is given up."""

    def __str__(self) -> str:
        return str(self._fail_with_undefined_error())

    def __float__(self) -> NoReturn:
        self._fail_with_undefined_error()


class Occasion(NamedTuple):
    """The occasion of a text.

    clock_s: of the state, which never goes back; kind: of the notification; says: what is new, of its first alerts one by one
    flapping: by fingerprint, those of its alerts that come and go
    """

    clock_s: float
    kind: str = "notify"
    says: tuple[Statement, ...] = ()
    flapping: Mapping[str, Flapping] = {}


class _Said(NamedTuple):
    """The texts of an alert that do not depend on the occasion."""

    alert: Alert
    flapping: Flapping | None
    summary: str
    details: str
    advice: str


class Wording:
    """See the module. Raises ValueError naming the first template that cannot be read.

    time_zone: of moments in texts; external_url: the address of the page, "" = there is none, and no link
    """

    def __init__(self, words: Language, time_zone: str = "UTC", external_url: str = "") -> None:
        self._words, self._zone, self._page = words, ZoneInfo(time_zone), external_url.rstrip("/")
        self._environment = environment = ImmutableSandboxedEnvironment(undefined=Missing, autoescape=False, trim_blocks=False)
        form = words.form
        environment.filters["number"] = lambda value, digits=3: number(value, form.decimal, digits)
        environment.filters["counted"] = lambda value, one, many: counted(value, one, many, form.decimal)
        environment.filters["capitalized"] = lambda text: f"{text[:1].upper()}{text[1:]}"
        environment.filters["listed"] = lambda parts: ", ".join(str(part) for part in parts if part)
        self._templates = {text: _compiled(environment, where, text) for where, text in _templates_of(words)}
        self._rendered_of: dict[str, _Said] = {}  # by fingerprint

    def tried(self) -> "Wording":
        """Return it, once each template names only what there is, and title and text could be filled. Raises ValueError."""
        for text, where in {text: where for where, text in _templates_of(self._words)}.items():
            unknown = meta.find_undeclared_variables(self._environment.parse(text)) - KNOWN - {"range"}
            if unknown:
                raise ValueError(
                    f"{where}: {sorted(unknown)[0]!r} is not known; docs/how-to/alerts.md lists what a template sees"
                )
        told = self._of_notice((TRIAL,), (), Occasion(0.0))
        for where, text in (("title", self._words.title), ("text", self._words.text)):
            try:
                _filled(self._templates[text], told)
            except SURPRISES as error:
                raise ValueError(f"{where}: {error}; docs/how-to/alerts.md lists what a template sees") from error
        return self

    @property
    def link_title(self) -> str:
        """The text of a link."""
        return self._words.link

    def title(self, alerts: Sequence[Alert], occasion: Occasion) -> str:
        """Return one line: which machine, what is wrong there, since when."""
        if occasion.kind in ("test", "heartbeat"):
            return self._words.test if occasion.kind == "test" else self._words.heartbeat
        told = self._of_notice(alerts, (), occasion)
        plain = f"{told['first']['machine']}: {told['first']['what']}"
        return (_one_line(self._rendered(self._words.title, told)) or plain)[:TITLE_MAX]

    def text(self, alerts: Sequence[Alert], notes: Iterable[str], occasion: Occasion) -> str:
        """Return what else there is to say of each alert; the first one's title is not repeated."""
        if not alerts:
            return "\n".join(notes)
        return self._rendered(self._words.text, self._of_notice(alerts, tuple(notes), occasion)).strip()[:TEXT_MAX]

    def held_back(self, count: int) -> str:
        """Return a note on notifications that did not go out."""
        return self._rendered(self._words.held_back, {"count": count})

    def asked_by(self, who: str) -> str:
        """Return a note on who asked for a test."""
        return self._rendered(self._words.asked_by, {"who": who})

    def summary(self, alert: Alert, flapping: Flapping | None = None) -> str:
        """Return an alert in one line that stays the same while the alert lasts, but for one that comes and goes."""
        return self._said(alert, flapping).summary

    def details(self, alert: Alert, flapping: Flapping | None = None) -> str:
        """Return what the machine was doing, and why a score alarms."""
        return self._said(alert, flapping).details

    def advice(self, alert: Alert, flapping: Flapping | None = None) -> str:
        """Return what to do first; "" where nothing is known of it, or it is over."""
        return self._said(alert, flapping).advice

    def reason(self, alert: Alert) -> str:
        """Return why the alarm of an alert cannot be read now; "" where it can be."""
        return self._words.reasons.get(alert.unknown, alert.unknown)

    def comes_and_goes(self, alert: Alert, flapping: Flapping | None) -> dict[str, str | int]:
        """Return how often an alert that flaps has come within how long, and for how long it has been gone; else nothing."""
        if flapping is None or not alert.is_on:
            return {}
        spans_s = {"within": flapping.within_s, "away_for": flapping.away_s or None, "stays_away": flapping.stays_away_s}
        return {"times": flapping.times, **{name: self._duration(span_s) for name, span_s in spans_s.items()}}

    def link(self, alert: Alert) -> str:
        """Return the address of the moment on the page; "" without a page."""
        return link(self._page, alert)

    def _of_notice(self, alerts: Sequence[Alert], notes: tuple[str, ...], occasion: Occasion) -> dict[str, Any]:
        new = sorted(alerts[: len(occasion.says) or None], key=lambda alert: not alert.is_on)  # what is over stands last
        first, *rest = (*new, *alerts[len(new) :])
        return {
            "kind": occasion.kind,
            "alerts": [self._of_alert(alert, occasion) for alert in (first, *rest)[:SHOWN_MAX]],
            "first": self._of_alert(first, occasion),
            "count": len(alerts),
            "others": sum(alert.is_on == first.is_on for alert in rest),
            "machines": len({alert.machine for alert in alerts}),
            "notes": notes,
        }

    def _of_alert(self, alert: Alert, occasion: Occasion) -> dict[str, Any]:
        news = {(said.fingerprint, said.episode): said.what for said in occasion.says}
        more: dict[str, Any] = {"lasting": self._duration(lasted_s(alert, occasion))}
        more["news"] = news.get((alert.fingerprint, alert.episode), "")
        facts = self._facts(alert, more | self.comes_and_goes(alert, occasion.flapping.get(alert.fingerprint)))
        return facts | {
            "what": self._what(alert, facts),
            "details": self._details(alert, facts),
            "advice": self._advice(alert, facts),
            "link": self.link(alert),
        }

    def _said(self, alert: Alert, flapping: Flapping | None) -> _Said:
        """Return what is said of an alert, rendered once for all the beats at which it is the same value."""
        known = self._rendered_of.get(alert.fingerprint)
        if known is None or known.alert is not alert or known.flapping != flapping:
            if len(self._rendered_of) >= ALERTS_MAX:
                self._rendered_of.clear()
            lasting = self._duration(lasted_s(alert, Occasion(0.0))) if alert.phase is Phase.RESOLVED else ""
            facts = self._facts(alert, {"lasting": lasting} | self.comes_and_goes(alert, flapping))
            known = _Said(alert, flapping, self._what(alert, facts), self._details(alert, facts), self._advice(alert, facts))
            self._rendered_of[alert.fingerprint] = known
        return known

    def _facts(self, alert: Alert, more: Mapping[str, Any]) -> dict[str, Any]:
        """Return what templates may say of an alert; `for_lasting` is empty where nothing is known of its duration."""
        words = self._words
        told = str(alert.facts.get("signal", alert.signal) or alert.name)
        facts: dict[str, Any] = {
            **alert.facts,
            "machine": alert.machine,
            "alert": alert.name,
            "name": self._texts(alert).name,
            "signal_name": self._signal_name(told),
            "severity": words.severities.get(alert.severity.value, alert.severity.value),
            "is_on": alert.is_on or alert.phase is Phase.PENDING,
            "acknowledged_by": alert.acknowledged_by,
            "unknown": self.reason(alert),
            "since": self._moment(began_ms(alert)),
            "ended": "" if alert.is_on or not alert.ended_ms else self._moment(max(alert.ended_ms, alert.episode)),
            **more,
        }
        for name, terms in (("side", words.sides), ("regime", words.regimes), ("away_unit", words.units), ("unit", words.units)):
            if name in alert.facts:
                facts[name] = terms.get(str(alert.facts[name]), alert.facts[name])
        facts["for_lasting"] = self._rendered(words.for_lasting, facts) if facts.get("lasting") or facts.get("times") else ""
        return facts

    def _signal_name(self, signal: str) -> str:
        """Return the words for a signal; those of an axis are found with `*` for its letter."""
        names = self._words.signals
        if signal in names or (axis := _AXIS.fullmatch(signal)) is None:
            return names.get(signal, _spelled(signal))
        return names.get(f"axis_*_{axis[2]}", _spelled(signal)).replace("*", axis[1].upper())

    def _advice(self, alert: Alert, facts: Mapping[str, Any]) -> str:
        advice = self._texts(alert).advice
        return "" if alert.phase is Phase.RESOLVED or not advice else _one_line(self._rendered(advice, facts))

    def _texts(self, alert: Alert) -> Texts:
        return self._words.alerts.get(alert.name) or Texts(name=_spelled(alert.signal or alert.name))

    def _what(self, alert: Alert, facts: Mapping[str, Any]) -> str:
        """Return an alert in one sentence, with figures where all of them are known."""
        texts = self._texts(alert)
        if not facts["is_on"]:
            return _one_line(self._rendered(self._words.over, facts))
        if texts.what:
            try:
                return _one_line(_filled(self._templates[texts.what], facts))
            except UndefinedError:
                pass  # a figure is not known
            except SURPRISES:
                return f"{texts.name} ({alert.name})"
        return _one_line(f"{texts.name[:1].upper()}{texts.name[1:]}{facts['for_lasting']}")

    def _details(self, alert: Alert, facts: Mapping[str, Any]) -> str:
        why = self._texts(alert).why
        told = {**facts, "why": self._rendered(why, facts) if why else ""}
        return _one_line(self._rendered(self._words.details, told))

    def _rendered(self, text: str, values: Mapping[str, Any]) -> str:
        """Return a text filled with values; "" where a value that it writes is not known, or the template fails."""
        try:
            return _filled(self._templates[text], values)
        except SURPRISES:
            return ""

    def _moment(self, at_ms: int) -> str:
        try:
            return datetime.fromtimestamp(at_ms // 1000, UTC).astimezone(self._zone).strftime(self._words.form.moment)
        except (OverflowError, ValueError, OSError):
            return ""

    def _duration(self, seconds: float | None) -> str:
        return "" if seconds is None else duration(seconds, self._words.form)


def lasted_s(alert: Alert, occasion: Occasion) -> float | None:
    """Return how long the condition of an alert has lasted, or did; None where its end is not known.

    Durations go by our own clock while it lasts, since the control's may be set, and by the control's own times once it is over.
    """
    before_s = _before_s(alert)
    if alert.is_on:
        return before_s + alert.held_s + max(0.0, occasion.clock_s - alert.fired_s)
    return before_s + (alert.ended_ms - alert.episode) / 1000.0 if alert.ended_ms else None


def began_ms(alert: Alert) -> int:
    """Return when it began to be so, which may be before it became an alert."""
    return alert.episode - round(_before_s(alert) * 1000)


def _before_s(alert: Alert) -> float:
    """Return how long it had been so when it became an alert."""
    before_s = alert.facts.get("lasted_s", 0.0)
    return float(before_s) if isinstance(before_s, (int, float)) else 0.0


def number(value: Any, decimal: str, digits: int = 3) -> str:
    """Return a number with at most `digits` significant digits, whole from a hundred on.

    >>> number(112.04, "."), number(7.125, ","), number(0.25, ","), number(48210.0, ".")
    ('112', '7,12', '0,25', '48210')
    """
    given = float(value)
    if not math.isfinite(given):
        raise ValueError("no number")
    text = f"{given:.0f}" if abs(given) >= 10 ** (digits - 1) else f"{float(f'{given:.{digits}g}'):.{digits + 3}f}"
    return (text.rstrip("0").rstrip(".") if "." in text else text).replace(".", decimal) or "0"


def counted(value: Any, one: str, many: str, decimal: str) -> str:
    """Return a number with its noun, in the singular where the number is written as 1.

    >>> counted(1.0, "part", "parts", "."), counted(1.4, "part", "parts", "."), counted(0, "Teil", "Teile", ",")
    ('1 part', '1.4 parts', '0 Teile')
    """
    text = number(value, decimal)
    return f"{text} {one if text == '1' else many}"


def duration(seconds: float, form: Form) -> str:
    """Return a duration as people say it, in its two largest units at most.

    >>> form = language("en").form
    >>> [duration(seconds, form) for seconds in (8.4, 95.0, 7800.0, 90_000.0)]
    ['8 s', '1 min 35 s', '2 h 10 min', '1 d 1 h']
    """
    seconds = max(0.0, seconds)
    units = (
        (DAY_S, form.days, HOUR_S, form.hours), (HOUR_S, form.hours, MINUTE_S, form.minutes),
        (MINUTE_S, form.minutes, 1.0, form.seconds),
    )  # fmt: skip
    for large_s, large, small_s, small in units:
        if seconds >= large_s:
            rest = int(seconds % large_s // small_s)
            return f"{int(seconds // large_s)} {large}" + (f" {rest} {small}" if rest and seconds < 10 * large_s else "")
    return f"{seconds:.0f} {form.seconds}"


def link(page: str, alert: Alert) -> str:
    """Return the address of ten minutes around the beginning of an alert on the page, with the signal that shows it."""
    if not page or alert.machine == PLANT:
        return page
    at_ms, signal = alert.episode, alert.facts.get("signal", "")
    shown = f"&signal={quote(str(signal), safe='')}" if signal else ""
    return f"{page}/#/replay/{quote(alert.machine, safe='')}?from={at_ms - SHOWN_MS}&to={at_ms + SHOWN_MS}&at={at_ms}{shown}"


@cache
def _shipped_wording(name: str, time_zone: str, external_url: str) -> Wording:
    return Wording(language(name), time_zone, external_url)


def wording(name: str, time_zone: str, external_url: str) -> Wording:
    """Return the wording in a shipped language, or in that of a file. Raises ValueError."""
    if name.endswith(SUFFIX):
        own = language_in(Path(name))
        try:
            return Wording(own, time_zone, external_url).tried()
        except ValueError as error:
            raise ValueError(f"language {name}: {error}") from error
    return _shipped_wording(name, time_zone, external_url)


def _templates_of(words: Language) -> Iterable[tuple[str, str]]:
    """Yield the place and the text of each template of a language."""
    for where in ("title", "text", "over", "other", "details", "held_back", "asked_by", "for_lasting"):
        yield where, getattr(words, where)
    for alert, texts in words.alerts.items():
        for where in ("what", "why", "advice"):
            if text := getattr(texts, where):
                yield f"alerts.{alert}.{where}", text


def _compiled(environment: ImmutableSandboxedEnvironment, where: str, text: str) -> Template:
    try:
        return environment.from_string(text)
    except TemplateError as error:
        raise ValueError(f"{where}: {error}") from error


def _filled(template: Template, values: Mapping[str, Any]) -> str:
    """Return a template filled with values, cut off where it is far too long: what it writes is not kept in memory."""
    text = ""
    for piece in template.generate(values):
        if len(text := text + piece) > FILLED_MAX:
            break
    return text


def _one_line(text: str) -> str:
    return " ".join(text.split())[:SENTENCE_MAX]


def _spelled(name: str) -> str:
    """Return the name of a signal or an alert as words.
    >>> _spelled("twin/rule_lubricant_low")
    'lubricant low'
    """
    return name.removeprefix(RULE_PREFIX).removeprefix(TWIN_PREFIX).replace("_", " ")
