"""What tests of several packages share: a real broker, and the proxy in front of it."""

import os
from collections.abc import Iterator
from pathlib import Path

import pytest
from hypothesis import settings

from tests.depth import EXAMPLES
from tests.wire.mosquitto import Mosquitto, find_mosquitto
from tests.wire.proxy import Proxy

# How long an example takes says more of the machine that it runs on than of the code.
settings.register_profile("house", deadline=None, max_examples=EXAMPLES)
settings.load_profile("house")

# Our tests start hundreds of processes: each module is compiled once, whatever the caller's environment says of that.
os.environ.pop("PYTHONDONTWRITEBYTECODE", None)
os.environ.setdefault("PYTHONPYCACHEPREFIX", str(Path(__file__).parents[1] / ".cache" / "bytecode"))

# Files that take half a minute and more. They begin first, so that none of them is left for one worker when the others are done.
LONG = (
    "cnctwin/test_kill_and_restart.py",
    "processors/courier/test_courier_on_a_broker.py",
    "cnctwin/test_demo.py",
    "twin/identification/test_identify.py",
    "twin/gap/test_program_time.py",
    "processors/test_contract.py",
    "twin/gap/test_diagnose.py",
    "twin/anomaly/test_detector.py",
    "cnctwin/test_demo_by_peer.py",
    "cnctwin/test_train_anomaly.py",
    "processors/courier/test_processor_and_courier_killed.py",
    "processors/courier/test_simulated_crashes.py",
    "cnctwin/test_historian_killed.py",
    "cnctwin/store_influx/test_outage.py",
    "hivemq/test_barrier.py",
    "cnctwin/replay/test_replay_of_a_live_plant.py",
)


def pytest_configure(config: pytest.Config) -> None:
    """pytest-xdist would begin with the files that hold the most tests; it is given them in our order."""
    config.option.loadscopereorder = False


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """The long files first."""
    tests = Path(__file__).parent
    ranks = {tests / name: rank for rank, name in enumerate(LONG)}
    items.sort(key=lambda item: ranks.get(item.path, len(LONG)))


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
