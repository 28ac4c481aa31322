"""Slots: tracks seen at the same time have different slots, and none is left out without need."""

from __future__ import annotations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from dashboards.timeline.slots import SLOTS, slot_names, slots

SPANS = st.lists(st.tuples(st.integers(0, 200), st.integers(0, 60)), min_size=1, max_size=60)


@given(SPANS)
def test_tracks_of_one_slot_follow_each_other(spans: list[tuple[int, int]]) -> None:
    first = np.array([begin for begin, _ in spans])
    last = first + np.array([length for _, length in spans])
    taken = slots(first, last)
    for slot in range(SLOTS):
        mine = np.flatnonzero(taken == slot)
        mine = mine[np.argsort(first[mine])]
        assert (first[mine][1:] >= last[mine][:-1] + 2).all()
    for left_out in np.flatnonzero(taken < 0):  # every slot was taken when it began
        there = (first <= first[left_out]) & (last + 2 > first[left_out]) & (taken >= 0)
        assert there.sum() >= SLOTS


def test_every_track_has_its_own_slot_while_there_are_enough() -> None:
    first = np.arange(SLOTS) * 100
    assert sorted(slots(first, first + 10)) == list(range(SLOTS))


def test_a_slot_is_named_after_its_tracks() -> None:
    assert slot_names(np.array([0, 1, 0, -1]), ["#4", "#5", "#9", "#7"]) == ["#4, #9", "#5"]
    many = slot_names(np.zeros(9, dtype=np.int64), [f"#{i}" for i in range(9)])
    assert many == ["#0, #1, #2, #3, #4, #5 and 3 more"]
