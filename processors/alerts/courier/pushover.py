"""Pushover (pushover.net/api, pushover.net/api/receipts).

POST /1/messages.json                  token, user, message, title, priority, url, url_title; emergency (2): retry >= 30,
                                       expire <= 10800
GET  /1/receipts/<receipt>.json        acknowledged, acknowledged_by_device, expired; at most every 5 s
POST /1/receipts/<receipt>/cancel.json
"""

import json
from typing import Any, NamedTuple
from urllib.parse import quote

from processors.alerts.courier.exchange import Answer, Request, exchanged, judged
from processors.alerts.courier.outcome import Outcome, Verdict
from processors.alerts.courier.secret import redacted
from processors.alerts.notification import Notification
from processors.alerts.receivers import PushoverReceiver

MESSAGE_MAX, TITLE_MAX, URL_MAX, URL_TITLE_MAX = 1024, 250, 512, 100
EMERGENCY = 2
HEADERS = {"User-Agent": "cnctwin"}


class ReceiptState(NamedTuple):
    """The state of an emergency at Pushover."""

    acknowledged_by: str  # empty: by nobody yet
    is_over: bool  # expired, cancelled, or not known any more


class Pushover:
    """See the module."""

    def __init__(self, receiver: PushoverReceiver, url: str, token: str, user: str) -> None:
        self._receiver, self._url, self._token, self._user = receiver, url.rstrip("/"), token, user

    def send(self, message: Notification) -> Outcome:
        """Send one notification; the outcome of an emergency has a receipt."""
        request = self._request("POST", "/1/messages.json", form=self.form(message))
        answer = exchanged(request, self._receiver.timeout_s)
        if isinstance(answer, Outcome):
            return answer
        outcome, said = judged(answer, request), _object(answer)
        if answer.status == 429 and answer.headers.get("x-limit-app-remaining") == "0":
            return Outcome(Verdict.REFUSED, f"{request.host}: the messages of this month are used up")
        if outcome.verdict is Verdict.DELIVERED:
            if said.get("status") != 1:
                return Outcome(Verdict.UNSURE, f"{request.host} answered {answer.status} with something else than its API says")
            receipt = said.get("receipt")
            return outcome._replace(receipt=receipt if isinstance(receipt, str) and receipt.isalnum() else "")
        errors = said.get("errors")
        if isinstance(errors, list):
            return outcome._replace(reason=self._clean(f"{outcome.reason}: {', '.join(map(str, errors))}"))
        return outcome

    def ask(self, receipt: str) -> ReceiptState | None:
        """Return the state of an emergency; None where Pushover does not say."""
        request = self._request("GET", f"/1/receipts/{quote(receipt, safe='')}.json", query={"token": self._token})
        answer = exchanged(request, self._receiver.timeout_s)
        if isinstance(answer, Outcome):
            return None
        if 400 <= answer.status < 500 and answer.status != 429:
            return ReceiptState("", is_over=True)
        said = _object(answer)
        if answer.status != 200 or said.get("status") != 1:
            return None
        by = ""
        if said.get("acknowledged") == 1:
            device = str(said.get("acknowledged_by_device") or "")[:25]
            by = f"pushover {device}" if device else f"pushover user …{str(said.get('acknowledged_by') or '')[-4:]}"
        return ReceiptState(by, is_over=said.get("expired") == 1)

    def cancel(self, receipt: str) -> bool:
        """Stop an emergency; whether that needs no second try."""
        request = self._request("POST", f"/1/receipts/{quote(receipt, safe='')}/cancel.json", form={"token": self._token})
        answer = exchanged(request, self._receiver.timeout_s)
        return not isinstance(answer, Outcome) and answer.status < 500 and answer.status != 429

    def form(self, message: Notification) -> dict[str, str]:
        """The fields of a message."""
        receiver = self._receiver
        priorities = {"low": receiver.priority_low, "medium": receiver.priority_medium, "high": receiver.priority_high}
        priority = priorities.get(message.severity, 0 if message.kind == "test" else receiver.priority_low)
        fields = {
            "token": self._token,
            "user": self._user,
            "title": message.title[:TITLE_MAX],
            "message": message.text[:MESSAGE_MAX] or message.title[:MESSAGE_MAX] or "cnctwin",
            "priority": str(priority),
        }
        if priority == EMERGENCY:
            fields |= {"retry": str(receiver.retry_s), "expire": str(receiver.expire_s)}
        if message.link and len(message.link) <= URL_MAX:
            fields |= {"url": message.link, "url_title": message.link_title[:URL_TITLE_MAX]}
        if receiver.device:
            fields["device"] = receiver.device
        return fields

    def _request(
        self, method: str, path: str, form: dict[str, str] | None = None, query: dict[str, str] | None = None
    ) -> Request:
        return Request(method, self._url + path, HEADERS, form=form, query=query, secrets=(self._token, self._user))

    def _clean(self, text: str) -> str:
        return redacted(text, (self._token, self._user))


def _object(answer: Answer) -> dict[str, Any]:
    try:
        said = json.loads(answer.body)
    except (ValueError, RecursionError):
        return {}
    return said if isinstance(said, dict) else {}
