"""The table [loop]: the page shows the defaults, and what is wrong is one line that names it."""

import re
import tomllib
from pathlib import Path

import pytest

from cnctwin.loop.config import LoopConfig, LoopConfiguration, Promote, loop_configuration
from processors.errors import ConfigurationError
from processors.running.runtime import configured

PAGE = Path(__file__).parents[3] / "docs" / "how-to" / "loop.md"


def test_the_page_shows_every_key_with_its_default() -> None:
    block = next(one for one in re.findall(r"```toml\n(.*?)```", PAGE.read_text(encoding="utf-8"), re.S) if "[loop]" in one)
    defaults = {key: value for key, value in LoopConfig().model_dump(mode="json").items() if value is not None}
    assert tomllib.loads(block)["loop"] == defaults
    for key in LoopConfig.model_fields:
        assert re.search(rf"^(?:# )?{key} = ", block, re.M), key


def test_a_machine_has_values_of_its_own() -> None:
    found = LoopConfiguration({"shadow_s": 60.0, "machines": {"okuma": {"promote": "by_rule"}}})
    assert found.of("vmc").promote is Promote.BY_HAND
    assert (found.of("okuma").promote, found.of("okuma").shadow_s) == (Promote.BY_RULE, 60.0)


@pytest.mark.parametrize(
    ("table", "says"),
    [
        ({"promote": "by_magic"}, "[loop] promote = 'by_magic'"),
        ({"shadow": 1}, "[loop] shadow is not known"),
        ({"machines": {"vmc": {"back_floors": -1}}}, "[loop.machines.vmc] back_floors = -1"),
        ({"machines": 3}, "one table for each machine"),
    ],
)
def test_what_is_wrong_is_named(table: dict[str, object], says: str) -> None:
    with pytest.raises(ConfigurationError) as wrong:
        LoopConfiguration(table)
    assert says in str(wrong.value)


def test_the_healthy_period_is_that_of_the_processor_gap(tmp_path: Path) -> None:
    file = tmp_path / "processors.toml"
    file.write_text("[gap.machines.vmc]\nhealthy_from = 1970-01-01T01:00:00Z\nhealthy_hours = 2.0\n")
    found = loop_configuration(file)
    assert found.healthy_ms("vmc") == (3_600_000, 3 * 3_600_000)
    assert found.healthy_ms("okuma") is None


def test_the_same_file_serves_processors_and_the_loop(tmp_path: Path) -> None:
    file = tmp_path / "processors.toml"
    file.write_text("[loop]\nshadow_s = 60.0\n[thermal]\ntick_s = 2.0\n")
    assert loop_configuration(file).default.shadow_s == 60.0
    assert len(configured(["thermal"], file)) == 1
