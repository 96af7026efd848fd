"""The list of wrong versions is of the sources as they are; whether tests notice them is run by
hand."""

from __future__ import annotations

import pytest
import source_mutations
from source_mutations import BY_HAND, ROOT, TESTS


@pytest.mark.parametrize(
    "mutation",
    [*BY_HAND, *(one.also for one in BY_HAND if one.also)],
    ids=lambda one: f"{one.area}: {one.new.strip()[:40]}",
)
def test_the_place_of_a_mutation_is_there_once_and_its_tests_exist(mutation):
    text = (ROOT / mutation.path).read_text(encoding="utf-8")
    assert mutation.applied(text) != text
    assert all((ROOT / name).exists() for name in TESTS[mutation.area])


def test_every_constant_of_strength_and_every_published_sign_and_number_is_changed_once():
    """Six joint directions of two sexes have six constants each, six joints four of passive
    torque."""
    strength = list(source_mutations.constants_of_strength())
    assert len(strength) == 2 * 6 * 6 + 2 * 3 * 4
    assert len({one.new for one in strength}) == len(strength)
    published = list(source_mutations.entries_of_published_effects())
    assert len({one.new for one in published}) == len(published) > 40
