"""What is taken for a request, and the one line that says why something is not."""

import json

import pytest
from hypothesis import given
from hypothesis import strategies as st

from cnctwin.errors import UsageError
from cnctwin.jobs.files_root import FilesRoot
from cnctwin.jobs.request import REQUEST_BYTES_MAX, RequestError, read_cancel, read_request

MACHINE = "[machine]\nname = 'vmc'"
LIMITED = MACHINE + "\n[limits]\nfeed_mm_min = [1.0, 2.0]\nspindle_rpm = [1.0, 2.0]"
GOOD = {"job": "optimise", "program_text": "G1 X1", "machine_toml": MACHINE}
JSON = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats() | st.text(max_size=12),
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.text(max_size=8), inner, max_size=3),
    max_leaves=12,
)
KEYS = st.sampled_from(["job", "id", "reply_to", "case", "program", "program_text", "machine", "seed", "objective", "x"])


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({"job": "destroy"}, "job = 'destroy': is none of optimise, identify, diagnose"),
        ({"job": None}, "job = None: is none of"),
        ({"id": "../up"}, "id = '../up': 1 to 64 letters"),
        ({"id": "a" * 65}, "id = 'aaaa"),
        ({"id": ""}, "id = '': 1 to 64"),
        ({"reply_to": "a/#"}, "reply_to = 'a/#': '+', '#' and a zero byte cannot stand in it"),
        ({"reply_to": "spBv1.0/cnc/NCMD/edge"}, "reply_to = 'spBv1.0/cnc/NCMD/edge': is a topic of others"),
        ({"reply_to": "cnc/vmc/feed_mm_min"}, "is a topic of others"),
        ({"reply_to": 7}, "reply_to = 7: is no text"),
        ({"force_limit_n": -1.0}, "force_limit_n = -1.0: Input should be greater than 0"),
        ({"force_limit_n": "60"}, "force_limit_n = '60': Input should be a valid number"),
        ({"seed": True}, "seed = True: Input should be a valid integer"),
        ({"probability": 1.0}, "probability = 1.0: Input should be less than or equal to 0.9999"),
        ({"probability": 0.3}, "probability = 0.3: Input should be greater than or equal to 0.5"),
        ({"population": 7}, "population = 7: Input should be a multiple of 2"),
        ({"encoding": "cp437"}, "encoding = 'cp437': Input should be 'utf-8', 'utf-8-sig' or 'latin-1'"),
        ({"encoding": "latin-1", "program_text": "(⌀ 6)"}, "program_text has the sign '⌀', which latin-1 does not have"),
        (
            {"encoding": "latin-1", "program": "a.nc", "program_text": None},
            "encoding and name are those of program_text; a file has its own",
        ),
        ({"objective": "fun"}, "objective = 'fun': Input should be 'time', 'cost' or 'pareto'"),
        ({"speed_changes": "never"}, "speed_changes = 'never': Input should be 'anywhere', 'in_air' or 'per_tool'"),
        ({"feed": 3}, "feed: no such key for optimise; there are program, program_text"),
        ({"\x1b[2J\nfake": 3}, "?[2J fake: no such key"),
        ({"program": "a.nc"}, "give either program (a file) or program_text"),
        ({"machine_toml": None}, "give either machine (a file) or machine_toml"),
    ],
)
def test_a_wrong_request_is_refused_in_one_line_that_names_the_culprit(change: dict[str, object], said: str) -> None:
    with pytest.raises(RequestError) as refused:
        read_request(json.dumps(GOOD | change).encode())
    assert said in str(refused.value)
    assert "\n" not in str(refused.value)


@given(st.binary(max_size=200) | st.dictionaries(KEYS, JSON, max_size=6).map(lambda document: json.dumps(document).encode()))
def test_whatever_comes_is_a_request_or_refused_in_one_line(payload: bytes) -> None:
    for read in (read_request, read_cancel):
        try:
            read(payload)
        except RequestError as refused:
            assert "\n" not in str(refused)
            assert len(str(refused)) < 400


@pytest.mark.parametrize(
    ("payload", "said"),
    [
        (b" " * (REQUEST_BYTES_MAX + 1), "4,000,001 bytes are above the limit of 4,000,000; name files instead"),
        (b"[" * 200_000, "is not JSON"),
        (b'{"seed": NaN}', "NaN is no number of JSON"),
        (b'{"id": "\\ud800"}', "can't encode character"),
        (b"[]", "is a JSON list; an object is wanted"),
    ],
)
def test_what_is_no_request_at_all_is_refused(payload: bytes, said: str) -> None:
    with pytest.raises(RequestError, match=said):
        read_request(payload)


def test_a_request_reads_back_from_what_is_kept_of_it() -> None:
    for asked in (GOOD, {"job": "diagnose", "case": "november"}, {"job": "identify", "case": "a/b", "free_gains": True}):
        request = read_request(json.dumps(asked).encode())
        again = read_request(json.dumps(request.document).encode())
        assert again == request
        assert again.digest == request.digest


def test_the_digest_is_of_what_is_asked_not_of_who_asks_or_in_which_order() -> None:
    asked = {"job": "identify", "id": "a", "case": "november"}
    same = {"case": "november", "reply_to": "cell/3", "free_gains": False, "id": "a", "job": "identify"}
    other = {**asked, "free_gains": True}
    first, second, third = (read_request(json.dumps(one).encode()).digest for one in (asked, same, other))
    assert first == second != third


def test_a_refusal_goes_where_the_request_says_as_far_as_it_can_be_read() -> None:
    for asked, topic in (
        ({"id": "a", "job": "x"}, "cnc/jobs/reply/a"),
        ({"id": "a", "job": "x", "reply_to": "cell/3"}, "cell/3"),
        ({"id": "..", "reply_to": "cell/3"}, "cell/3"),
        ({"id": "a", "reply_to": "$SYS/x"}, "cnc/jobs/reply/a"),
        ({"job": "x"}, ""),
    ):
        with pytest.raises(RequestError) as refused:
            read_request(json.dumps(asked).encode())
        assert refused.value.reply_topic == topic


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({}, "machine_toml: no [limits]; write feed_mm_min and spindle_rpm"),
        ({"machine_toml": LIMITED, "objective": "cost"}, "machine_toml: no [cost], which objective = 'cost' needs"),
        ({"machine_toml": "[machine"}, "machine_toml: is not TOML"),
        (
            {"machine_toml": LIMITED + "\n[tool]\nteeth = 2"},
            "machine_toml: 3 faults; see docs/reference/machine.md\n  tool.diameter_mm is missing",
        ),
    ],
)
def test_a_machine_that_nothing_can_be_chosen_on_is_refused_before_it_waits_in_the_queue(
    change: dict[str, str], said: str
) -> None:
    request = read_request(json.dumps(GOOD | change).encode())
    with pytest.raises(UsageError) as refused:
        request.parameters.machine_of(FilesRoot())
    assert said in str(refused.value)


def test_a_machine_that_can_is_called_by_its_name() -> None:
    request = read_request(json.dumps(GOOD | {"machine_toml": LIMITED}).encode())
    assert request.parameters.machine_of(FilesRoot()) == "vmc"


def test_a_request_says_who_asks_and_is_the_same_whoever_does() -> None:
    ada, grace = (
        read_request(b'{"job": "diagnose", "case": "vmc", "id": "n", "by": "%s"}' % name) for name in (b"ada", b"grace")
    )
    assert (ada.by, ada.document["by"], ada.digest) == ("ada", "ada", grace.digest)
    assert read_request(json.dumps(ada.document).encode()).by == "ada"
    assert read_cancel(b'{"id": "n", "by": "ada"}') == ("n", "cnc/jobs/reply/n", "ada")
    for by in ('"a\\u001b[31m"', f'"{"x" * 101}"', "5", "null"):
        with pytest.raises(RequestError, match=r"by = .*printable characters"):
            read_request(b'{"job": "diagnose", "case": "vmc", "by": %s}' % by.encode())
