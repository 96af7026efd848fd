"""Where docs/guide says what a command takes: its page, and the section on what an error is
about."""

from __future__ import annotations

import re
from collections.abc import Sequence
from itertools import pairwise
from os.path import abspath, expanduser

from vsf_drake.base.errors import InputError

GUIDES = {
    "session": "session",
    "bench": "commands",
    "simulate": "trials",
    "validate": "validate",
    "report": "results",
    "import": "laboratory_files",
    "check": "trials",
    "sweep": "sweep",
    "fit": "fit",
    "predict": "predict",
    "compare": "results#two-walks-beside-each-other",
    "tune": "tune",
    "map": "stiffness_map",
    "show": "drake",
    "foot": "foot_from_curves",
    "export": "engines#export",
    "certify": "engines#certify",
    "stand": "trials#the-subject",
    "doctor": "commands",
}
"""Commands as --help and docs/guide/commands.md order them, and their place in docs/guide."""
_PLACES = {
    "trials#from-joint-angles": (
        "kinematics kinematics_unit inDegrees prosthesis window offsets belt_speed_m_per_s "
        "unknown_force plate_rest_n .mot .sto"
    ),
    "trials#from-markers": (
        "markers standing marker_map laboratory hip_centre marker_cutoff_hz already_filtered"
    ),
    "trials#without-a-force-plate": "forces",
    "trials#what-a-recording-is-worth": "--accept-unusable",
    "trials#the-subject": "subject mass_kg stature_m sex prosthetic_side --subject",
    "trials#another-setting": "simulate:--fulcrum-mm",
    "trials#offsets-fitted-to-this-trial": "--fit-offsets",
    "laboratory_files#files": "STATIC --no-standing --up --forward --length-unit .c3d .trc",
    "laboratory_files#markers": (
        "marker import:markers import:label --map --marker-map --list-markers --cutoff-hz "
        "--longest-gap-s"
    ),
    "laboratory_files#person": (
        "import:--subject --hip --mass-kg --stature-m --prosthetic-side --sex import:--fulcrum-mm"
    ),
    "laboratory_files#forces": (
        "plate FORCE_PLATFORM import:forces --forces --right-plate --left-plate --window "
        "--belt-speed-m-per-s import:window import:.mot import:.sto"
    ),
    "laboratory_files#length-of-the-foot": "--foot-length-mm",
    "fit#what-is-fitted-and-priors": "--free --freeze --prior --prior-file",
    "fit#which-trials-and-what-comes-out": "--hold-out --held-out-height --contact",
    "fit#how-long-and-how-to-go-on": "fit:--resume --starts",
    "fit#the-bench-file": "--bench",
    "validate#missing-data-and-measured-bench-curves": "validate:--bench",
    "tune#costs": "--cost --weights",
    "tune#two-levels": (
        "--level --design --joints --intervals --method --warm-start --fulcrum-range"
    ),
    "stiffness_map#the-map-and-asking-it": "--target",
    "stiffness_map#axes": (
        "--mass --slope --alignment map:--heel map:--fulcrum-mm map:mass_kg map:slope_deg "
        "map:fulcrum_mm map:alignment_deg map:heel_ratio"
    ),
    "stiffness_map#a-load-of-your-own": "--load",
    "stiffness_map#what-stands-behind-it": "map:--draws map:draws",
    "sweep#what-is-varied": "--vary --sample sweep:--fulcrum-mm",
    "validate#against-published-effects": "--against",
    "foot_from_curves#the-file-of-curves": (
        "part branch load_n displacement_mm angle_deg foot:forefoot foot:heel foot:.csv"
    ),
    "foot_from_curves#without-curves": "--forefoot-n-per-mm --heel-n-per-mm --load-n",
    "foot_from_curves#the-foot": "--length-mm --mass-g --keel-mm foot:--out",
    "protocols": "--protocol",
    "results#the-folder": "--out",
    "files_and_units#which-file-is-what": "--model",
}
"""Sections, and what each is about: options, keys, endings of files; `COMMAND:` before what is so
for one command."""
_SECTIONS = {name: place for place, names in _PLACES.items() for name in names.split()}


def guide_to(error: InputError, words: Sequence[str]) -> str:
    """Page and section of docs/guide on what `error` is about, "" for a command without one;
    `words` are the command's.

    An option that the message names counts first, then the option whose file it is in, a key, and
    the file's ending.
    """
    command = next(iter(words), "")
    file = str(error.file or "")
    place = error.where or ""
    pairs = [
        pair for word in words for pair in (word.split("=", 1) if word.startswith("--") else [word])
    ]
    given = [
        option
        for option, value in pairwise(pairs)
        if file and option.startswith("--") and abspath(expanduser(value)) == abspath(file)
    ]
    about = [
        *re.findall(r"--[a-z-]+", place),
        *given,
        *re.findall(r"\w+", place),
        *re.findall(r"\.\w+$", file),
    ]
    for name in about:
        for key in (f"{command}:{name}", name):
            if key in _SECTIONS:
                return _SECTIONS[key]
    return GUIDES.get(command, "")
