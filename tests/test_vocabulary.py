"""A name that several packages share is spelled in one place: twin/vocabulary."""

import ast
import re
from collections import defaultdict
from functools import cache
from pathlib import Path

import pytest

from cnctwin.api.prometheus.text import MACHINE_GAUGES, NODE_COUNTERS, NODE_GAUGES
from cnctwin.jobs.announcer import METRICS as JOB_METRICS
from cnctwin.memory.store.influx.codes import CODES
from edge.running.health import HEALTH
from processors.discovery import discover
from processors.running.health import node_metrics
from twin.vocabulary import signals, topics, twin_signals
from twin.vocabulary.signals import SIGNALS, canonical

ROOT = Path(__file__).parent.parent
VOCABULARY = ROOT / "twin" / "vocabulary"
SOURCES = sorted(
    path
    for folder in ("twin", "edge", "processors", "cnctwin", "deploy/grafana/dashboard_source")
    for path in (ROOT / folder).rglob("*.py")
    if VOCABULARY not in path.parents
)
PAGE = ROOT / "cnctwin" / "page" / "web" / "js"
PROCESSORS = discover()
PUBLISHED = {spec.name for processor in PROCESSORS.values() for spec in processor.outputs} | {spec.name for spec in JOB_METRICS}
TOPIC = re.compile(r"(?<![\w/.])(cnctwin|cnc|spBv1\.0)/")
NO_TOPICS = {("cnctwin/models/mlflow_export.py", "cnctwin/")}  # the name of an experiment
PREFIXES = {"TWIN_PREFIX": twin_signals.TWIN_PREFIX, "RULE_PREFIX": twin_signals.RULE_PREFIX}


@cache
def texts(path: Path) -> frozenset[str]:
    """Return the string literals of a file, prefixes of the vocabulary put in; docstrings are prose."""
    nodes = list(ast.walk(ast.parse(path.read_text())))
    formatted = [node for node in nodes if isinstance(node, ast.JoinedStr)]
    no_text = {id(node.value) for node in nodes if isinstance(node, ast.Expr)}
    no_text |= {id(part) for node in formatted for part in node.values}
    plain = {n.value for n in nodes if isinstance(n, ast.Constant) and isinstance(n.value, str) and id(n) not in no_text}
    return frozenset(plain | {"".join(map(part_text, one.values)) for one in formatted})


def part_text(part: ast.expr) -> str:
    if isinstance(part, ast.Constant):
        return str(part.value)
    assert isinstance(part, ast.FormattedValue)
    value = part.value
    return PREFIXES.get(value.id if isinstance(value, ast.Name) else value.attr if isinstance(value, ast.Attribute) else "", "{}")


TIMES = (signals.TOOL_CHANGE_S, signals.PROGRAM_TIME_S)


def test_a_plain_topic_is_spelled_in_the_vocabulary_only() -> None:
    spelled = {
        (str(path.relative_to(ROOT)), found[0]) for path in SOURCES for text in texts(path) if (found := TOPIC.search(text))
    }
    assert spelled == NO_TOPICS


def test_a_name_of_the_twin_is_spelled_in_one_file_at_most() -> None:
    files: defaultdict[str, set[str]] = defaultdict(set)
    for name, value in vars(twin_signals).items():
        if name.isupper() and isinstance(value, str):
            files[value].add("twin/vocabulary")
    for path in SOURCES:
        for text in texts(path):
            if text == twin_signals.TWIN_PREFIX or re.fullmatch(r"twin/[a-z_0-9]+", text):
                files[text].add(str(path.relative_to(ROOT)))
    assert len(files) > 60
    assert {name: places for name, places in files.items() if len(places) > 1} == {}


def test_every_name_of_the_vocabulary_is_published_by_someone() -> None:
    names = {value for key, value in vars(twin_signals).items() if key.isupper() and isinstance(value, str)}
    assert {name for name in names if not name.endswith(("/", "_"))} <= PUBLISHED
    assert {rule.name for rule in PROCESSORS["rules"].outputs if rule.is_alarm} == set(twin_signals.RULES)
    assert {spec.name for spec in PROCESSORS["gap"].outputs if twin_signals.is_gap(spec.name)} <= {
        twin_signals.GAP_PREFIX + name for name in (*SIGNALS, *TIMES, *(f"axis_{letter}_load_pct" for letter in "xyzabc"))
    }


@pytest.mark.parametrize("name", PROCESSORS)
def test_a_processor_reads_what_somebody_publishes(name: str) -> None:
    raw = {signals.VIBRATION_BLOCK_G, signals.VIBRATION_SAMPLE_RATE_HZ}
    assert {one for one in PROCESSORS[name].signals or () if canonical(one) is None} <= PUBLISHED | raw


def test_the_metrics_for_prometheus_come_from_signals_that_somebody_publishes() -> None:
    nodes = {spec.name for spec in (*HEALTH, *node_metrics(records=True, on_log=True))}
    assert {name for name, _ in (*NODE_GAUGES.values(), *NODE_COUNTERS.values())} <= nodes
    assert {name for name, _ in MACHINE_GAUGES.values() if canonical(name) is None} <= PUBLISHED


def test_words_that_have_a_number_in_stores_are_words_of_the_signal() -> None:
    assert all(set(words) <= SIGNALS[name].words for name, words in CODES.items() if name in SIGNALS)
    assert set(CODES) - set(SIGNALS) <= PUBLISHED


def test_the_page_spells_no_name_of_the_twin() -> None:
    spelled = {
        (path.name, text)
        for path in PAGE.rglob("*.js")
        if path.name != "vocabulary.js"
        for text in re.findall(r"[\"'`](twin/[^\"'`]*)[\"'`]", re.sub(r"//.*|/\*.*?\*/", "", path.read_text()))
    }
    assert spelled == {("recompute.js", "twin/replay")}  # a route of the interface


def test_the_pages_of_the_documentation_name_what_is_published() -> None:
    for page in (ROOT / "docs").rglob("*.md"):
        for name in re.findall(r"`(twin/[a-z_0-9]+(?:/[a-z_]+)?)`", page.read_text()):
            assert name in PUBLISHED or (ROOT / name).exists(), f"{page.name} names {name}"


@pytest.mark.parametrize(
    "path", [*ROOT.glob("deploy/mosquitto/*.acl"), ROOT / "deploy/hivemq/credentials.xml"], ids=lambda path: path.name
)
def test_who_may_write_where_is_said_of_topics_that_there_are(path: Path) -> None:
    known = [value for name, value in vars(topics).items() if name.isupper() and isinstance(value, str)]
    known += [topics.edge_barrier("", ""), topics.dead_letters_of(""), topics.marker_of("")]
    known = [one.rstrip("/") for one in known if one not in (topics.OWN, topics.ALERTS)]
    for topic in re.findall(rf"{topics.OWN}[a-z-]+(?:/[a-z]+)?", path.read_text()):
        assert any(topic == one or topic.startswith(one + "/") for one in known), topic


def test_a_text_that_reads_like_a_canonical_signal_is_one() -> None:
    """Canonical names are spelled where they are used; a slip of the pen among them would be a signal that nobody publishes."""
    subjects = "|".join(sorted({name.split("_")[0] for name, known in SIGNALS.items() if known.unit} | {r"axis_[a-z]\d?"}))
    like = re.compile(rf"({subjects})_([a-z_]+_)?(rpm|rpm_cmd|pct|kw|a|c|g|mm_min|mm_s|pos_mm|pos_deg|s)")
    found = {text for path in SOURCES if ROOT / "twin" not in path.parents for text in texts(path) if like.fullmatch(text)}
    found |= {
        word
        for path in PAGE.rglob("*.js")
        for word in re.findall(r"(?<![\w/])[a-z_]+\b", path.read_text())
        if like.fullmatch(word)
    }
    others = {name.removeprefix(twin_signals.TWIN_PREFIX) for name in PUBLISHED} | {signals.VIBRATION_BLOCK_G, *TIMES}
    assert len(found) > 15
    assert {name for name in found - others if canonical(name) is None} == set()
