from __future__ import annotations

import threading
from collections.abc import Iterator

import pytest

from pipeline.parallel.prefetch import ahead


def test_items_come_in_order_and_from_another_thread() -> None:
    makers = set()

    def numbers() -> Iterator[int]:
        for number in range(100):
            makers.add(threading.get_ident())
            yield number

    assert list(ahead(numbers(), 3)) == list(range(100))
    assert makers
    assert threading.get_ident() not in makers


def test_no_more_are_made_than_the_limit() -> None:
    made = []

    def numbers() -> Iterator[int]:
        for number in range(50):
            made.append(number)
            yield number

    for number in ahead(numbers(), 4):
        # in the queue, one on its way into it, and one being made
        assert len(made) <= number + 1 + 4 + 2


def test_what_goes_wrong_is_told_after_what_went_well() -> None:
    def numbers() -> Iterator[int]:
        yield from (1, 2)
        raise OSError("the disk is gone")

    got: list[int] = []
    with pytest.raises(OSError, match="disk is gone"):
        got.extend(ahead(numbers(), 10))
    assert got == [1, 2]


@pytest.mark.parametrize("used", [0, 1, 5])
def test_whoever_stops_early_leaves_no_thread(used: int) -> None:
    before = threading.active_count()
    items = ahead(iter(int, 1), 2)  # zeros without end
    for _, _ in zip(range(used), items, strict=False):
        pass
    items.close()  # type: ignore[attr-defined]
    assert threading.active_count() == before
