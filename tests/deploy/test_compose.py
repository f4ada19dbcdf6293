"""The compose file: what it starts, mounts, asks and limits; and the folder that `prepare` makes, with a real broker in it."""

import asyncio
import getpass
import os
import re
import shutil
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import httpx
import pytest
import yaml
from fastapi import FastAPI

from cnctwin.api.access import Access
from cnctwin.api.application import create_app
from cnctwin.api.live.plant import LivePlant
from cnctwin.api.sources import Sources
from cnctwin.jobs.client import JobsClient
from cnctwin.machines.place import machines_folder
from cnctwin.memory.store.influx.address import parse
from cnctwin.memory.store.opening import default_place
from edge.config_file import load
from edge.running.run import broker_addresses
from processors.description import Description
from processors.discovery import discover
from processors.running.runtime import configured
from sparkplug.broker import BrokerAddress
from tests.deploy.command_lines import parsed
from tests.deploy.plant import DEPLOY, PEOPLE, PROCESSORS, Plant, need_programs
from tests.deploy.wire_client import WireClient

FOLDER = DEPLOY / "compose"
COMPOSE: dict[str, Any] = yaml.safe_load((FOLDER / "compose.yml").read_text())
SERVICES: dict[str, Any] = COMPOSE["services"]
OURS = {name: service for name, service in SERVICES.items() if service["image"].startswith("cnctwin:")}
BROKERS, STORES = {"mosquitto", "hivemq"}, {"victoriametrics", "influxdb"}
MEMORY_MB_MAX = 4096
MACHINE = "mazak"
IMAGE_VARIABLES = dict(re.findall(r"(CNCTWIN_\w+|NUMBA_\w+)=(\S+)", (DEPLOY / "image" / "Dockerfile").read_text()))


class Prepared(Plant):
    """The folder of `prepare`, and a Mosquitto that runs with what is in it."""

    def build(self) -> None:
        need_programs()
        self.prepare()
        self.authority = self.home / "authority"

    def prepare(self) -> None:
        command = ["bash", str(FOLDER / "prepare"), str(self.home), MACHINE]
        environment = {name: value for name, value in os.environ.items() if name not in ("BROKER", "STORE")}
        subprocess.run(command, check=True, capture_output=True, text=True, env=environment)

    def run(self) -> None:
        """Start the broker: only ports and places differ from what is in its container."""
        configuration = self.home / "etc" / "mosquitto" / "mosquitto.conf"
        text = configuration.read_text().replace("/etc/mosquitto/", f"{self.home}/etc/mosquitto/")
        text = text.replace("/var/lib/mosquitto/", f"{self.home}/state/mosquitto/")
        text = re.sub(r"^listener (\d+)$", lambda found: f"listener {self.ports[int(found[1])]} 127.0.0.1", text, flags=re.M)
        own = self.home / "etc" / "mosquitto.conf"
        own.write_text(f"{text}\nlistener {self.ports[0]} 127.0.0.1\nallow_anonymous true\nuser {getpass.getuser()}\n")
        self.start()

    @property
    def environment(self) -> dict[str, str]:
        """Return what `docker compose --env-file` reads."""
        lines = [line for line in (self.home / ".env").read_text().splitlines() if line and not line.startswith("#")]
        return dict(line.split("=", 1) for line in lines)

    def put_in(self, text: str) -> str:
        """A text of the compose file with its variables."""
        return re.sub(r"\$\{(\w+)(?::[-?][^}]*)?\}", lambda found: self.environment[found[1]], text)

    def seen_from_here(self, text: str, service: dict[str, Any]) -> str:
        """The same with the places and the broker of this machine, where it has those of a container."""
        places = {inside: str(source) for source, inside in mounts(service, self)}
        places |= {f"/run/secrets/{one}": self.put_in(COMPOSE["secrets"][one]["file"]) for one in service.get("secrets", [])}
        places |= {f"broker:{port}": f"localhost:{self.ports[port]}" for port in (PEOPLE, PROCESSORS)} | {"/tmp": str(self.home)}
        known = "|".join(map(re.escape, sorted(places, key=len, reverse=True)))
        return re.sub(rf"(?<!\w)({known})(?!\w)", lambda found: places[found[1]], self.put_in(text))

    @property
    def page(self) -> BrokerAddress:
        """As the page comes in, with its password."""
        password = (self.home / "secrets" / "page.env").read_text().strip().partition("=")[2]
        papers = {"tls": True, "ca_file": self.authority / "ca.pem"}
        return BrokerAddress("localhost", self.ports[PEOPLE], username="page", **papers).with_password(password)

    def start_service(self, name: str) -> subprocess.Popen[str]:
        """A service of ours, with its own command line and its own environment, which has nothing of the test's.

        As where the source lies on a read-only file system and nobody is at home, numba can keep something only where it is told.
        """
        service = OURS[name]
        variables = {**IMAGE_VARIABLES, **service["environment"]}
        told = {key: self.seen_from_here(value, service) for key, value in variables.items()}
        words = [self.seen_from_here(word, service) for word in service["command"]]
        told |= {"NUMBA_CACHE_LOCATOR_CLASSES": "UserProvidedCacheLocator"}
        return subprocess.Popen([tool("cnctwin"), *words], env=told, cwd=self.home, stderr=subprocess.PIPE, text=True)


@pytest.fixture(scope="module")
def running(prepared: "Prepared") -> Prepared:
    """With its broker at work."""
    prepared.run()
    return prepared


@pytest.fixture(scope="module")
def prepared(tmp_path_factory: pytest.TempPathFactory, mosquitto_program: str) -> Iterator[Prepared]:
    assert mosquitto_program
    plant = Prepared(tmp_path_factory.mktemp("compose"))
    plant.build()
    yield plant
    plant.stop()


def is_over(job: dict[str, Any]) -> bool:
    """Return whether nothing more becomes of it."""
    return job["state"] not in {"queued", "running"}


def tool(name: str) -> str:
    return str(Path(sys.executable).with_name(name))


def command(service: dict[str, Any]) -> list[str]:
    return [re.sub(r"\$\{(\w+)[^}]*\}", r"\1", word) for word in service["command"]]


def mounts(service: dict[str, Any], prepared: Prepared) -> list[tuple[Path, str]]:
    """Return what of the host lies where in the container."""
    return [
        ((FOLDER / source).resolve() if source.startswith(".") else Path(source), inside)
        for source, inside in (prepared.put_in(volume).split(":")[:2] for volume in service.get("volumes", []))
    ]


def test_it_is_a_compose_file() -> None:
    checked = subprocess.run(
        [tool("check-jsonschema"), "--builtin-schema", "vendor.compose-spec", str(FOLDER / "compose.yml")],
        capture_output=True,
        text=True,
        check=False,
    )
    assert checked.returncode == 0, checked.stdout


@pytest.mark.parametrize("name", OURS)
def test_the_program_takes_the_command_of_a_service(name: str) -> None:
    assert parsed(command(OURS[name]))


def test_each_service_is_pinned_bounded_and_has_no_rights_that_it_does_not_need() -> None:
    for name, service in SERVICES.items():
        assert re.search(r":v?\d+\.\d+(\.\d+)?$", service["image"]), name
        assert service["read_only"] and service["cap_drop"] == ["ALL"], name
        assert service["security_opt"] == ["no-new-privileges:true"], name
        assert service["user"].startswith("${CNCTWIN_USER:?"), name
        assert re.fullmatch(r"\d+m", service["mem_limit"]) and service["pids_limit"], name
        assert "test" in service["healthcheck"] or name == "validate", name
        assert "privileged" not in service and "network_mode" not in service, name


@pytest.mark.parametrize("broker", sorted(BROKERS))
@pytest.mark.parametrize("store", sorted(STORES))
def test_all_of_it_fits_a_small_machine(broker: str, store: str) -> None:
    running = {name: one for name, one in SERVICES.items() if set(one.get("profiles", [broker])) & {broker, store}}
    assert len(running) == 10
    limits = {name: int(service["mem_limit"].removesuffix("m")) for name, service in running.items()}
    # On top: where memory is short the kernel ends a job first, and that is started again.
    assert limits.pop("jobs") <= MEMORY_MB_MAX / 4
    assert limits.pop("loop") <= MEMORY_MB_MAX / 4
    assert sum(limits.values()) <= MEMORY_MB_MAX


def test_who_need_not_meet_does_not() -> None:
    networks = {name: set(service["networks"]) for name, service in SERVICES.items()}
    assert all(COMPOSE["networks"][name]["internal"] for name in ("plant", "data"))
    assert {name for name, at in networks.items() if "machines" in at} == {"edge"}
    assert networks["edge"] == {"machines", "plant"} and networks["jobs"] == {"plant"}
    assert all(networks[name] == {"data"} for name in (*STORES, "prometheus"))
    assert {name for name, service in SERVICES.items() if "ports" in service} == {*BROKERS, "page", "grafana"}
    for service in SERVICES.values():
        assert all(port.startswith("${CNCTWIN_LISTEN:-127.0.0.1}:") for port in service.get("ports", []))


def test_no_secret_stands_in_it_or_in_its_environment(prepared: Prepared) -> None:
    files = [path for path in (prepared.home / "secrets").rglob("*") if path.is_file()]
    assert len(files) > 8
    for path in (*files, *(prepared.home / "etc").rglob("*.passwords")):
        assert path.stat().st_mode & 0o077 == 0, path
        words = re.findall(r"[0-9a-f]{48}", path.read_text())
        assert all(word not in (FOLDER / "compose.yml").read_text() + (prepared.home / ".env").read_text() for word in words)
    made = [path.read_text() for path in files if "password" in path.name or "token" in path.name]
    assert len(set(made)) == len(made) > 4 and all(len(text.strip()) == 48 for text in made)


def test_everything_that_is_mounted_is_there(prepared: Prepared) -> None:
    for name, service in SERVICES.items():
        if name == "hivemq":
            continue
        for source, inside in mounts(service, prepared):
            assert source.exists(), f"{name}: {source}"
            assert Path(inside).is_absolute()
        for file in service.get("env_file", []):
            assert Path(prepared.put_in(file)).is_file(), f"{name}: {file}"
        for secret in service.get("secrets", []):
            assert Path(prepared.put_in(COMPOSE["secrets"][secret]["file"])).is_file(), f"{name}: {secret}"
        if os.getuid() == 0:
            assert all(path.stat().st_uid != 0 for path, _ in mounts(service, prepared) if prepared.home in path.parents), name


def test_a_second_preparation_changes_nothing(prepared: Prepared) -> None:
    def now() -> dict[Path, bytes]:
        return {path: path.read_bytes() for path in prepared.home.rglob("*") if path.is_file()}

    before = now()
    prepared.prepare()
    assert now() == before


def test_what_the_configuration_names_is_mounted_where_it_says(prepared: Prepared) -> None:
    edge = OURS["edge"]
    inside = {target: source for source, target in mounts(edge, prepared)}
    folder = inside["/etc/cnctwin"] / parsed(command(edge))["config"].relative_to("/etc/cnctwin")
    config = load(folder / f"{MACHINE}.toml")
    (address,) = broker_addresses(config.broker, folder / f"{MACHINE}.toml")
    assert (config.node, address.host, address.port, config.store.await_receipt) == (f"edge-{MACHINE}", "broker", 8883, True)
    for file in (address.ca_file, address.certificate_file, address.key_file):
        assert file is not None
        place = next(target for target in inside if file.is_relative_to(target))
        assert (inside[place] / file.relative_to(place)).is_file(), file
    names = [
        name for service in OURS.values() if service["command"][0] == "process" for name in parsed(command(service))["names"]
    ]
    assert set(discover()) - set(names) == {"tool_change_detector"}, "name it in a service of deploy/compose/compose.yml"
    assert len(configured(names, inside["/etc/cnctwin"] / "processors.toml")) == len(set(names))


def test_the_brokers_of_all_services_are_addresses_that_their_files_fit(prepared: Prepared) -> None:
    for name in ("processors", "historian", "jobs", "loop", "page"):
        service = OURS[name]
        address = BrokerAddress.from_url(service["environment"]["CNCTWIN_BROKER"])
        assert (address.host, address.tls) == ("broker", True)
        assert address.port == (PEOPLE if name == "page" else PROCESSORS)
        given = {f"/run/secrets/{secret}" for secret in service["secrets"]}
        assert {str(file) for file in (address.certificate_file, address.key_file) if file} <= given
    assert "CNCTWIN_PASSWORD=" in (prepared.home / "secrets" / "page.env").read_text()


def test_the_prepared_broker_lets_in_who_has_the_papers(running: Prepared) -> None:
    with WireClient(running.page) as reader, WireClient(running.with_certificate(f"edge-{MACHINE}")) as edge:
        reader.subscribe("spBv1.0/cnc/#")
        edge.settle(edge.publish(f"spBv1.0/cnc/NDATA/edge-{MACHINE}", b"1"))
        reader.until(lambda: bool(reader.received), "what the edge says")
    with WireClient(running.with_certificate("processors", PROCESSORS)) as processors:
        processors.settle(processors.publish(f"spBv1.0/cnc/DCMD/edge-{MACHINE}/{MACHINE}", b"1"))


def test_the_page_offers_the_results_that_the_consumer_keeps_and_can_change_none(prepared: Prepared) -> None:
    kept, shown = (parsed(command(OURS[name]))[option] for name, option in (("jobs", "folder"), ("page", "jobs")))
    keeps = {inside: source for source, inside in mounts(OURS["jobs"], prepared)}
    assert dict(mounts(OURS["page"], prepared))[keeps["/var/lib/cnctwin"] / kept.relative_to("/var/lib/cnctwin")] == str(shown)
    assert f"{shown}:ro" in "\n".join(OURS["page"]["volumes"])
    assert f"{parsed(command(OURS['jobs']))['files']}:ro" in "\n".join(OURS["jobs"]["volumes"])


def test_the_loop_alone_changes_descriptions_and_works_where_the_jobs_are(prepared: Prepared) -> None:
    given, where = parsed(command(OURS["loop"])), {inside: source for source, inside in mounts(OURS["loop"], prepared)}
    folder = where[str(given["machines"])]
    assert folder == prepared.home / "etc/cnctwin/machines"
    (file,) = folder.glob("*.toml")
    found = Description.from_toml(file.read_text(), str(file)).machine.machine
    assert (file.stem, found.name, found.assumed) == (MACHINE, MACHINE, ("thermal", "spindle", "tool"))
    mounted = {name: [at for at in one["volumes"] if ":/etc/cnctwin" in at] for name, one in OURS.items()}
    assert [name for name, each in mounted.items() if not all(at.endswith(":ro") for at in each)] == ["loop"]
    jobs = {inside: source for source, inside in mounts(OURS["jobs"], prepared)}
    files, kept = (parsed(command(OURS["jobs"]))[option] for option in ("files", "folder"))
    assert where[str(given["jobs_files"])] == jobs[str(files)]
    assert where[str(given["jobs"])] == jobs["/var/lib/cnctwin"] / kept.relative_to("/var/lib/cnctwin")
    assert machines_folder(None, where["/etc/cnctwin"] / "processors.toml") == folder, "the others find it beside --config"


@pytest.mark.broker
def test_a_machine_is_described_by_the_file_of_its_folder_and_the_loop_keeps_its_document(running: Prepared) -> None:
    services = [running.start_service(name) for name in ("processors", "loop")]
    try:
        with WireClient(running.page) as reader:
            reader.subscribe("cnctwin/description/#", f"cnctwin/loop/{MACHINE}")
            wanted = {f"cnctwin/description/{MACHINE}/live", f"cnctwin/loop/{MACHINE}"}
            reader.until(lambda: {topic for topic, payload in reader.received if payload} >= wanted, "description and loop")
    finally:
        for service in services:
            service.terminate()
        told = [service.communicate(timeout=30)[1] for service in services]
    assert [service.returncode for service in services] == [0, 0], told


@pytest.mark.broker
def test_a_job_goes_through_the_command_of_its_service_under_the_rules(running: Prepared) -> None:
    """One that ends at once with a line of its own: what is real of it takes minutes."""
    cases = {inside: source for source, inside in mounts(OURS["jobs"], running)}["/srv/cnctwin"]
    (cases / "empty").mkdir()
    (cases / "empty/case.toml").write_text("[case]\nname = 'empty'\nmachine = 'machine.toml'\n")
    (cases / "empty/machine.toml").write_text("[machine]\nname = 'small'\n")
    service = running.start_service("jobs")
    try:
        with JobsClient(running.page) as page:
            assert page.submit({"job": "diagnose", "case": "empty", "id": "d"}, 60)["answer"] == "accepted"
            job = page.until(lambda: is_over(page.job("d")) and page.job("d"), 60)
    finally:
        service.terminate()
        said = service.communicate(timeout=30)[1]
    assert job, said
    assert (job["state"], job["machine"]) == ("failed", "small")
    assert job["reason"].startswith("empty/case.toml: runs is missing")
    kept = {path.name for path in (running.home / "state/jobs/jobs/d").iterdir()}
    assert kept >= {"request.json", "state.json", "outcome.json", "child.log"}
    assert service.returncode == 0, said


def test_what_is_asked_for_health_and_metrics_is_served() -> None:
    """As compose and Prometheus ask: by these names, with the token or without."""
    options = parsed(command(OURS["page"]))
    token = "x" * 48
    app = create_app(Sources(LivePlant(), access=Access(token=token, hosts=frozenset(options["allow_host"]))))
    health = re.findall(r"http://[\w.:]+(/[\w/]+)", " ".join(OURS["page"]["healthcheck"]["test"]))
    scrape = yaml.safe_load((DEPLOY / "prometheus" / "prometheus.yml").read_text())["scrape_configs"][0]
    target = scrape["static_configs"][0]["targets"][0]
    assert target == f"page:{options['port']}"
    assert [_asked(app, f"http://127.0.0.1:{options['port']}{path}").status_code for path in health] == [200]
    metrics = f"http://{target}{scrape['metrics_path']}"
    assert _asked(app, metrics).status_code == 401
    told = _asked(app, metrics, Authorization=f"Bearer {token}")
    assert told.status_code == 200 and "twin_node_online" in told.text


def _asked(app: FastAPI, url: str, **headers: str) -> httpx.Response:
    async def ask() -> httpx.Response:
        async with httpx.AsyncClient(transport=httpx.ASGITransport(app=app, client=("192.0.2.7", 40000))) as client:
            return await client.get(url, headers=headers)

    return asyncio.run(ask())


def test_the_user_of_the_page_may_do_the_same_on_both_brokers() -> None:
    mosquitto = (DEPLOY / "mosquitto" / "people.acl").read_text().partition("user page\n")[2].strip().splitlines()
    writes = {line.removeprefix("topic write ") for line in mosquitto}
    hivemq = (DEPLOY / "hivemq" / "credentials.xml").read_text().partition("<id>page</id>\n            <permissions>")[2]
    asks = {"cnc/jobs/request", "cnc/jobs/cancel", "cnctwin/loop/request/+", "cnctwin/verdict/+"}
    assert (
        writes
        == set(re.findall(r"<topic>([^<]+)</topic>", hivemq))
        == {*(f"cnctwin/alerts/command/{order}" for order in ("ack", "silence", "unsilence")), "spBv1.0/cnc/NCMD/+"} | asks
    )


def test_with_influxdb_the_store_has_its_token_and_no_other_service_has(tmp_path: Path) -> None:
    need_programs()
    assert shutil.which("openssl")
    environment = {**os.environ, "STORE": "influxdb", "BROKER": "mosquitto"}
    subprocess.run(
        ["bash", str(FOLDER / "prepare"), str(tmp_path / "p"), MACHINE], check=True, capture_output=True, env=environment
    )
    token = (tmp_path / "p" / "secrets" / "influxdb_admin_token").read_text().strip()
    assert (tmp_path / "p" / "secrets" / "store.env").read_text() == f"CNCTWIN_INFLUX_TOKEN={token}\n"
    given = {name for name, service in SERVICES.items() if any("store.env" in file for file in service.get("env_file", []))}
    assert given == {"historian", "loop", "page", "validate"}
    assert "influx+http://influxdb:8086?org=cnctwin&also=" in (tmp_path / "p" / ".env").read_text()


def test_the_store_of_the_environment_is_the_server_and_no_folder(prepared: Prepared, monkeypatch: pytest.MonkeyPatch) -> None:
    server = prepared.environment["CNCTWIN_STORE"]
    monkeypatch.setenv("CNCTWIN_STORE", server)
    assert str(default_place()) == server
    assert parse(server).also == Path(dict(mounts(OURS["historian"], prepared))[prepared.home / "state" / "store"])


@pytest.mark.parametrize(
    ("arguments", "variable"), [((), {}), (("x", "m"), {"STORE": "oracle"}), (("x", "m"), {"BROKER": "emqx"})]
)
def test_prepare_says_what_it_wants(arguments: tuple[str, ...], variable: dict[str, str], tmp_path: Path) -> None:
    ran = subprocess.run(
        ["bash", str(FOLDER / "prepare"), *arguments],
        cwd=tmp_path,
        env={**os.environ, **variable},
        capture_output=True,
        text=True,
        check=False,
    )
    assert ran.returncode == 2
    assert ran.stderr.count("\n") == 1
    assert list(tmp_path.iterdir()) == []
