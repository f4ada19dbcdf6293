"""The overlay that puts the folds on Kafka: what it changes of compose.yml, what it adds, and what is prepared for it."""

import os
import re
import subprocess
import tomllib
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
import yaml

from processors.discovery import discover
from processors.running.runtime import configured
from tests.deploy.command_lines import parsed
from tests.deploy.go_programs import COMPOSE as COMPOSE_READER
from tests.deploy.go_programs import built
from tests.deploy.kafka_names import BRIDGE, RUNNER, option, processors_of
from tests.deploy.plant import DEPLOY, need_programs
from tests.deploy.test_compose import BROKERS, COMPOSE, FOLDER, MACHINE, STORES, Prepared, mounts, tool

FILE = FOLDER / "kafka.yml"
OVERLAY: dict[str, Any] = yaml.safe_load(FILE.read_text())
MEMORY_MB_MAX = 8192
RUNNERS = ("runner-physics-0", "runner-physics-1")
ON_KAFKA = ("bridge", *RUNNERS, "processors")
PROPERTIES = dict(
    line.split("=", 1) for line in (DEPLOY / "kafka" / "server.properties").read_text().splitlines() if re.match(r"[a-z]", line)
)


def together() -> dict[str, Any]:
    """The services of both files: what the overlay says of one that is there takes the place of what was said, or comes to it."""
    services = {name: dict(service) for name, service in COMPOSE["services"].items()}
    for name, change in OVERLAY["services"].items():
        service = services.setdefault(name, {})
        for key, value in change.items():
            if key in ("environment", "depends_on", "healthcheck"):
                service[key] = {**service.get(key, {}), **value}
            elif key in ("secrets", "networks", "volumes"):
                service[key] = [*service.get(key, []), *value]
            else:
                service[key] = value
    return services


SERVICES = together()


class PreparedForKafka(Prepared):
    """The folder of `KAFKA=yes prepare`."""

    def prepare(self) -> None:
        command = ["bash", str(FOLDER / "prepare"), str(self.home), MACHINE]
        environment = {name: value for name, value in os.environ.items() if name not in ("BROKER", "STORE")}
        subprocess.run(command, check=True, capture_output=True, text=True, env={**environment, "KAFKA": "yes"})


@pytest.fixture(scope="module")
def prepared(tmp_path_factory: pytest.TempPathFactory) -> Iterator[PreparedForKafka]:
    need_programs()
    plant = PreparedForKafka(tmp_path_factory.mktemp("kafka"))
    plant.build()
    yield plant


def test_it_is_a_compose_file() -> None:
    command = [tool("check-jsonschema"), "--builtin-schema", "vendor.compose-spec", str(FILE)]
    checked = subprocess.run(command, capture_output=True, text=True, check=False)
    assert checked.returncode == 0, checked.stdout


@pytest.mark.parametrize("name", ON_KAFKA)
def test_the_program_takes_the_command_of_a_service(name: str) -> None:
    assert parsed(SERVICES[name]["command"])


def test_the_services_are_as_bounded_and_as_powerless_as_the_others() -> None:
    ours, theirs = OVERLAY["x-ours"], COMPOSE["x-ours"]
    assert {key for key in theirs if ours[key] != theirs[key]} == {"depends_on", "stop_grace_period"}
    assert ours["depends_on"] == {**theirs["depends_on"], "kafka": {"condition": "service_healthy"}}
    for name in (*ON_KAFKA, "kafka"):
        service = SERVICES[name]
        assert re.search(r":\d+\.\d+\.\d+$", service["image"]), name
        assert service["read_only"] and service["cap_drop"] == ["ALL"], name
        assert service["security_opt"] == ["no-new-privileges:true"] and service["user"].startswith("${CNCTWIN_USER:?"), name
        assert re.fullmatch(r"\d+m", service["mem_limit"]) and service["pids_limit"] and service["healthcheck"]["test"], name
        assert "ports" not in service and "privileged" not in service, name


@pytest.mark.parametrize("broker", sorted(BROKERS))
@pytest.mark.parametrize("store", sorted(STORES))
def test_all_of_it_fits_a_machine_of_8_gb(broker: str, store: str) -> None:
    running = [one for one in SERVICES.values() if set(one.get("profiles", [broker])) & {broker, store}]
    assert len(running) == 14
    assert sum(int(service["mem_limit"].removesuffix("m")) for service in running) <= MEMORY_MB_MAX


def test_each_processor_runs_once_and_either_runner_takes_over_from_the_other() -> None:
    commands = {name: service["command"] for name, service in SERVICES.items() if service.get("command", [""])[0] == "process"}
    assert set(commands) == {*RUNNERS, "processors", "historian"}
    first, second = (list(commands.pop(name)) for name in RUNNERS)
    assert (option(first, "--member"), option(second, "--member")) == RUNNERS
    first[first.index("--member") + 1] = second[second.index("--member") + 1]
    assert first == second, "processors that are not the same are another consumer group"
    names = [name for command in (first, *commands.values()) for name in processors_of(command)]
    assert len(names) == len(set(names))
    assert set(discover()) - set(names) == {"tool_change_detector"}, "name it in a service of deploy/compose/kafka.yml"


def test_the_bridge_publishes_what_is_folded_on_kafka_and_nothing_else() -> None:
    folded = {name for service in (RUNNERS[0], "processors") for name in processors_of(SERVICES[service]["command"])}
    results = option(SERVICES["bridge"]["command"], "--results").split(",")
    assert set(results) == folded and len(results) == len(folded)
    assert processors_of(SERVICES["processors"]["command"]) == ["alerts"], "it alone has the way out to receivers"


def test_who_need_not_meet_does_not() -> None:
    at = {name: set(SERVICES[name]["networks"]) for name in (*ON_KAFKA, "kafka")}
    assert at.pop("processors") == {"plant", "front"}
    assert set(map(frozenset, at.values())) == {frozenset({"plant"})}
    given = {name: set(SERVICES[name]["secrets"]) for name in (*ON_KAFKA, "kafka")}
    assert given["bridge"] == {"processors_certificate", "processors_key", "kafka_password_bridge"}
    assert all(given[name] == {"kafka_password_runner"} for name in RUNNERS)
    assert given["processors"] == {"processors_certificate", "processors_key", "kafka_password_runner"}
    for name in ON_KAFKA:
        user = BRIDGE if name == "bridge" else RUNNER
        environment = SERVICES[name]["environment"]
        assert environment["CNCTWIN_KAFKA_USERNAME"] == user
        assert environment["CNCTWIN_KAFKA_PASSWORD_FILE"] == f"/run/secrets/kafka_password_{user.removeprefix('cnctwin-')}"
        assert ("CNCTWIN_BROKER" in environment) == (name not in RUNNERS), "a runner speaks to Kafka only"
    assert (
        SERVICES["bridge"]["environment"]["CNCTWIN_BROKER"] == COMPOSE["services"]["historian"]["environment"]["CNCTWIN_BROKER"]
    )


def test_over_the_network_kafka_wants_tls_and_a_password_and_knows_no_rights_but_those_that_are_given() -> None:
    protocols = dict(pair.split(":") for pair in PROPERTIES["listener.security.protocol.map"].split(","))
    where = dict(pair.split("://") for pair in PROPERTIES["listeners"].split(","))
    open_to_all = {name for name, place in where.items() if not place.startswith("127.0.0.1:")}
    assert {protocols[name] for name in open_to_all} == {"SASL_SSL"} and len(protocols) == len(where) == 3
    assert PROPERTIES["authorizer.class.name"].endswith(".StandardAuthorizer")
    assert PROPERTIES["allow.everyone.if.no.acl.found"] == PROPERTIES["auto.create.topics.enable"] == "false"
    assert PROPERTIES["super.users"] == "User:ANONYMOUS", "whom only the listeners on loopback know"
    assert not any("password" in line for line in (f"{key}={value}" for key, value in PROPERTIES.items()))
    advertised = dict(pair.split("://") for pair in PROPERTIES["advertised.listeners"].split(","))
    assert {option(SERVICES[name]["command"], "--kafka") for name in ON_KAFKA} == {advertised[name] for name in open_to_all}


def test_kafka_is_started_with_the_users_that_the_rights_are_for() -> None:
    script = (DEPLOY / "kafka" / "start").read_text()
    made = re.search(r"^    for user in ([\w ]+); do$", script, re.M)
    assert made and {f"cnctwin-{user}" for user in made[1].split()} == {BRIDGE, RUNNER}
    inside = {volume.split(":")[1] for volume in SERVICES["kafka"]["volumes"][:-2]}
    named = {path.replace("$etc", "/etc/kafka/cnctwin") for path in re.findall(r'"(\$etc/[\w.]+)"', script)}
    assert named | {"/etc/kafka/cnctwin/start", "/etc/kafka/cnctwin/log4j2.yaml"} == inside
    assert PROPERTIES["log.dirs"].startswith("/var/lib/kafka/data/"), "where the image would put a volume of its own"
    assert ":/var/lib/kafka/data" in SERVICES["kafka"]["volumes"][-1]


def test_everything_that_is_mounted_is_there_and_a_secret_is_its_owner_s(prepared: PreparedForKafka) -> None:
    for name in (*ON_KAFKA, "kafka"):
        for source, inside in mounts(SERVICES[name], prepared):
            assert source.exists() and Path(inside).is_absolute(), f"{name}: {source}"
    for secret in OVERLAY["secrets"].values():
        path = Path(prepared.put_in(secret["file"]))
        assert path.stat().st_mode & 0o077 == 0
        assert re.fullmatch(r"[0-9a-f]{48}", path.read_text().strip())
        assert path.read_text().strip() not in FILE.read_text() + (prepared.home / ".env").read_text()
    assert (prepared.home / "secrets/kafka.pem").stat().st_mode & 0o077 == 0


def test_kafka_has_key_and_certificate_for_the_name_that_it_is_asked_by(prepared: PreparedForKafka) -> None:
    pem = prepared.home / "secrets/kafka.pem"
    assert pem.read_text().startswith("-----BEGIN PRIVATE KEY-----") and pem.read_text().count("BEGIN CERTIFICATE") == 1
    host = option(SERVICES["bridge"]["command"], "--kafka").partition(":")[0]
    asked = ["openssl", "x509", "-in", str(pem), "-noout", "-checkhost", host]
    assert "does match" in subprocess.run(asked, check=True, capture_output=True, text=True).stdout
    authority = str(prepared.home / "etc/cnctwin/ca.pem")
    subprocess.run(["openssl", "verify", "-CAfile", authority, str(pem)], check=True, capture_output=True)


def test_the_configuration_of_the_programs_is_found_where_it_says_and_fits_one_broker(prepared: PreparedForKafka) -> None:
    shipped, config = (
        tomllib.loads(path.read_text()) for path in (DEPLOY / "kafka/kafka.toml", prepared.home / "etc/cnctwin/kafka.toml")
    )
    assert config == shipped | {"replication_factor": 1, "ca_file": "/etc/cnctwin/ca.pem"}
    assert (config["security_protocol"], config["sasl_mechanism"]) == ("sasl_ssl", "SCRAM-SHA-512")
    assert config["partitions"] >= len(RUNNERS)
    assert (prepared.home / "etc/cnctwin/ca.pem").is_file()
    names = [name for service in (RUNNERS[0], "processors") for name in processors_of(SERVICES[service]["command"])]
    assert len(configured(names, prepared.home / "etc/cnctwin/processors.toml")) == len(names)


def test_a_second_preparation_changes_nothing_and_without_kafka_nothing_of_it_is_made(
    prepared: PreparedForKafka, tmp_path: Path
) -> None:
    def now() -> dict[Path, bytes]:
        return {path: path.read_bytes() for path in prepared.home.rglob("*") if path.is_file()}

    before = now()
    prepared.prepare()
    assert now() == before
    plain = Prepared(tmp_path / "plain")
    plain.home.mkdir()
    plain.prepare()
    assert [path for path in plain.home.rglob("*") if "kafka" in path.name] == []


def test_compose_itself_reads_both_files_as_this_test_does(prepared: PreparedForKafka, tmp_path: Path) -> None:
    """Read by the library that docker compose reads them with; its variables are put in before, as `--env-file` does."""
    program = built(COMPOSE_READER)
    files = [tmp_path / "compose.yml", tmp_path / "kafka.yml"]
    for file in files:
        file.write_text(prepared.put_in((FOLDER / file.name).read_text()))
    command = [str(program), "-no-path-resolution", *map(str, files)]
    done = subprocess.run(command, capture_output=True, text=True, check=False, cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    services = yaml.safe_load(done.stdout)["services"]
    assert set(services) == set(SERVICES)
    for name in (*ON_KAFKA, "kafka", "historian"):
        read, ours = services[name], SERVICES[name]
        assert read["command"] == [prepared.put_in(word) for word in ours["command"]], name
        environment = read["environment"]
        pairs = dict(pair.split("=", 1) for pair in environment) if isinstance(environment, list) else environment
        assert pairs == {key: prepared.put_in(value) for key, value in ours["environment"].items()}, name
        assert {secret["source"] for secret in read["secrets"]} == set(ours["secrets"]), name
        assert set(read["networks"]) == set(ours["networks"]), name
        assert {volume["target"] for volume in read["volumes"]} == {inside for _, inside in mounts(ours, prepared)}, name
        assert (read["mem_limit"], read["healthcheck"]["test"]) == (ours["mem_limit"], ours["healthcheck"]["test"]), name
        assert set(read.get("depends_on", {})) == set(ours.get("depends_on", {})), name
