"""Which shipped map fits a recording's labels, and a first map of a recording's own."""

from __future__ import annotations

import difflib
from collections.abc import Iterable

from vsf_drake.errors import InputError
from vsf_drake.motion.formats.labels import listed
from vsf_drake.motion.formats.recording import Recording
from vsf_drake.motion.markers.maps import (
    MIDDLE_CLUSTERS,
    MIDDLE_ROLES,
    SHIPPED,
    SIDED_CLUSTERS,
    SIDED_ROLES,
    SIDES,
    FoundMarkers,
    MarkerMap,
    load_marker_map,
)

ALIKE = 0.75
"""Least similarity (difflib's ratio) of a label to a known spelling for a guess (a choice)."""
VIRTUAL = ("HJC", "KJC", "AJC")
"""Endings of computed points that some files hold beside the markers; they are not guessed for anything."""
WORDS = {
    "asis": ("asis", "asi", "ias", "iliacanterior"), "psis": ("psis", "psi", "ips", "iliacposterior"),
    "trochanter": ("trochanter", "troc", "gtr", "ftc"),
    "knee_medial": (
        "kneemed", "kneem", "kneeint", "medknee", "medialknee", "mknee", "femmed", "condylemed", "medcon", "fme",
        "mek"),
    "knee_lateral": (
        "kneelat", "kneel", "kneeext", "latknee", "lateralknee", "lknee", "femlat", "condylelat", "latcon", "knee",
        "fle", "lek"),
    "ankle_medial": ("anklemed", "anklem", "ankleint", "medankle", "mankle", "malmed", "medmal", "mmal", "tam"),
    "ankle_lateral": (
        "anklelat", "anklel", "ankleext", "latankle", "lankle", "mallat", "latmal", "lmal", "ankle", "fal"),
    "heel": ("heel", "calc", "cal", "fcc"), "toe_tip": ("toetip", "hallux", "toe"),
    "toe": ("mt2", "met2", "mth2", "2mt", "2met", "2mth", "fm2", "fmt2"),
    "met1": ("mt1", "met1", "mth1", "1mt", "1met", "1mth", "fm1", "fmt1"),
    "met5": ("mt5", "met5", "mth5", "5mt", "5met", "5mth", "fm5", "fmt5"),
    "thigh": ("thigh", "th", "femur", "fem", "lthi"),
    "shank": ("shank", "sh", "sk", "lsha", "tibia", "tib", "calf", "leg", "fax", "ttc"), "foot": ("foot", "midfoot"),
    "sacrum": ("sacrum", "sacral", "sacr", "sac"), "head_top": ("tophead", "headtop", "vertex"),
    "pelvis": ("iliaccrest", "crest", "pelvis")}
"""What laboratories write, without the side and without punctuation; the longest that a label starts with counts."""
SHORT = 3
"""After a form of so few letters only a number may follow: RSH1 is a shank, RSHO a shoulder."""


def choose_map(recording: Recording) -> tuple[MarkerMap, str]:
    """The shipped map that finds a complete set of markers in a standing trial and knows most of its labels; a note.

    Raises:
        InputError: no shipped map finds all that a calibration needs (what is missing, where one knows half of the
            labels); or two that mean different things know as many labels.
    """
    fitting: list[tuple[int, MarkerMap, FoundMarkers]] = []
    failing: list[tuple[int, InputError]] = []
    for marker_map in map(load_marker_map, SHIPPED):
        labels = marker_map.translate(recording.markers, recording.path).values()
        known = len(marker_map.spellings() & set(labels))
        try:
            fitting.append((known, marker_map, marker_map.find(labels, recording.path)))
        except InputError as error:
            failing.append((known, error))
    if not fitting:
        known, error = max(failing, key=lambda pair: pair[0])
        if 2 * known >= len(recording.markers):
            raise error
        raise InputError("no shipped marker map fits its labels: " + listed(list(recording.markers)),
                         file=recording.path, where="marker_map",
                         right="Write a map: `vsf-drake import --list-markers` starts one from the file's own labels")
    most = max(known for known, _, _ in fitting)
    best = [(marker_map, found) for known, marker_map, found in fitting if known == most]
    if any(found != best[0][1] for _, found in best):
        raise InputError(f"the marker maps {' and '.join(m.name for m, _ in best)} fit equally well",
                         file=recording.path, where="marker_map", right="Say which one (--marker-map)")
    chosen = best[0][0]
    return chosen, (f"No marker map was stated; {chosen.name}, which knows {most} of the {len(recording.markers)} "
                    "labels, was taken.")


def suggest_map(labels: Iterable[str]) -> str:
    """YAML text of a marker map for these labels, to be looked over.

    Labels that a shipped map knows are taken from there, others by what they look like, marked as guesses. Roles
    without a label stand in comments, labels without a role at the end.
    """
    labels = list(dict.fromkeys(label.rsplit(":", 1)[-1] for label in labels))
    known, guessed = _known(labels), {}
    for label in labels:
        if label not in known and not label.upper().endswith(VIRTUAL):
            place = _guess(label)
            if place is not None:
                guessed[label] = place
    text = ["# Started from a recording's own labels: look over every line, above all those marked as guesses.",
            "description: markers of our laboratory", "prefix: any"]
    for block in (*SIDES, "middle"):
        text.append(f"{block}:")
        roles, clusters = ((MIDDLE_ROLES, MIDDLE_CLUSTERS) if block == "middle" else (SIDED_ROLES, SIDED_CLUSTERS))
        for role in roles + clusters:
            sure = [label for label in labels if known.get(label) == (block, role)]
            maybe = [label for label in labels if guessed.get(label) == (block, role)]
            text.append(_line(role, sure, maybe, several=role in clusters))
    unused = [label for label in labels if label not in known and label not in guessed]
    if unused:
        text.append("# Labels without a role:")
        text += [f"#   {label}" for label in unused]
    return "\n".join(text) + "\n"


def _line(role: str, sure: list[str], maybe: list[str], *, several: bool) -> str:
    chosen = (sure + maybe) if several else (sure or maybe)
    if not chosen:
        return f"  # {role}:"
    remarks = []
    if any(label in maybe for label in chosen):
        remarks.append("guess" if not several else f"guesses: {', '.join(maybe)}")
    if role == "toe_tip":
        remarks.append("toe instead, if it is on the second metatarsal head")
    if not several and len(chosen) > 1:
        remarks.append(f"or {', '.join(chosen[1:])}")
    value = ", ".join(_quoted(label) for label in (chosen if several else chosen[:1]))
    remark = f"  # {'; '.join(remarks)}" if remarks else ""
    return f"  {role}: {f'[{value}]' if several else value}{remark}"


def _quoted(label: str) -> str:
    plain = label.isascii() and label.replace(".", "").replace("_", "").isalnum() and not label[0].isdigit()
    return label if plain else "'" + label.replace("'", "''") + "'"


def _known(labels: list[str]) -> dict[str, tuple[str, str]]:
    """Block and role of the labels that the shipped map knows which knows most of them."""
    maps = [load_marker_map(name) for name in SHIPPED]
    best = max(maps, key=lambda m: len(m.spellings() & set(m.translate(labels).values())))
    owner = {label: role for places in (best.roles, best.clusters) for role, spellings in places.items()
             for label in spellings}
    return {label: _block(owner[bare]) for label, bare in best.translate(labels).items() if bare in owner}


def _block(role: str) -> tuple[str, str]:
    for side in SIDES:
        if role.endswith(f"_{side}"):
            return side, role.removesuffix(f"_{side}")
    return "middle", role


def _guess(label: str) -> tuple[str, str] | None:
    """Block and role that a label looks like, by its side letter or word and what remains."""
    word = "".join(ch for ch in label.casefold() if ch.isalnum())
    if word in WORDS["sacrum"] + WORDS["head_top"]:
        return "middle", "sacrum" if word in WORDS["sacrum"] else "head_top"
    for side in SIDES:
        for mark in (side, side[0]):
            for rest in ((word.removeprefix(mark),) if word.startswith(mark) else ()) + (
                    (word.removesuffix(mark),) if word.endswith(mark) else ()):
                role = _role(rest)
                if role is not None:
                    return ("middle", role) if role in MIDDLE_CLUSTERS else (side, role)
    return None


def _role(word: str) -> str | None:
    starts = [(len(form), role) for role, forms in WORDS.items() for form in forms
              if word.startswith(form) and (len(form) > SHORT or not word[len(form):].strip("0123456789"))]
    if starts:
        return max(starts)[1]
    long = [form for forms in WORDS.values() for form in forms if len(form) > SHORT]
    close = difflib.get_close_matches(word, long, n=1, cutoff=ALIKE)
    return next((role for role, forms in WORDS.items() if close and close[0] in forms), None)
