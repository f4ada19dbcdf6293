"""A word that the control refuses, before anybody knows on which line it stands. The interpreter adds the line."""


class RefusedError(Exception):
    """`word` as written (empty: the block as a whole) and `reason` with the way out.

    place: index of the line and name of the text, where the fault is not in the running block (compensation looks ahead)
    """

    def __init__(self, word: str, reason: str, place: tuple[int, str | None] | None = None) -> None:
        super().__init__(word, reason)
        self.word, self.reason, self.place = word, reason, place
