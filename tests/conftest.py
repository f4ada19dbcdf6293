"""What tests of several packages share: a real broker, and the proxy in front of it."""

import logging
import os
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from hypothesis import settings
from hypothesis.internal.conjecture import providers
from xdist.scheduler import LoadFileScheduling

from sparkplug.transport import connection
from sparkplug.transport.paho_path import PahoPath
from tests.depth import EXAMPLES, IS_FULL
from tests.wire.mosquitto import Mosquitto, find_mosquitto
from tests.wire.proxy import Proxy

# How long an example takes says more of the machine that it runs on than of the code. The examples of a law follow from its own
# source, so that it fails in every clone or in none (tests/test_same_examples.py); CNCTWIN_FULL=1 draws new ones each time.
settings.register_profile("house", deadline=None, max_examples=EXAMPLES, derandomize=True, database=None)
# Where the environment says CI, Hypothesis is derandomised unless it is told otherwise.
settings.register_profile("random", deadline=None, max_examples=EXAMPLES, derandomize=False, print_blob=True)
settings.load_profile("random" if IS_FULL else "house")
if not IS_FULL:
    # Hypothesis also draws constants that it reads in our modules, in those that are imported by then: a law's examples would
    # change with each edit anywhere, and with the tests that run before it. No setting turns that off.
    providers.HypothesisProvider._local_constants = providers.Constants()

# Our tests start hundreds of processes: each module is compiled once, whatever the caller's environment says of that.
os.environ.pop("PYTHONDONTWRITEBYTECODE", None)
os.environ.setdefault("PYTHONPYCACHEPREFIX", str(Path(__file__).parents[1] / ".cache" / "bytecode"))

# xdist gives its workers the size of a terminal: tables would be cut in a run with workers and not in one without.
for name in ("COLUMNS", "LINES"):
    os.environ.pop(name, None)

# The workers have all cores. Where each solves its small systems with a thread for each core as well, they wait for each other:
# tests/twin/identification/test_identify.py then takes 16 s of processor time in place of 11. numpy reads this when it is first
# imported, which is later.
for name in ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS"):
    os.environ.setdefault(name, "1")

# Files that take a quarter of a minute and more, the longest first. They begin first, so that none of them is left for one worker
# when the others are done.
LONG = (
    "twin/gap/test_diagnose.py",
    "cnctwin/loop/test_way_round.py",
    "kafka/test_outages.py",
    "twin/gap/parts/test_opened.py",
    "cnctwin/test_kill_and_restart.py",
    "benchmarks/gap/test_standing.py",
    "cnctwin/memory/test_historian_moves.py",
    "cnctwin/memory/test_history_by_default.py",
    "processors/alerts/courier/test_simulated_crashes.py",
    "processors/alerts/test_notices.py",
    "twin/identification/test_identify.py",
    "cnctwin/demo/test_demo_by_peer.py",
    "cnctwin/demo/test_demo.py",
    "cnctwin/commands/test_wrong_shapes.py",
    "cnctwin/interface/test_notebooks.py",
    "benchmarks/test_benchmarks.py",
    "cnctwin/page/test_accessibility.py",
    "cnctwin/loop/test_service.py",
    "twin/optimisation/test_limits.py",
    "processors/alerts/courier/test_courier_on_a_broker.py",
    "cnctwin/commands/test_record_to_diagnosis.py",
    "twin/gap/programs/test_diagnose.py",
    "hivemq/test_barrier.py",
    "peers/test_hosts_of_peers.py",
    "peers/test_edges_of_peers.py",
    "processors/test_contract.py",
    "cnctwin/jobs/test_dask_cluster.py",
    "cnctwin/commands/test_optimise.py",
    "cnctwin/validation/test_axes_and_programs.py",
    "processors/alerts/courier/test_processor_and_courier_killed.py",
    "test_docstrings.py",
    "twin/process/test_peak.py",
    "cnctwin/memory/replay/test_replay_of_a_live_plant.py",
    "cnctwin/standins/simulated_machine/test_machining.py",
    "twin/anomaly/test_detector.py",
    "cnctwin/commands/learn/train/test_anomaly.py",
    "processors/alerts/courier/test_simulated_crashes.py",
    "cnctwin/memory/test_historian_killed.py",
    "cnctwin/memory/store/influx/test_outage.py",
    "cnctwin/page/test_views.py",
    "cnctwin/page/test_connection.py",
    "cnctwin/challenge/test_compare.py",
    "processors/alerts/test_laws.py",
    "benchmarks/test_simulated_cell.py",
    "benchmarks/test_tool_change_detector.py",
)

# Files that share what takes long to start or to compile: one worker does it once for all of them.
TOGETHER = ("tests/hivemq/", "tests/kafka/", "tests/twin/process/")


class InGroups(LoadFileScheduling):
    """A worker is given a file at a time, or all of a folder that is named in TOGETHER."""

    def _split_scope(self, nodeid: str) -> str:
        return next((folder for folder in TOGETHER if nodeid.startswith(folder)), super()._split_scope(nodeid))


def pytest_xdist_make_scheduler(config: pytest.Config, log: Any) -> InGroups | None:
    """Ours in place of `--dist loadfile`."""
    return InGroups(config, log) if config.getoption("dist") == "loadfile" else None


def pytest_configure(config: pytest.Config) -> None:
    """pytest-xdist would begin with the files that hold the most tests; it is given them in our order."""
    config.option.loadscopereorder = False


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """The long files first."""
    tests = Path(__file__).parent
    ranks = {tests / name: rank for rank, name in enumerate(LONG)}
    items.sort(key=lambda item: ranks.get(item.path, len(LONG)))


@pytest.fixture(autouse=True)
def _level_of_our_loggers() -> Iterator[None]:
    """Take back what a command sets for its process: `doctor` and `serve` silence the connection and report it themselves."""
    logger = logging.getLogger("sparkplug")
    level = logger.level
    yield
    logger.setLevel(level)


@pytest.fixture(scope="session", autouse=True)
def state_of_its_own(tmp_path_factory: pytest.TempPathFactory) -> Iterator[None]:
    """What commands keep over restarts goes into a folder of this run, not into the user's home."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("CNCTWIN_STATE_DIR", str(tmp_path_factory.mktemp("state")))
        yield


@pytest.fixture(scope="session")
def mosquitto_program() -> str:
    """The path of Mosquitto; the test is skipped where there is none."""
    found = find_mosquitto()
    if found is None:
        pytest.skip("no mosquitto on this machine; install the package mosquitto")
    return found


@pytest.fixture
def mosquitto(mosquitto_program: str) -> Iterator[Mosquitto]:
    """A real Mosquitto on a free loopback port, without limits that would drop messages silently."""
    with Mosquitto() as broker:
        yield broker


@pytest.fixture
def proxy(mosquitto: Mosquitto) -> Iterator[Proxy]:
    """A recording, fault-injecting proxy in front of that broker."""
    with Proxy(upstream=mosquitto.address) as between:
        yield between


@pytest.fixture(scope="module", params=["data path", "paho"])
def way(request: pytest.FixtureRequest) -> Iterator[str]:
    """Messages go past paho, as they do unless a connection is told otherwise; then all of them through it."""
    with pytest.MonkeyPatch.context() as patch:
        if request.param == "paho":
            patch.setattr(connection, "DataPath", PahoPath)
        yield request.param
