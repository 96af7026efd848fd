"""Prior widths from options and a file: the longest pattern decides, units are the parameter's,
nonsense is refused."""

from __future__ import annotations

import math

import pytest

from vsf_drake.base.errors import InputError
from vsf_drake.cli.fit_priors import prior_widths, with_priors
from vsf_drake.fit.parameters import FitParameter, FitParameters


def one(name, unit="rad", **changes):
    bounds = {"low": -0.3, "high": 0.3, "start": 0.0, "mean": 0.0, "scale": 0.05}
    return FitParameter(**{"name": name, "unit": unit, **bounds, **changes})


@pytest.fixture(scope="module")
def parameters():
    return FitParameters(
        [
            one("curve.hip.0"),
            one("curve.knee.0"),
            one("offset.height", "m"),
            one("trial.low [1].curve.hip.0"),
            one(
                "friction.mu_static", "1", low=0.1, high=1.5, start=0.5, mean=0.5, logarithmic=True
            ),
            one("keel.flexural_modulus", "Pa", frozen=True),
        ]
    )


def test_the_longest_pattern_decides_and_angles_and_lengths_may_be_in_other_units(parameters):
    found = with_priors(
        parameters,
        {
            "curve.*": "2deg",
            "curve.knee.*": "0.1",
            "offset.height": "5mm",
            "trial.low [1].curve.hip.0": "0.5deg",
            "friction.mu_static": "0.7",
            "keel.*": "0.2",
        },
    ).by_name
    assert (
        found["curve.hip.0"].scale == pytest.approx(math.radians(2.0))
        and found["curve.knee.0"].scale == 0.1
    )
    assert (
        found["offset.height"].scale == pytest.approx(5e-3)
        and found["friction.mu_static"].scale == 0.7
    )
    assert found["trial.low [1].curve.hip.0"].scale == pytest.approx(math.radians(0.5)), (
        "a name may look like a glob"
    )
    keel = found["keel.flexural_modulus"]
    assert keel.frozen and keel.scale == 0.2, "what is held widens the intervals by its prior"


def test_an_option_goes_before_the_file(tmp_path):
    file = tmp_path / "priors.yaml"
    file.write_text("curve.*: 1deg\noffset.height: 4mm\n")
    assert prior_widths(["curve.*=2deg"], file) == {"curve.*": "2deg", "offset.height": "4mm"}


@pytest.mark.parametrize(
    ("widths", "match"),
    [
        ({"curve.*": "0"}, "must be above 0"),
        ({"curve.*": "-1"}, "must be above 0"),
        ({"curve.*": "nan"}, "must be"),
        ({"curve.*": "much"}, "is no number"),
        ({"cruve.*": "1"}, "no parameter 'cruve"),
        ({"curve.*": "1mm"}, "not measured in mm"),
        ({"friction.*": "1deg"}, "its logarithm"),
        ({"curve.*": "1.5"}, "wider than the bounds"),
    ],
)
def test_what_is_no_width_of_a_prior_is_refused(parameters, widths, match):
    with pytest.raises(InputError, match=match):
        with_priors(parameters, widths)


@pytest.mark.parametrize(
    ("options", "match"),
    [(["curve.*"], "is no prior"), (["=3"], "is no prior"), (["a=1", "a=2"], "a is given 1 and 2")],
)
def test_what_is_no_prior_is_refused(options, match):
    with pytest.raises(InputError, match=match):
        prior_widths(options, None)


@pytest.mark.parametrize("text", ["- 1\n", "curve.*: [1]\n", "a: 1\na: 2\n", ""])
def test_a_file_that_holds_no_priors_is_refused(tmp_path, text):
    file = tmp_path / "priors.yaml"
    file.write_text(text)
    with pytest.raises(InputError, match=r"priors\.yaml"):
        prior_widths([], file)
