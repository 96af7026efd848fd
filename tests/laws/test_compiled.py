from __future__ import annotations

import numba

from vsf_drake.laws.compiled import compiled


def twice(x):
    return 2.0 * x


def test_machine_code_that_cannot_be_kept_on_disk_is_made_anew(monkeypatch):
    """As in a container whose package folder and home cannot be written, where numba raises this at the import."""
    njit = numba.njit

    def without_a_folder(*function, **options):
        if options.pop("cache", False):
            raise RuntimeError("cannot cache function 'twice': no locator available for file")
        return njit(*function, **options)

    monkeypatch.setattr(numba, "njit", without_a_folder)
    assert compiled(twice)(3.0) == 6.0
