"""The manifests for Kubernetes: against its schemas, as one site's folder, and each with the program that it starts."""

import asyncio
import os
import re
import shutil
import subprocess
import tomllib
from collections.abc import Iterator
from pathlib import Path
from typing import Any, NamedTuple

import httpx
import kubernetes_validate
import pytest
import yaml

from cnctwin.api.access import Access
from cnctwin.api.application import create_app
from cnctwin.api.live.plant import LivePlant
from cnctwin.api.sources import Sources
from cnctwin.memory.store.influx.address import parse
from processors.description import Description
from processors.discovery import discover
from processors.running.runtime import configured
from sparkplug.broker import BrokerAddress
from tests.deploy.command_lines import parsed
from tests.deploy.go_programs import KUSTOMIZE, built
from tests.deploy.kafka_names import BRIDGE, RUNNER, option, processors_of
from tests.deploy.plant import DEPLOY, PEOPLE, PROCESSORS

FOLDER = DEPLOY / "kubernetes"
BASE = FOLDER / "base"
MACHINES = ("okuma", "mazak")
MANIFESTS: list[dict[str, Any]] = [
    document
    for path in sorted(BASE.glob("*.yaml"))
    if path.name != "kustomization.yaml"
    for document in yaml.safe_load_all(path.read_text())
]
OLDEST_KUBERNETES = "1.30"
KAFKA_PORT = 9093


class Workload(NamedTuple):
    """A workload: its manifest, its pod, its one container."""

    manifest: dict[str, Any]
    pod: dict[str, Any]
    container: dict[str, Any]

    @property
    def labels(self) -> dict[str, str]:
        return self.manifest["spec"]["template"]["metadata"]["labels"]

    @property
    def environment(self) -> dict[str, Any]:
        return {one["name"]: one.get("value", one.get("valueFrom")) for one in self.container["env"]}

    @property
    def command(self) -> list[str]:
        return self.container["args"]


def workloads() -> dict[str, Workload]:
    """The workloads, by name."""
    running = [one for one in MANIFESTS if one["kind"] in ("StatefulSet", "Deployment", "DaemonSet", "Job", "CronJob")]
    pods = [one["spec"]["template"]["spec"] for one in running]
    return {one["metadata"]["name"]: Workload(one, pod, pod["containers"][0]) for one, pod in zip(running, pods, strict=True)}


WORKLOADS = workloads()
ON_KAFKA = {name: one for name, one in WORKLOADS.items() if "--kafka" in one.command}


class Site:
    """The folder of `deploy/kubernetes/prepare`."""

    def __init__(self, home: Path) -> None:
        self.home = home

    def prepare(self, *machines: str) -> None:
        subprocess.run(["bash", str(FOLDER / "prepare"), str(self.home), *machines], check=True, capture_output=True, text=True)

    @property
    def places(self) -> dict[str, str]:
        lines = (self.home / "places.env").read_text().splitlines()
        return dict(line.split("=", 1) for line in lines if line and not line.startswith("#"))

    def variable(self, workload: Workload, name: str) -> str:
        """The value of a variable in the first pod of a workload."""
        value = workload.environment[name]
        if isinstance(value, str):
            return value
        if "fieldRef" in value:
            assert value["fieldRef"]["fieldPath"] == "metadata.name"
            return f"{workload.manifest['metadata']['name']}-0"
        return self.places[value["configMapKeyRef"]["key"]]

    def command(self, workload: Workload) -> list[str]:
        return [re.sub(r"\$\((\w+)\)", lambda found: self.variable(workload, found[1]), word) for word in workload.command]


@pytest.fixture(scope="module")
def site(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Site]:
    site = Site(tmp_path_factory.mktemp("site") / "cluster")
    site.prepare(*MACHINES)
    yield site


@pytest.mark.parametrize("version", [OLDEST_KUBERNETES, kubernetes_validate.latest_version()])
def test_kubernetes_knows_every_field(version: str) -> None:
    assert len(MANIFESTS) > 15
    for document in MANIFESTS:
        kubernetes_validate.validate(document, version, strict=True)


def test_every_file_is_part_of_the_base() -> None:
    base = yaml.safe_load((BASE / "kustomization.yaml").read_text())
    assert {path.name for path in BASE.glob("*")} == {"kustomization.yaml", *base["resources"]}


@pytest.mark.parametrize("name", WORKLOADS)
def test_the_program_takes_the_command_of_a_pod(name: str, site: Site) -> None:
    assert parsed(site.command(WORKLOADS[name]))


def test_each_processor_runs_in_one_stateful_set() -> None:
    commands = {name: one.command for name, one in WORKLOADS.items() if one.command[0] == "process"}
    assert {WORKLOADS[name].manifest["kind"] for name in commands} == {"StatefulSet"}
    names = [name for command in commands.values() for name in processors_of(command)]
    assert len(names) == len(set(names))
    assert set(discover()) - set(names) == {"tool_change_detector"}, "name it in a StatefulSet of deploy/kubernetes/base"
    several = {name for name, one in WORKLOADS.items() if one.manifest["spec"]["replicas"] != 1}
    assert several == {"runner-physics"}, "what keeps a volume, a store or the courier is there once"


def test_the_bridge_publishes_what_is_folded_on_kafka_and_nothing_else() -> None:
    folded = [name for one in ON_KAFKA.values() if one.command[0] == "process" for name in processors_of(one.command)]
    assert sorted(option(WORKLOADS["bridge"].command, "--results").split(",")) == sorted(folded)


def test_the_plant_on_kafka_is_the_same_with_compose_and_here(site: Site) -> None:
    overlay = yaml.safe_load((DEPLOY / "compose" / "kafka.yml").read_text())["services"]
    for there, here in (("runner-physics-0", "runner-physics"), ("processors", "runner-alerts")):
        assert processors_of(overlay[there]["command"]) == processors_of(WORKLOADS[here].command), "else: other consumer groups"
    for there, here in (("runner-physics-0", "runner-physics"), ("bridge", "bridge")):
        name = "--name" if here == "bridge" else "--member"
        assert option(overlay[there]["command"], name) == option(site.command(WORKLOADS[here]), name)


def test_a_runner_has_the_name_of_its_pod_and_a_bridge_is_never_there_twice() -> None:
    for name, one in ON_KAFKA.items():
        assert one.manifest["kind"] == "StatefulSet", name
        assert option(one.command, "--name" if name == "bridge" else "--member") == "$(POD_NAME)", name
        assert one.environment["POD_NAME"] == {"fieldRef": {"fieldPath": "metadata.name"}}
    assert ON_KAFKA["runner-physics"].manifest["spec"]["podManagementPolicy"] == "Parallel"
    assert WORKLOADS["page"].manifest["spec"]["strategy"] == {"type": "Recreate"}, "its volume is one pod's"
    (budget,) = (one for one in MANIFESTS if one["kind"] == "PodDisruptionBudget")
    selected = budget["spec"]["selector"]["matchLabels"].items()
    assert [name for name, one in WORKLOADS.items() if selected <= one.labels.items()] == ["runner-physics"]
    headless = next(one for one in MANIFESTS if one["kind"] == "Service" and one["spec"].get("clusterIP") == "None")
    sets = [one for one in WORKLOADS.values() if one.manifest["kind"] == "StatefulSet"]
    assert {one.manifest["spec"]["serviceName"] for one in sets} == {headless["metadata"]["name"]}


@pytest.mark.parametrize("name", WORKLOADS)
def test_a_pod_may_do_nothing_that_it_need_not(name: str) -> None:
    one = WORKLOADS[name]
    assert one.pod["automountServiceAccountToken"] is False and one.pod["terminationGracePeriodSeconds"] == 30
    assert one.pod["securityContext"]["runAsNonRoot"] and one.pod["securityContext"]["runAsUser"] == 10001
    assert one.pod["securityContext"]["seccompProfile"] == {"type": "RuntimeDefault"}
    assert one.container["securityContext"] == {
        "allowPrivilegeEscalation": False,
        "readOnlyRootFilesystem": True,
        "capabilities": {"drop": ["ALL"]},
    }
    assert len(one.pod["containers"]) == 1 and "hostNetwork" not in one.pod and "hostPID" not in one.pod
    assert one.container["resources"]["limits"]["memory"] and set(one.container["resources"]["requests"]) == {"cpu", "memory"}
    selector = one.manifest["spec"]["selector"]["matchLabels"]
    assert selector.items() <= one.labels.items()
    others = [other.labels.items() for key, other in WORKLOADS.items() if key != name]
    assert not any(selector.items() <= labels for labels in others), "its pods would be another's"


def test_the_namespace_lets_in_no_other_pods() -> None:
    namespace = next(one for one in MANIFESTS if one["kind"] == "Namespace")
    assert namespace["metadata"]["labels"]["pod-security.kubernetes.io/enforce"] == "restricted"


@pytest.mark.parametrize("name", WORKLOADS)
def test_what_a_pod_is_told_to_read_or_write_is_mounted(name: str, site: Site) -> None:
    one = WORKLOADS[name]
    mounted = {mount["mountPath"]: mount for mount in one.container["volumeMounts"]}
    claims = [claim["metadata"]["name"] for claim in one.manifest["spec"].get("volumeClaimTemplates", [])]
    volumes = [volume["name"] for volume in one.pod["volumes"]] + claims
    assert {mount["name"] for mount in mounted.values()} == set(volumes) and len(volumes) == len(set(volumes))
    values = [site.variable(one, key) for key, value in one.environment.items() if "secretKeyRef" not in value]
    if name in ON_KAFKA:
        values.append(tomllib.loads((site.home / "kafka.toml").read_text())["ca_file"])
    paths = re.findall(r"(?:^|[ =])(/[\w./-]+)", "\n".join([*site.command(one), *values]), re.M)
    assert paths and [path for path in paths if not any(path == at or path.startswith(f"{at}/") for at in mounted)] == []
    configured_by = {path.removeprefix("/etc/cnctwin/config/") for path in paths if path.startswith("/etc/cnctwin/config/")}
    assert "processors.toml" in configured_by and all((site.home / file).is_file() for file in configured_by)
    writable = {at for at, mount in mounted.items() if not mount.get("readOnly")}
    assert writable == {"/tmp", "/var/lib/cnctwin"}, "and nothing else, as the image says"
    for volume in one.pod["volumes"]:
        if "secret" in volume:
            assert volume["secret"]["defaultMode"] == 0o440, "the group is the pod's"


def test_no_secret_stands_in_any_of_it(site: Site) -> None:
    assert not any(one["kind"] == "Secret" for one in MANIFESTS)
    for name, one in WORKLOADS.items():
        for variable, value in one.environment.items():
            if re.search("PASSWORD|TOKEN", variable):
                assert set(value) == {"secretKeyRef"}, f"{name}: {variable}"
    assert "secretGenerator" not in (site.home / "kustomization.yaml").read_text()
    for path in (path for path in site.home.rglob("*") if path.is_file()):
        assert not re.search(r"PRIVATE KEY|[0-9a-f]{48}|^\s*password\s*[:=]", path.read_text(), re.M | re.I), path


def test_each_comes_into_kafka_as_itself() -> None:
    for name, one in ON_KAFKA.items():
        user = BRIDGE if name == "bridge" else RUNNER
        assert one.environment["CNCTWIN_KAFKA_USERNAME"] == user
        assert one.environment["CNCTWIN_KAFKA_PASSWORD"] == {"secretKeyRef": {"name": user, "key": "password"}}


def test_the_configuration_of_a_site_is_what_the_programs_take(site: Site) -> None:
    names = [name for one in WORKLOADS.values() if one.command[0] == "process" for name in processors_of(one.command)]
    assert len(configured(names, site.home / "processors.toml")) == len(names)
    kafka = tomllib.loads((site.home / "kafka.toml").read_text())
    shipped = tomllib.loads((DEPLOY / "kafka" / "kafka.toml").read_text())
    assert kafka == shipped | {"ca_file": "/run/secrets/kafka/ca.crt"}
    assert kafka["partitions"] >= WORKLOADS["runner-physics"].manifest["spec"]["replicas"]
    for key, port in (("processors_broker", PROCESSORS), ("page_broker", PEOPLE)):
        address = BrokerAddress.from_url(site.places[key])
        assert (address.tls, address.port) == (True, port)
    assert parse(site.places["historian_store"]).also == Path("/var/lib/cnctwin/store")
    assert parse(site.places["page_store"]).also is None, "another pod's volume"
    for machine in MACHINES:
        text = (site.home / "machines" / f"{machine}.toml").read_text()
        assert Description.from_toml(text, machine).machine.machine.name == machine
    used = {
        value["configMapKeyRef"]["key"]
        for one in WORKLOADS.values()
        for value in one.environment.values()
        if "configMapKeyRef" in value
    }
    assert used == set(site.places)


def test_what_is_asked_of_a_pod_is_true_or_not_asked(site: Site) -> None:
    """A process without its broker is not helped by a restart, so its connections make it ready, and never alive or dead."""
    for name, one in WORKLOADS.items():
        if name == "page":
            continue
        assert "livenessProbe" not in one.container and "startupProbe" not in one.container, name
        asked = " ".join(one.container["readinessProbe"]["exec"]["command"]).replace("sh -c ", "").split(" && ")
        ports = [{int(port) for port in words.removeprefix("connected ").split()} for words in asked]
        to_kafka = {"bridge": 1, "historian": 0}.get(name, 1)
        assert sum(KAFKA_PORT in group for group in ports) == to_kafka, name
        assert sum(PROCESSORS in group for group in ports) == (name in ("bridge", "historian")), name
    assert site.places["kafka"].endswith(f":{KAFKA_PORT}")


def test_the_page_answers_its_probes_and_those_who_know_its_names(site: Site) -> None:
    page = WORKLOADS["page"]
    given = parsed(site.command(page))
    app = create_app(Sources(LivePlant(), access=Access(token="x" * 48, hosts=frozenset(given["allow_host"]))))
    probes = [page.container[kind]["httpGet"] for kind in ("livenessProbe", "readinessProbe")]
    assert [probe["path"] for probe in probes] == ["/livez", "/readyz"]
    for probe in probes:
        assert "httpHeaders" not in probe
        assert _asked(app, probe["path"], f"10.0.0.7:{given['port']}") == 200, "as a kubelet asks"
    asked = {
        name: _asked(app, "/livez", name) for name in (site.places["page_name"], "page", "page.cnctwin.svc:8080", "elsewhere")
    }
    assert list(asked.values()) == [200, 200, 200, 403]
    ports = {port["name"]: port["containerPort"] for port in page.container["ports"]}
    assert ports == {"http": given["port"]} and {probe["port"] for probe in probes} == {"http"}
    service = next(one for one in MANIFESTS if one["kind"] == "Service" and one["metadata"]["name"] == "page")
    assert service["spec"]["selector"].items() <= page.labels.items()


def _asked(app: Any, path: str, host: str) -> int:
    async def ask() -> int:
        transport = httpx.ASGITransport(app=app, client=("192.0.2.7", 40000))
        async with httpx.AsyncClient(transport=transport) as client:
            return (await client.get(f"http://10.0.0.7:8080{path}", headers={"Host": host})).status_code

    return asyncio.run(ask())


def test_a_pod_reaches_what_it_is_configured_for_and_nothing_else(site: Site) -> None:
    policies = {one["metadata"]["name"]: one["spec"] for one in MANIFESTS if one["kind"] == "NetworkPolicy"}
    assert policies["nothing"] == {"podSelector": {}, "policyTypes": ["Ingress", "Egress"]}
    for name, one in WORKLOADS.items():
        ports = {
            port["port"]
            for spec in policies.values()
            if spec["podSelector"].get("matchLabels", {}).items() <= one.labels.items()
            for rule in spec.get("egress", [])
            for port in rule["ports"]
        }
        environment = one.environment
        wanted = {("KAFKA", 9093), ("CNCTWIN_BROKER", PEOPLE if name == "page" else PROCESSORS), ("CNCTWIN_STORE", 8428)}
        for variable, port in wanted:
            assert (port in ports) == (variable in environment) or {PEOPLE, PROCESSORS} >= {port} <= ports, (name, variable)
            assert variable not in environment or f":{port}" in site.variable(one, variable)
        assert (443 in ports) == (name == "runner-alerts")
        assert 53 in ports
        assert bool(ports & {8883, 8884, 8885}) == ("CNCTWIN_BROKER" in environment), name
    into = [name for name, spec in policies.items() if spec.get("ingress")]
    assert into == ["page"] and policies["page"]["podSelector"]["matchLabels"].items() <= WORKLOADS["page"].labels.items()


def test_a_second_preparation_brings_the_base_and_machines_and_changes_nothing_else(tmp_path: Path) -> None:
    site = Site(tmp_path / "cluster")
    site.prepare("okuma")
    for name in ("places.env", "kafka.toml", "processors.toml", "machines/okuma.toml"):
        with (site.home / name).open("a") as file:
            file.write("# ours\n")
    kept = {path: path.read_text() for path in site.home.rglob("*") if path.is_file()}
    (site.home / "base" / "bridge.yaml").write_text("of an earlier release")
    site.prepare("okuma", "mazak")
    now = {path: path.read_text() for path in site.home.rglob("*") if path.is_file()}
    assert set(now) - set(kept) == {site.home / "machines/mazak.toml"}
    assert {path.name for path in kept if now[path] != kept[path]} == {"kustomization.yaml"}
    added = now[site.home / "kustomization.yaml"].removeprefix(kept[site.home / "kustomization.yaml"])
    assert added == "      - machines/mazak.toml\n"


@pytest.mark.parametrize("arguments", [(), ("x",), ("x", "a/b"), ("x", "a b")])
def test_prepare_says_what_it_wants(arguments: tuple[str, ...], tmp_path: Path) -> None:
    command = ["bash", str(FOLDER / "prepare"), *arguments]
    ran = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=False)
    assert (ran.returncode, ran.stderr.count("\n")) == (2, 1)
    assert list(tmp_path.iterdir()) == []


def rendered(home: Path) -> list[dict[str, Any]]:
    """The manifests that `kubectl apply -k` would send, by kustomize."""
    if program := shutil.which("kustomize"):
        command = [program, "build"]
    elif program := shutil.which("kubectl"):
        command = [program, "kustomize"]
    else:
        command = [str(built(KUSTOMIZE)), "build"]
    environment = {"PATH": os.environ["PATH"], "HOME": str(home)}
    done = subprocess.run([*command, str(home)], capture_output=True, text=True, check=False, env=environment)
    assert (done.returncode, done.stderr) == (0, "")
    return list(yaml.safe_load_all(done.stdout))


def test_kustomize_puts_a_site_s_own_into_every_pod(site: Site) -> None:
    documents = rendered(site.home)
    assert len(documents) == len(MANIFESTS) + 3
    for document in documents:
        kubernetes_validate.validate(document, OLDEST_KUBERNETES, strict=True)
    maps = {one["metadata"]["name"]: one["data"] for one in documents if one["kind"] == "ConfigMap"}
    hashed = {name.rpartition("-")[0]: name for name in maps if name != "cnctwin-machines"}
    assert set(hashed) == {"cnctwin-config", "cnctwin-places"} and "cnctwin-machines" in maps
    assert set(maps["cnctwin-machines"]) == {f"{machine}.toml" for machine in MACHINES}
    assert set(maps[hashed["cnctwin-config"]]) == {"processors.toml", "kafka.toml"}
    assert maps[hashed["cnctwin-places"]] == site.places
    pods = [one["spec"]["template"]["spec"] for one in documents if one["kind"] in ("StatefulSet", "Deployment")]
    assert len(pods) == len(WORKLOADS)
    for pod in pods:
        (container,) = pod["containers"]
        assert container["image"] == "registry.plant.example/cnctwin:0.1.0"
        named = {volume["configMap"]["name"] for volume in pod["volumes"] if "configMap" in volume}
        named |= {
            found["configMapKeyRef"]["name"]
            for one in container["env"]
            if "configMapKeyRef" in (found := one.get("valueFrom", {}))
        }
        assert named <= set(maps) and hashed["cnctwin-config"] in named
    spaces = {one["metadata"].get("namespace") for one in documents if one["kind"] != "Namespace"}
    assert spaces == {"cnctwin"}
