"""The folder of descriptions as a process sees it: what is new, what is wrong, what is gone."""

import json
import os
from pathlib import Path

from processors.description import Role, version_of
from processors.description_folder import DescriptionFolder, FileNews
from tests.processors.describing import toml

LONG_AGO_S = 1_700_000_000.0


def written(path: Path, text: str, at_s: float = LONG_AGO_S) -> str:
    """Write a file as of a time; its version."""
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(text)
    os.utime(path, (at_s, at_s))
    return version_of(text)


def seen(news: list[FileNews]) -> list[tuple[str, Role, str | None]]:
    return [(one.machine, one.role, None if one.message is None else one.message.version) for one in news]


def test_a_file_is_news_once_the_live_one_before_the_challenger(tmp_path: Path) -> None:
    folder = DescriptionFolder(tmp_path)
    assert folder.look() == []
    challenger = written(tmp_path / "challengers" / "a.toml", toml(2.0))
    live, other = written(tmp_path / "a.toml", toml(1.0)), written(tmp_path / "b.toml", toml(3.0))
    assert seen(folder.look()) == [("a", Role.LIVE, live), ("a", Role.CHALLENGER, challenger), ("b", Role.LIVE, other)]
    assert folder.look() == []
    assert folder.machines == {"a", "b"}


def test_a_file_that_has_changed_or_gone_is_news(tmp_path: Path) -> None:
    folder = DescriptionFolder(tmp_path)
    written(tmp_path / "a.toml", toml(1.0))
    folder.look()
    changed = written(tmp_path / "a.toml", toml(2.0), LONG_AGO_S + 1.0)
    assert seen(folder.look()) == [("a", Role.LIVE, changed)]
    (tmp_path / "a.toml").unlink()
    assert folder.look() == [FileNews("a", Role.LIVE, None)]
    assert folder.look() == []


def test_a_file_that_is_being_written_is_left_alone(tmp_path: Path) -> None:
    folder = DescriptionFolder(tmp_path)
    version = written(tmp_path / "a.toml", toml(1.0), LONG_AGO_S)
    assert folder.look(LONG_AGO_S + 0.1) == []
    assert seen(folder.look(LONG_AGO_S + 0.3)) == [("a", Role.LIVE, version)]


def test_a_promotion_is_told_before_the_challenger_is_gone(tmp_path: Path) -> None:
    folder = DescriptionFolder(tmp_path)
    written(tmp_path / "a.toml", toml(1.0))
    written(tmp_path / "challengers" / "a.toml", toml(2.0))
    folder.look()
    promoted = written(tmp_path / "a.toml", toml(2.0), LONG_AGO_S + 1.0)
    (tmp_path / "challengers" / "a.toml").unlink()
    assert folder.look(LONG_AGO_S + 1.1) == []
    assert seen(folder.look(LONG_AGO_S + 2.1)) == [("a", Role.LIVE, promoted), ("a", Role.CHALLENGER, None)]


def test_a_wrong_file_names_itself_and_the_fault(tmp_path: Path) -> None:
    folder = DescriptionFolder(tmp_path)
    written(tmp_path / "a.toml", toml(-1.0))
    (news,) = folder.look()
    assert news.message is None
    assert "a.toml: spindle.rated_power_kw" in news.fault
    written(tmp_path / "a.toml", "[mach", LONG_AGO_S + 1.0)
    assert "a.toml: is not TOML" in folder.look()[0].fault
    (tmp_path / "a.toml").write_bytes(b"\xff\xfe")
    os.utime(tmp_path / "a.toml", (LONG_AGO_S, LONG_AGO_S + 2.0))
    assert "cannot be read" in folder.look()[0].fault


def test_the_log_says_who_made_a_version_what_it_is(tmp_path: Path) -> None:
    folder = DescriptionFolder(tmp_path)
    version = version_of(toml(1.0))
    steps = [
        {"t": 1, "step": "filed", "version": version, "by": "loop", "why": "a diagnosis"},
        {"t": 2, "step": "promoted", "version": version, "by": "anna", "why": "coolant cools"},
        {"t": 3, "step": "promoted", "version": "another", "by": "ben", "why": "-"},
    ]
    lines = [*map(json.dumps, steps), '{"t": 4, "step": "half of a line']
    written(tmp_path / "history" / "a" / "steps.jsonl", "\n".join(lines))
    written(tmp_path / "a.toml", toml(1.0))
    written(tmp_path / "b.toml", toml(1.0))
    by_log, by_file = (news.message for news in folder.look())
    assert by_log is not None and by_file is not None
    assert (by_log.t, by_log.step, by_log.by, by_log.why) == (2, "promoted", "anna", "coolant cools")
    assert (by_file.t, by_file.by, by_file.why) == (round(LONG_AGO_S * 1000), "file", "")


def test_no_folder_is_no_news(tmp_path: Path) -> None:
    assert DescriptionFolder(tmp_path / "none").look() == []
