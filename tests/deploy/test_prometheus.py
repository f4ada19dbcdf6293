"""The alert rules: promtool takes them, each fires and keeps still when it should, and on what the runtime interface exports."""

import re
import shutil
import subprocess
from pathlib import Path
from typing import Any

import pytest
import yaml

from tests.deploy.plant import DEPLOY
from tests.deploy.test_grafana import DASHBOARDS, document, queries
from tests.recordings import PROJECT

FOLDER = DEPLOY / "prometheus"
CASES = Path(__file__).with_name("prometheus_rules_test.yml")
METRIC = re.compile(r"\btwin_[a-z_]+")


def _rules() -> list[dict[str, Any]]:
    groups = yaml.safe_load((FOLDER / "rules.yml").read_text())["groups"]
    return [rule for group in groups for rule in group["rules"]]


def promtool(*arguments: object) -> subprocess.CompletedProcess[str]:
    if shutil.which("promtool") is None:
        pytest.skip("no promtool on this machine; install the package prometheus")
    return subprocess.run(["promtool", *map(str, arguments)], capture_output=True, text=True, check=False)


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """The configuration with the paths of the container moved to where it lies here."""
    configuration = (FOLDER / "prometheus.yml").read_text()
    (tmp_path / "page_token").write_text("x" * 32)
    for theirs, ours in (("/etc/prometheus", tmp_path), ("/run/secrets", tmp_path)):
        assert theirs in configuration
        configuration = configuration.replace(theirs, str(ours))
    (tmp_path / "prometheus.yml").write_text(configuration)
    document = yaml.safe_load((FOLDER / "rules.yml").read_text())
    for rule in document["groups"][0]["rules"]:
        del rule["annotations"]  # promtool would compare what they say, word for word
    (tmp_path / "rules.yml").write_text(yaml.safe_dump(document))
    (tmp_path / "cases.yml").write_text(CASES.read_text())
    return tmp_path


def test_promtool_takes_configuration_and_rules(folder: Path) -> None:
    for arguments in (("check", "config", folder / "prometheus.yml"), ("check", "rules", "--lint-fatal", FOLDER / "rules.yml")):
        checked = promtool(*arguments)
        assert checked.returncode == 0, checked.stdout + checked.stderr


def test_each_rule_fires_and_keeps_still_when_it_should(folder: Path) -> None:
    tested = promtool("test", "rules", folder / "cases.yml")
    assert tested.returncode == 0, tested.stdout + tested.stderr


def test_a_rule_that_is_wrong_fails_its_cases(folder: Path) -> None:
    rules = (folder / "rules.yml").read_text()
    assert "twin_validation_nights_over_budget >= 2" in rules
    (folder / "rules.yml").write_text(rules.replace("nights_over_budget >= 2", "nights_over_budget >= 1"))
    cases = yaml.safe_load((folder / "cases.yml").read_text())
    (folder / "cases.yml").write_text(yaml.safe_dump({**cases, "tests": cases["tests"][-1:]}))
    assert promtool("test", "rules", folder / "cases.yml").returncode != 0


def test_every_rule_has_a_case_in_which_it_fires_and_one_in_which_it_does_not() -> None:
    cases = [case for test in yaml.safe_load(CASES.read_text())["tests"] for case in test["alert_rule_test"]]
    for rule in _rules():
        said = [bool(case["exp_alerts"]) for case in cases if case["alertname"] == rule["alert"]]
        assert set(said) == {True, False} or rule["alert"] == "CnctwinNotScraped", rule["alert"]


def test_what_a_rule_says_names_only_labels_that_it_has() -> None:
    cases = [case for test in yaml.safe_load(CASES.read_text())["tests"] for case in test["alert_rule_test"]]
    for rule in _rules():
        named = set(re.findall(r"\$labels\.(\w+)", " ".join(rule["annotations"].values())))
        carried = [
            set(alert["exp_labels"]) for case in cases if case["alertname"] == rule["alert"] for alert in case["exp_alerts"]
        ]
        assert all(named <= labels for labels in carried), rule["alert"]


def exported() -> set[str]:
    """The names in the source of the runtime interface; of counters, as a scrape shows them."""
    source = "\n".join(path.read_text() for path in (PROJECT / "cnctwin" / "api" / "prometheus").glob("*.py"))
    names = set(METRIC.findall(source)) | {"twin_received", "twin_emitted"}
    return names | {f"{name}_total" for name in names}


def test_rules_and_dashboards_ask_for_what_the_runtime_interface_exports() -> None:
    asked = {name for rule in _rules() for name in METRIC.findall(rule["expr"])}
    for path in DASHBOARDS:
        asked |= {
            name
            for _, query in queries(document(path))
            for name in METRIC.findall(query.get("expr", "").replace("cnc_twin_", ""))
        }
    assert len(asked) > 20
    assert asked - exported() == set()
