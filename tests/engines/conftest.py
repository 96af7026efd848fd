"""What tests of the engines share."""

from __future__ import annotations

import pytest

from vsf_drake.engines.condensed import CondensedFoot, condense
from vsf_drake.model.parameters import FootParameters


@pytest.fixture(scope="session")
def condensed() -> CondensedFoot:
    """The nominal foot, condensed once."""
    return condense(FootParameters())
