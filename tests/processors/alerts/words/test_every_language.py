"""Every language says all that English does, of every alarm there is, from values: no text of a processor is passed on."""

import json
import tomllib
from typing import Any

import pytest

from processors.alarms import alarm_signals
from processors.alerts.config import MACHINE_OFFLINE, PROCESSORS_BEHIND, SOURCE_LOST
from processors.alerts.facts import Facts, facts_of, of_score
from processors.alerts.lag import facts_of as lag_facts
from processors.alerts.phases import NOT_OFFERED
from processors.alerts.state import Alert, Phase, Severity
from processors.alerts.watch import NOT_HEARD, OFFLINE
from processors.alerts.words import language as words_folder
from processors.alerts.words.language import SUFFIX, shipped
from processors.alerts.words.wording import Occasion, wording
from processors.gap.signals import REGIMES, SIGNALS
from processors.lag_report import LagReport
from sparkplug.metric import Reading
from sparkplug.quality import Quality
from twin.vocabulary import signals, twin_signals
from twin.vocabulary.twin_signals import TWIN_PREFIX

NAMES = [
    *(signal.removeprefix(TWIN_PREFIX) for signal in alarm_signals()),
    *(MACHINE_OFFLINE, SOURCE_LOST, PROCESSORS_BEHIND),
]
AT_MS = 1_795_000_000_000
DAYS_MS = 3 * 86_400_000
NUMBERS = {name for name, signal in signals.SIGNALS.items() if signal.kind is signals.Kind.NUMBER}


def told(name: str, facts: Facts, language: str) -> tuple[str, str]:
    """The title of an alert that began nine seconds ago, and its first details."""
    signal = "" if name in (MACHINE_OFFLINE, SOURCE_LOST, PROCESSORS_BEHIND) else TWIN_PREFIX + name
    alert = Alert("okuma", name, signal, "f" * 16, Severity.HIGH, AT_MS, Phase.FIRING, facts=facts)
    words = wording(language, "UTC", "")
    return words.title([alert], Occasion(9.0)), words.details(alert)


def seen(name: str, **row: Any) -> Facts:
    """The facts of an alarm, as they follow from a row."""
    readings = {
        key: Reading(key, value if isinstance(value, int) else json.dumps(value), AT_MS, Quality.GOOD, None, None, False)
        for key, value in row.items()
    }
    return facts_of(TWIN_PREFIX + name, readings, AT_MS)


def rule(name: str, value: float, limit: float, unit: str) -> Facts:
    found = {"value": value, "limit": limit, "unit": unit, "since": AT_MS - 2000, "signal": "spindle_load_pct"}
    return seen(f"rule_{name}", **{twin_signals.RULE_FINDINGS: {name: found}})


def gap(**found: Any) -> Facts:
    return seen("gap_growing", **{twin_signals.GAP_FINDINGS: [{"since": AT_MS - DAYS_MS, **found}]})


def fast(left: float, low: float, high: float) -> Facts:
    lives = [
        {"tool": 3, "is_fast": False, "wear_pct": 60.0, "parts_left": 50.0, "parts_left_band": [40.0, 60.0]},
        {"tool": 7, "is_fast": True, "wear_pct": 18.4, "parts_left": left, "parts_left_band": [low, high]},
    ]
    return seen("tool_wears_fast", **{twin_signals.TOOL_LIVES: lives, "tool_number": 3})


def late(busy_pct: float, runners: int = 0, machines: int = 1, waiting: int = 1) -> Facts:
    return lag_facts([LagReport(("thermal",), "x", AT_MS, 18.2, machines, busy_pct, runners, 12, waiting)], 5.0)


# By alarm: its facts, title and details in English, and in German.
TOLD: list[tuple[str, Facts, tuple[str, str], tuple[str, str]]] = [
    (
        "rule_load_over_limit",
        rule("load_over_limit", 112.0, 100.0, "%"),
        ("Spindle load 112 % for 11 s, limit 100 %", ""),
        ("Spindellast 112 % seit 11 s, Grenze 100 %", ""),
    ),
    (
        "rule_thermal_runaway",
        rule("thermal_runaway", 7.2, 5.0, "K/min"),
        ("Spindle temperature rises by 7.2 K/min for 11 s, limit 5 K/min", ""),
        ("Spindeltemperatur steigt um 7,2 K/min seit 11 s, Grenze 5 K/min", ""),
    ),
    (
        "rule_load_without_feed",
        rule("load_without_feed", 71.0, 60.0, "%"),
        ("Spindle load 71 % without feed for 11 s, limit 60 %", ""),
        ("Spindellast 71 % ohne Vorschub seit 11 s, Grenze 60 %", ""),
    ),
    (
        "rule_vibration",
        rule("vibration", 8.25, 7.1, "mm/s"),
        ("Vibration 8.25 mm/s for 11 s, limit 7.1 mm/s", ""),
        ("Schwingung 8,25 mm/s seit 11 s, Grenze 7,1 mm/s", ""),
    ),
    (
        "rule_tool_broken",
        rule("tool_broken", 0.4, 6.5, "%"),
        ("Tool is probably broken: the cut takes 0.4 % of spindle load, at least 6.5 % is expected", ""),
        ("Werkzeug vermutlich gebrochen: Der Schnitt braucht 0,4 % Spindellast, mindestens 6,5 % sind zu erwarten", ""),
    ),
    (
        "rule_load_over_expected",
        rule("load_over_expected", 84.0, 40.0, "%"),
        ("The cut takes 84 % of spindle load for 11 s, expected at most 40 %", ""),
        ("Der Schnitt braucht 84 % Spindellast seit 11 s, erwartet sind höchstens 40 %", ""),
    ),
    (
        "anomaly_alarm",
        of_score({"signal": "axis_z4_load_pct", "measured": 59.0, "expected": 50.0, "by": "12 parts", "peers": ["a"]}),
        ("Load of axis Z4 18 % above the last 12 parts for 9 s", "a peer shows it too"),
        ("Last der Achse Z4 18 % über den letzten 12 Teilen seit 9 s", "eine andere Maschine zeigt es auch"),
    ),
    (
        "control_alarm",
        {"control_alarm": "414 SERVO ALARM"},
        ("The control shows 414 SERVO ALARM for 9 s", ""),
        ("Die Steuerung meldet 414 SERVO ALARM seit 9 s", ""),
    ),
    (
        "control_alarm",
        seen("control_alarm", **{twin_signals.CONTROL_ALARM_TEXT: 7}),
        ("The control shows 7 for 9 s", ""),
        ("Die Steuerung meldet 7 seit 9 s", ""),
    ),
    (
        "gap_growing",
        gap(signal="spindle_load_pct", regime="cutting O1701", way="up", amount=6.0, unit="%"),
        ("Spindle load has been drifting away from the twin for 3 d: 6 % higher than while healthy", "in the cut, program O1701"),
        ("Spindellast entfernt sich seit 3 d vom Zwilling: 6 % höher als in gesundem Zustand", "im Schnitt, Programm O1701"),
    ),
    (
        "gap_growing",
        gap(signal="program_time_s", regime="section 3 of O1701", way="down", amount=0.0, unit="s"),
        (
            "Time of a program section has been drifting away from the twin for 3 d: lower than while healthy",
            "section 3, program O1701",
        ),
        (
            "Dauer eines Programmabschnitts entfernt sich seit 3 d vom Zwilling: niedriger als in gesundem Zustand",
            "Abschnitt 3, Programm O1701",
        ),
    ),
    (
        "gap_growing",
        gap(signal="spindle_temp_c", regime="steady", way="scatter"),
        ("Spindle temperature has scattered more about the twin than while healthy for 3 d", "in steady running"),
        ("Spindeltemperatur streut seit 3 d stärker um den Zwilling als in gesundem Zustand", "im gleichmäßigen Betrieb"),
    ),
    (
        "gap_growing",
        gap(signal="spindle_rpm", regime="turning", way="up", amount=40.0, unit="rev/min"),
        (
            "Spindle speed has been drifting away from the twin for 3 d: 40 rev/min higher than while healthy",
            "while the spindle turns",
        ),
        ("Spindeldrehzahl entfernt sich seit 3 d vom Zwilling: 40 U/min höher als in gesundem Zustand", "bei drehender Spindel"),
    ),
    (
        "machine_drift",
        seen("machine_drift", **{twin_signals.MACHINE_DRIFT_FINDINGS: {"since": AT_MS - DAYS_MS, "pct": -4.2}, "tool_number": 3}),
        ("Load of all tools and programs has been 4.2 % lower than at first for 3 d", "not one tool and not one batch alone"),
        (
            "Last aller Werkzeuge und Programme seit 3 d um 4,2 % niedriger als am Anfang",
            "nicht nur ein Werkzeug, nicht nur ein Los",
        ),
    ),
    (
        "score_drift",
        {},
        ("Scores have drifted for 9 s: the model no longer fits the machine", ""),
        ("Bewertung driftet seit 9 s: Das Modell passt nicht mehr zur Maschine", ""),
    ),
    (
        "tool_wears_fast",
        fast(1.0, 0.0, 3.0),
        ("Tool 7 wears fast: its load is 18.4 % over that of a sharp one", "about 1 part left (0 to 3), tool 7"),
        (
            "Werkzeug 7 verschleißt schnell: Seine Last liegt 18,4 % über der eines scharfen",
            "noch etwa 1 Teil (0 bis 3), Werkzeug 7",
        ),
    ),
    (
        "tool_wears_fast",
        fast(12.0, 7.0, 20.0),
        ("Tool 7 wears fast: its load is 18.4 % over that of a sharp one", "about 12 parts left (7 to 20), tool 7"),
        (
            "Werkzeug 7 verschleißt schnell: Seine Last liegt 18,4 % über der eines scharfen",
            "noch etwa 12 Teile (7 bis 20), Werkzeug 7",
        ),
    ),
    (
        MACHINE_OFFLINE,
        {},
        ("No data from the machine for 9 s", ""),
        ("Keine Daten von der Maschine seit 9 s", ""),
    ),
    (
        SOURCE_LOST,
        {},
        ("Machine not monitored for 9 s: a processor has stopped", ""),
        ("Niemand überwacht die Maschine seit 9 s: Ein Prozessor ist stehen geblieben", ""),
    ),
    (
        PROCESSORS_BEHIND,
        late(104.8),
        ("Processors are 18 s behind for 9 s, limit 5 s", "1 machine, 105 % of one core, processor thermal"),
        ("Prozessoren sind seit 9 s um 18 s im Rückstand, Grenze 5 s", "1 Maschine, 105 % eines Kerns, Prozessor thermal"),
    ),
    (
        PROCESSORS_BEHIND,
        late(98.0, runners=2, machines=20, waiting=40_213),
        (
            "Processors are 18 s behind for 9 s, limit 5 s",
            "20 machines, 40213 records wait, the busiest of 2 runners 98 % busy, processor thermal",
        ),
        (
            "Prozessoren sind seit 9 s um 18 s im Rückstand, Grenze 5 s",
            "20 Maschinen, 40213 Sätze warten, der stärkste von 2 Runnern zu 98 % ausgelastet, Prozessor thermal",
        ),
    ),
]


def own(name: str) -> dict[str, Any]:
    """Return the tables that the file of a language holds itself; those that it leaves out would be taken from English."""
    folder = words_folder.files(words_folder.__package__)
    return tomllib.loads((folder / f"{name}{SUFFIX}").read_text(encoding="utf-8"))


@pytest.mark.parametrize("name", shipped())
@pytest.mark.parametrize("alert", NAMES)
def test_every_alarm_there_is_has_its_texts_in_the_file_of_every_language(name: str, alert: str) -> None:
    texts, english = own(name)["alerts"][alert], own("en")["alerts"][alert]
    assert texts.keys() == english.keys() >= {"name", "what", "advice"}
    assert name == "en" or all(texts[key] != english[key] for key in ("name", "what", "advice"))


@pytest.mark.parametrize("name", shipped())
def test_every_file_names_all_signals_regimes_units_and_reasons_that_english_names(name: str) -> None:
    file, english = own(name), own("en")
    for table in ("severities", "alerts", "signals", "sides", "regimes", "units", "reasons"):
        assert file[table].keys() == english[table].keys()
    named = {signal for signal in SIGNALS if not signal.startswith("axis_")} | NUMBERS
    assert file["signals"].keys() >= named
    assert {regime for regimes in REGIMES.values() for regime in regimes} == file["regimes"].keys()
    assert {OFFLINE, NOT_HEARD, NOT_OFFERED} == file["reasons"].keys()


def test_every_alarm_is_tried_below() -> None:
    assert {name for name, *_ in TOLD} == set(NAMES)


@pytest.mark.parametrize(("name", "facts", "english", "german"), TOLD)
def test_an_alarm_is_told_in_the_readers_language_from_its_values(
    name: str, facts: Facts, english: tuple[str, str], german: tuple[str, str]
) -> None:
    for language, (title, details) in {"en": english, "de": german}.items():
        assert told(name, facts, language) == (f"okuma: {title}", details)


def test_an_end_names_the_signal_where_the_name_of_the_alert_does_not() -> None:
    facts = of_score({"signal": "axis_z_load_pct", "measured": 59.0, "expected": 50.0})
    over = Alert("okuma", "anomaly_alarm", "", "f" * 16, Severity.LOW, AT_MS, Phase.RESOLVED, ended_ms=AT_MS + 9000, facts=facts)
    assert wording("en", "UTC", "").summary(over) == "Over after 9 s: machine behaves unusually (load of axis Z)"
    assert wording("de", "UTC", "").summary(over) == "Vorbei nach 9 s: Maschine verhält sich ungewöhnlich (Last der Achse Z)"


@pytest.mark.parametrize("found", ["", "7", "[7]", "{}", "[{}]", '[{"signal": 7, "way": null, "amount": "x", "since": 1e300}]'])
@pytest.mark.parametrize("name", ["gap_growing", "machine_drift", "tool_wears_fast"])
def test_values_that_are_none_leave_the_name_of_the_alert(name: str, found: str) -> None:
    metrics = (twin_signals.GAP_FINDINGS, twin_signals.MACHINE_DRIFT_FINDINGS, twin_signals.TOOL_LIVES)
    row = {metric: Reading(metric, found, AT_MS, Quality.GOOD, None, None, False) for metric in metrics}
    facts = facts_of(TWIN_PREFIX + name, row, AT_MS)
    for language in shipped():
        plain = own(language)["alerts"][name]["name"]
        assert told(name, facts, language)[0].startswith(f"okuma: {plain[:1].upper()}{plain[1:]}")


@pytest.mark.parametrize(
    ("facts", "said"),
    [
        (late(104.8), "Ergebnisse und Meldungen kommen spät. `cnctwin plan fleet` sagt, was das Werk braucht."),
        (late(40.0), "nach dem Broker sehen."),
        (late(40.0, runners=1), "nach dem Log sehen."),
        (late(98.0, runners=2), "Einen weiteren Runner"),
    ],
)
def test_what_to_do_about_processors_that_are_behind_depends_on_why_they_are(facts: Facts, said: str) -> None:
    alert = Alert("plant", PROCESSORS_BEHIND, "", "f" * 16, Severity.MEDIUM, AT_MS, Phase.FIRING, facts=facts)
    assert said in wording("de", "UTC", "").advice(alert)
