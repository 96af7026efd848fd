"""A subject and persons for the tests of plants."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import cache

import pytest

from vsf_drake.model.parameters import ModelParameters, Subject
from vsf_drake.plants.gait import GaitDiagram, make_gait

SUBJECT = Subject(mass_kg=78.0, stature_m=1.81, sex="male", prosthetic_side="right")


@pytest.fixture
def subject() -> Subject:
    """The paper's subject: male, 78 kg, 1.81 m."""
    return SUBJECT


@pytest.fixture(scope="session")
def gait() -> Callable[..., GaitDiagram]:
    """gait(side): the person of that side of prosthesis, on the ground; built once."""
    return cache(lambda side: make_gait(replace(SUBJECT, prosthetic_side=side), ModelParameters()))
