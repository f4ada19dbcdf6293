"""A webhook: the JSON of Alertmanager's webhook, version 4, by POST."""

from processors.alerts.courier.exchange import Request, exchanged, judged
from processors.alerts.courier.outcome import Outcome
from processors.alerts.notification import Notification

ID_HEADER = "X-Cnctwin-Notification"


def headers(bearer: str | None, key: str) -> dict[str, str]:
    """The headers of a request; by its id a receiver may know a notification again."""
    own = {"User-Agent": "cnctwin", ID_HEADER: key}
    return own if bearer is None else {**own, "Authorization": f"Bearer {bearer}"}


class Webhook:
    """See the module."""

    def __init__(self, url: str, bearer: str | None, timeout_s: float) -> None:
        self._url, self._bearer, self._timeout_s = url, bearer, timeout_s

    def send(self, message: Notification) -> Outcome:
        """Send one notification."""
        request = Request(
            "POST", self._url, headers(self._bearer, message.id), json=message.body, secrets=(self._url, self._bearer or "")
        )
        answer = exchanged(request, self._timeout_s)
        return answer if isinstance(answer, Outcome) else judged(answer, request)
