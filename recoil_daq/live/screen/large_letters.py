"""Words in letters of five rows, that are read from three metres."""

from __future__ import annotations

ROWS = 5
_GAP = " "
_LETTERS = {
    "A": (" ██ ", "█  █", "████", "█  █", "█  █"),
    "B": ("███ ", "█  █", "███ ", "█  █", "███ "),
    "C": (" ███", "█   ", "█   ", "█   ", " ███"),
    "D": ("███ ", "█  █", "█  █", "█  █", "███ "),
    "E": ("████", "█   ", "███ ", "█   ", "████"),
    "F": ("████", "█   ", "███ ", "█   ", "█   "),
    "H": ("█  █", "█  █", "████", "█  █", "█  █"),
    "I": ("█", "█", "█", "█", "█"),
    "L": ("█   ", "█   ", "█   ", "█   ", "████"),
    "M": ("█   █", "██ ██", "█ █ █", "█   █", "█   █"),
    "N": ("█  █", "██ █", "█ ██", "█  █", "█  █"),
    "O": (" ██ ", "█  █", "█  █", "█  █", " ██ "),
    "P": ("███ ", "█  █", "███ ", "█   ", "█   "),
    "R": ("███ ", "█  █", "███ ", "█ █ ", "█  █"),
    "S": (" ███", "█   ", " ██ ", "   █", "███ "),
    "T": ("█████", "  █  ", "  █  ", "  █  ", "  █  "),
    "U": ("█  █", "█  █", "█  █", "█  █", " ██ "),
    "W": ("█   █", "█   █", "█ █ █", "██ ██", "█   █"),
    "Y": ("█   █", " █ █ ", "  █  ", "  █  ", "  █  "),
    " ": (" ", " ", " ", " ", " "),
}  # fmt: skip
"""Letters of the states of a shot."""


def large(word: str, width: int) -> tuple[str, ...]:
    r"""Return a word in so many rows, none wider than there is room for; none where it has no room or no such letter.

    >>> print("\n".join(large("fi", 10)))
    ████ █
    █    █
    ███  █
    █    █
    █    █
    """
    letters = [_LETTERS.get(letter) for letter in word.upper()]
    if None in letters:
        return ()
    rows = tuple(_GAP.join(letter[row] for letter in letters if letter).rstrip() for row in range(ROWS))
    return rows if max(map(len, rows), default=0) <= width else ()
