"""The file of users: what it gives, and what is refused without repeating a token."""

from pathlib import Path

import pytest

from cnctwin.api.door.role import Role
from cnctwin.api.door.users import User, read_users
from cnctwin.api.serve import ServeOptions, access_of
from cnctwin.errors import UsageError

SECRET = "a-secret-of-more-than-sixteen"
GOOD = f'[ada]\nrole = "operator"\ntoken = "{SECRET}"\n\n["grace@shop"]\nrole = "administrator"\n'


def file_of(folder: Path, text: str, mode: int = 0o600) -> Path:
    path = folder / "users.toml"
    path.write_text(text)
    path.chmod(mode)
    return path


def test_users_have_roles_and_tokens(tmp_path: Path) -> None:
    found = read_users(file_of(tmp_path, GOOD))
    assert found == (User("ada", Role.OPERATOR, SECRET), User("grace@shop", Role.ADMINISTRATOR))
    assert SECRET not in repr(found)


@pytest.mark.parametrize(
    ("text", "line"),
    [
        (f'[ada]\nrole = "king"\ntoken = "{SECRET}"', "ada.role"),
        (f'[ada]\ntoken = "{SECRET}"', "ada.role is missing"),
        ('[ada]\nrole = "reader"\ntoken = "short-secret"', "ada.token: needs 16 characters or more"),
        (f'[ada]\nrole = "reader"\ntoken = "{SECRET}"\n[bob]\nrole = "reader"\ntoken = "{SECRET}"', "the token of another"),
        (f'["a b"]\nrole = "reader"\ntoken = "{SECRET}"', "'a b' is no name"),
        (f'[ada]\nrole = "reader"\ntoken = "{SECRET}', "line 3 is no TOML|the end is no TOML"),
        (f'ada = "{SECRET}"', "ada: must be a table"),
        (f'[ada]\nrole = "reader"\ntokn = "{SECRET}"', "ada.tokn is not known; did you mean token?"),
    ],
)
def test_what_is_wrong_is_said_in_one_line_without_the_token(tmp_path: Path, text: str, line: str) -> None:
    with pytest.raises(UsageError, match=line) as refused:
        read_users(file_of(tmp_path, text))
    assert "secret" not in str(refused.value)
    assert "\n" not in str(refused.value)


def test_a_file_that_others_can_read_is_refused(tmp_path: Path) -> None:
    with pytest.raises(UsageError, match="mode 640; chmod 600"):
        read_users(file_of(tmp_path, GOOD, 0o640))


def test_users_open_an_address_to_the_network_and_users_without_a_token_do_not(tmp_path: Path) -> None:
    path = file_of(tmp_path, GOOD)
    assert access_of(ServeOptions(host="0.0.0.0", users=path), None).has_tokens
    path.write_text('[ada]\nrole = "operator"\n')
    with pytest.raises(UsageError, match="none of these users has a token"):
        access_of(ServeOptions(users=path), None)
    assert access_of(ServeOptions(users=path, proxy_header="X-User", proxy="10.0.0.5"), None).users
