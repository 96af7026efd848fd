"""Plates that are not where or when the feet are: refused, doubted, and named."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from made_steps import HALF_WIDTH_M, assign, everywhere, moved, plate, sides

from vsf_drake.errors import InputError


@pytest.mark.parametrize("change", [{"shift": (0.0, 1.0)}, {"rotate": np.pi / 2, "shift": (0.5, 0.6)},
                                    {"rotate": np.pi, "shift": (-0.5, 0.0)}])
def test_plates_that_lie_elsewhere_are_refused(change):
    with pytest.raises(InputError, match=r"plate \w+: the centre of pressure is [\d.]+ m from the nearest foot.*"
                                         r"corners, the unit.*--up.*--forward"):
        assign(*(moved(p, **change) for p in everywhere()))


def test_one_displaced_plate_is_named_and_not_used():
    result = assign(*everywhere(L1=moved(everywhere()[3], shift=(0.0, 0.6))))
    (contact,) = [c for c in result.contacts if c.plate == "L1"]
    assert contact.side is None and "m from the nearest foot" in contact.doubt
    assert contact.distance_m == pytest.approx(0.6 - 2 * HALF_WIDTH_M, abs=0.2)


def test_plate_turned_in_its_place_is_doubted():
    right = everywhere()[0]
    middle = np.nanmean(right.cop_m, axis=0)[:2]
    turned = moved(moved(right, shift=-middle), rotate=np.pi, shift=middle)
    (contact, *_) = assign(*everywhere(R0=turned)).contacts
    assert contact.side == "right" and "from toe to heel" in contact.doubt


def test_plate_beside_the_foot_is_doubted():
    (contact, *_) = assign(*everywhere(R0=moved(everywhere()[0], shift=(0.0, -0.1)))).contacts
    assert contact.side == "right" and "10 cm beside the foot" in contact.doubt


def test_force_down_or_sideways_is_refused():
    with pytest.raises(InputError, match=r"made\.c3d: plate R0: its vertical force is negative"):
        assign(*(dataclasses.replace(p, force_n=-p.force_n) for p in everywhere()))
    with pytest.raises(InputError, match="not vertical"):
        assign(*(dataclasses.replace(p, force_n=p.force_n[:, [2, 1, 0]]) for p in everywhere()))


def test_force_that_is_no_number_is_refused_with_its_sample():
    force = everywhere()[0].force_n.copy()
    force[4, 1] = np.nan
    with pytest.raises(InputError, match="plate R0: the force of sample 5 is not a finite number"):
        assign(dataclasses.replace(everywhere()[0], force_n=force))


def test_no_plates_or_empty_plates_are_refused():
    with pytest.raises(InputError, match="has no force plates"):
        assign()
    with pytest.raises(InputError, match="no plate carries a person"):
        assign(plate("1"))


def test_plates_in_each_others_place_are_refused():
    """Forces of one plate with the position of the next, as when a laboratory numbers its plates the other way."""
    made = everywhere()
    places = [made[i].cop_m for i in (1, 0, 3, 2)]
    shifted = []
    for p, place in zip(made, places, strict=True):
        middle = np.nanmean(place, axis=0)
        on = p.force_n[:, 2] > 20.0
        shifted.append(dataclasses.replace(p, cop_m=np.where(on[:, None], middle, np.nan)))
    with pytest.raises(InputError, match="m from the nearest foot"):
        assign(*shifted)


@pytest.mark.parametrize("late_ms", [-250, 250])
def test_forces_on_another_clock_are_refused(late_ms):
    """A quarter of a second off, half of each load acts where the foot is not yet or no longer."""
    late = [dataclasses.replace(p, force_n=np.roll(p.force_n, late_ms, axis=0), cop_m=np.roll(p.cop_m, late_ms, axis=0))
            for p in everywhere()]
    with pytest.raises(InputError, match="must share frame, unit and clock"):
        assign(*late)


def test_forces_a_little_late_keep_their_feet():
    late = [dataclasses.replace(p, force_n=np.roll(p.force_n, 80, axis=0), cop_m=np.roll(p.cop_m, 80, axis=0))
            for p in everywhere()]
    assert sides(assign(*late)) == [("R0", "right"), ("L0", "left"), ("R1", "right"), ("L1", "left")]
