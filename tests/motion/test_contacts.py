"""Every contact goes to the foot that stands on the plate, and what is not known is said."""

from __future__ import annotations

import dataclasses

import made_steps as made
import numpy as np
import pytest

from vsf_drake.base.errors import InputError
from vsf_drake.motion.events import find_stances


def test_consecutive_steps_on_many_plates_go_to_the_right_feet():
    result = made.assign(*made.everywhere(), made.plate("empty"))
    assert made.sides(result) == [("R0", "right"), ("L0", "left"), ("R1", "right"), ("L1", "left")]
    assert all(c.warning is None and c.distance_m < 0.03 for c in result.contacts)
    for side, names in (("right", ("R0", "R1")), ("left", ("L0", "L1"))):
        wanted = sum(p.force_n for p in made.everywhere() if p.name in names)
        assert np.array_equal(result.plates[side].force_W, wanted)
        assert len(find_stances(made.FORCE_TIME, result.plates[side].force_W[:, 2])) == 2


def test_both_feet_on_one_plate_are_unusable():
    long = made.plate("1", made.step_load("right", 0), made.step_load("left", 0))
    result = made.assign(long, made.plate("R1", made.step_load("right", 1)))
    shared = [c for c in result.contacts if c.plate == "1"]
    assert shared and all(c.side is None and "unusable" in c.warning for c in shared)
    assert "left" not in result.plates
    assert result.plates["right"].force_W[made.FORCE_TIME < 1.3].max() == 0.0
    for side in ("right", "left"):
        start = next(s for s, _ in made.steps(side) if s > 0.0)
        assert any(
            a < start + 0.1 and b > start + made.STANCE_S - 0.1 for a, b in result.unmeasured[side]
        )


def test_foot_that_lands_on_the_plate_of_the_other_makes_it_unusable():
    """The left heel lands beside the right foot: the plate reads both, its corners tell."""
    (start, x), (_, y) = made.steps("left")[2], (0, made.HALF_WIDTH_M)
    corners = made.rectangle((-0.1, x + 0.4), (-0.3, 0.3))
    both = made.plate(
        "1", made.step_load("right", 0), made.load(start, (x, y), newton=400.0), corners=corners
    )
    result = made.assign(both, made.plate("R1", made.step_load("right", 1)))
    assert all(c.side is None for c in result.contacts if c.plate == "1")
    assert all(
        any(a < start + 0.1 < b for a, b in result.unmeasured[side]) for side in ("right", "left")
    )


def test_foot_that_stands_on_the_plate_too_shares_it_unless_a_plate_of_its_own_carries_it():
    wide = made.plate(
        "1", made.step_load("right", 0), corners=made.rectangle((-0.1, 1.0), (-0.3, 0.3))
    )
    assert dict(made.sides(made.assign(wide, *made.everywhere(R0=None, L0=None))))["1"] is None
    assert dict(made.sides(made.assign(wide, *made.everywhere(R0=None))))["1"] == "right"


def test_one_foot_on_two_plates_is_their_sum():
    """Heel on one plate and toes on the next: same resultant, same centre of pressure, same
    moment."""
    force, cop = made.step_load("right", 0)
    share = 1.0 / (1.0 + np.exp(-40.0 * (np.nan_to_num(cop[:, 0]) - 0.12)))
    parts = []
    for name, part, shift in (("heel", 1 - share, -0.05), ("toe", share, 0.05)):
        f = force * part[:, None]
        c = np.where(f[:, 2:] > 20.0, cop + np.array([0.0, shift, 0.0]), np.nan)
        parts.append(
            dataclasses.replace(
                made.plate(name), force_n=f, cop_m=c, free_moment_nm=np.where(f[:, 2] > 20, 1.0, 0)
            )
        )
    result = made.assign(*parts, *made.everywhere(R0=None))
    got = result.plates["right"]
    rows = (made.FORCE_TIME > 0.35) & (made.FORCE_TIME < 0.95)
    assert np.allclose(got.force_W[rows], force[rows], atol=5.0)
    both = rows & (parts[0].force_n[:, 2] > 20) & (parts[1].force_n[:, 2] > 20)
    assert both.sum() > 50
    f, c = [p.force_n[both] for p in parts], [p.cop_m[both] for p in parts]
    about_origin = sum(
        np.cross(ci, fi) + np.array([0, 0, 1.0]) for ci, fi in zip(c, f, strict=True)
    )
    again = np.cross(got.cop_W[both], got.force_W[both]) + got.free_moment_nm[both, None] * [
        0,
        0,
        1.0,
    ]
    assert np.allclose(again, about_origin, atol=1e-9)


def test_scuff_in_swing_is_no_contact():
    scuff = made.load(1.05, (0.6, -made.HALF_WIDTH_M), newton=60.0, end_s=1.15)
    result = made.assign(*made.everywhere(R0=made.plate("R0", made.step_load("right", 0), scuff)))
    assert sum(c.plate == "R0" for c in result.contacts) == 1


def test_foot_half_a_stance_on_the_floor_is_doubted():
    force, cop = made.step_load("right", 1)
    late = made.FORCE_TIME < 1.4 + 0.3
    force[late] = 0.0
    cop[late] = np.nan
    result = made.assign(*made.everywhere(R1=made.plate("R1", (force, cop))))
    (contact,) = [c for c in result.contacts if c.plate == "R1"]
    assert contact.side == "right" and "stands on no plate for 0.3" in contact.warning
    assert any(a < 1.5 and b > 2.0 for a, b in result.unmeasured["right"])


def test_same_load_reported_twice_counts_once():
    once = made.assign(*made.everywhere())
    twice = made.assign(*made.everywhere(), made.plate("copy", made.step_load("right", 0)))
    assert np.array_equal(once.plates["right"].force_W, twice.plates["right"].force_W)
    assert any("Plates R0 and copy report the same force" in note for note in twice.notes)


def test_stated_plates_win_and_a_contradiction_is_noted():
    result = made.assign(*made.everywhere()[:2], stated={"right": "L0", "left": "R0"})
    assert dict(made.sides(result)) == {"L0": "right", "R0": "left"}
    assert all("it is stated as the" in c.warning for c in result.contacts)
    assert (
        made.assign(*made.everywhere()[:2], stated={"right": "R0", "left": "L0"})
        .contacts[0]
        .warning
        is None
    )
    with pytest.raises(
        InputError,
        match=r"forces\.right \(--right-plate\): there is no plate 9\. Plates are: R0, L0",
    ):
        made.assign(*made.everywhere()[:2], stated={"right": "9"})


def test_plates_without_centre_of_pressure_are_told_by_time():
    blind = [dataclasses.replace(p, cop_m=np.full_like(p.cop_m, np.nan)) for p in made.everywhere()]
    result = made.assign(*blind)
    assert dict(made.sides(result)) == {"R0": "right", "R1": "right", "L0": "left", "L1": "left"}
    assert (
        not result.plates["right"].has_cop
        and "identified by its times" in result.contacts[0].warning
    )


@pytest.mark.parametrize(
    "change",
    [
        {"shift": (0.0, 1.0)},
        {"rotate": np.pi / 2, "shift": (0.5, 0.6)},
        {"rotate": np.pi, "shift": (-0.5, 0.0)},
    ],
)
def test_plates_that_lie_elsewhere_are_refused(change):
    with pytest.raises(
        InputError,
        match=r"plate \w+: the centre of pressure is [\d.]+ m from the nearest foot.*"
        r"corners, the unit.*--up.*--forward",
    ):
        made.assign(*(made.moved(p, **change) for p in made.everywhere()))


@pytest.mark.parametrize("late_ms", [-250, 250])
def test_forces_on_another_clock_are_refused(late_ms):
    """A quarter of a second off, half of each load acts where the foot is not yet or no longer."""
    late = [
        dataclasses.replace(
            p, force_n=np.roll(p.force_n, late_ms, axis=0), cop_m=np.roll(p.cop_m, late_ms, axis=0)
        )
        for p in made.everywhere()
    ]
    with pytest.raises(InputError, match="must share frame, unit and clock"):
        made.assign(*late)
