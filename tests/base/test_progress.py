"""What long work tells of itself."""

from __future__ import annotations

from vsf_drake.base.progress import part_of


def test_a_part_takes_its_share_of_the_whole_and_stands_under_its_name():
    told = []
    show = part_of(lambda *said: told.append(said), 0.5, 0.25, name="bench: ")
    show("pressing", 0.0)
    show("pressing", 1.0)
    assert told == [("bench: pressing", 0.5), ("bench: pressing", 0.75)]


def test_parts_of_parts_add_up_and_without_anybody_to_tell_nothing_happens():
    told = []
    part_of(part_of(lambda _, fraction: told.append(fraction), 0.5, 0.5), 0.5, 0.5)("", 1.0)
    assert told == [1.0]
    part_of(None, 0.2)("pressing", 0.5)
