"""Notices are numbered, and what is the same but for its numbers is one with a count, until it is final."""

from __future__ import annotations

import threading

from recoil_daq.live.notice_board import KEPT, NoticeBoard


def told(board: NoticeBoard) -> list[tuple[int, str, int]]:
    return [(one.number, one.text, one.count) for one in board.newest]


def test_lines_have_numbers_and_single_blanks() -> None:
    board = NoticeBoard()
    board.take("a\n  b")
    board.take("c")
    assert told(board) == [(1, "a b", 1), (2, "c", 1)]
    assert board.newest[0].line.endswith("Z  a b")


def test_what_is_the_same_takes_the_place_of_the_last_until_that_is_final() -> None:
    board = NoticeBoard()
    for text in ("8.1", "8.2"):
        board.take(text, "crossed")
    board.take("captured")
    board.take("8.3", "crossed")
    assert told(board) == [(1, "8.3", 3), (2, "captured", 1)]
    assert board.newest[0].line.endswith("8.3, 3 times")
    assert [one.number for one in board.finish(2)] == [1]
    board.take("8.4", "crossed")
    assert told(board)[-1] == (3, "8.4", 1)
    assert [one.number for one in board.finish(4)] == [2, 3]
    assert board.finish(4) == ()


def test_only_the_newest_are_kept() -> None:
    board = NoticeBoard()
    board.take("first", "same")
    for i in range(KEPT + 5):
        board.take(str(i))
    board.take("again", "same")
    assert len(board.newest) == KEPT
    assert told(board)[-1] == (KEPT + 7, "again", 1)


def test_threads_share_a_board() -> None:
    board = NoticeBoard()
    threads = [threading.Thread(target=lambda: [board.take("crossed", "same") for _ in range(500)]) for _ in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert told(board) == [(1, "crossed", 2000)]
