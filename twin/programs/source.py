"""The text of a part program in lines, and the places of words in a line, whatever the language.

An edit keeps all other characters.
"""

import re
from collections.abc import Mapping
from typing import Final, NamedTuple

LINE_END: Final = re.compile(r"\r\n|\r|\n")


class WordPlace(NamedTuple):
    """The place of a word in the text of a line: `text[begin:end]`, its value at `text[figure:end]`.

    plain: the value is a number, not an expression or a name
    """

    begin: int
    figure: int
    end: int
    plain: bool

    def replaced(self, text: str, figure: str) -> str:
        """Return the line with this value in place of the word's own.

        >>> WordPlace(4, 6, 9, True).replaced("G1X2F=400;F", "500")
        'G1X2F=500;F'
        """
        return text[: self.figure] + figure + text[self.end :]


def source_lines(text: str) -> list[str]:
    """The lines of a program without their ends, counted as the interpreters count.

    >>> source_lines("G0\\r\\nG1\\n")
    ['G0', 'G1', '']
    """
    return LINE_END.split(text)


def joined(text: str, changed: Mapping[int, str]) -> str:
    """The program with some lines (from 0) replaced, every end of a line as it was.

    >>> joined("G0\\r\\nG1\\n", {1: "G1 F5"})
    'G0\\r\\nG1 F5\\n'
    """
    ends = [*LINE_END.findall(text), ""]
    return "".join(changed.get(k, line) + end for k, (line, end) in enumerate(zip(source_lines(text), ends, strict=True)))
