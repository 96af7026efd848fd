"""Which shipped map fits a recording's labels, and a first map of a recording's own."""

from __future__ import annotations

import difflib
import warnings
from collections.abc import Iterable, Mapping
from dataclasses import dataclass

import numpy as np

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


WIDE_M = 0.03
"""The inner and the outer marker of a joint lie farther apart than this (a choice; ankles are 50 mm wide or more)."""
_ACROSS = (("knee_medial", "knee_lateral"), ("ankle_medial", "ankle_lateral"), ("met1", "met5"))
_PLACES = {role: np.array(weights) for role, weights in {
    "asis": (1, 0, 0, 0), "psis": (-1, 0, 0, 0), "trochanter": (0, 1, 0, 0), "knee_lateral": (0, 1, 0, 0),
    "knee_medial": (0, -1, 0, 0), "ankle_lateral": (0, 1, 0, 0), "ankle_medial": (0, -1, 0, 0),
    "heel": (-1, 0, -0.5, 1), "toe": (0, 0, 0, 1), "toe_tip": (1, 0, 0, 0), "met1": (0, -1, 0, 0),
    "met5": (0, 1, 0, 0)}.items()}
"""What tells the marker of a role from others that are called alike: how far it lies ahead, outward, up and near the
foot's midline (weights, a choice). The heel's is the rearmost, low and near the midline."""


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
                         file=recording.path, where="marker_map (--map)",
                         right="Write a map: `vsf-drake import --list-markers` starts one from the file's own labels")
    most = max(known for known, _, _ in fitting)
    best = [(marker_map, found) for known, marker_map, found in fitting if known == most]
    if any(found != best[0][1] for _, found in best):
        raise InputError(f"the marker maps {' and '.join(m.name for m, _ in best)} fit equally well",
                         file=recording.path, where="marker_map (--map)", right="Say which one")
    chosen = best[0][0]
    return chosen, (f"No marker map was stated; {chosen.name}, which knows {most} of the {len(recording.markers)} "
                    "labels, was taken.")


def suggest_map(labels: Iterable[str], recording: Recording | None = None) -> str:
    """YAML text of a marker map for these labels, to be looked over; comments list the labels.

    Labels that a shipped map knows are taken from there, others by what they look like, marked as guesses. Among
    several that look like one role, and between the inner and the outer side of a joint, their places in `recording`
    decide, without it the file's order. Roles without a label stand in comments, labels without a role at the end.
    """
    labels = list(dict.fromkeys(label.rsplit(":", 1)[-1] for label in labels))
    known, guessed = _known(labels), {}
    for label in labels:
        if label not in known and not label.upper().endswith(VIRTUAL):
            place = _guess(label)
            if place is not None:
                guessed[label] = place
    legs = _legs(recording, guessed | known)
    for side, leg in legs.items():
        for inner, outer in _ACROSS:
            _by_side(guessed, set(known.values()), leg, (side, inner), (side, outer))
    text = [f"# {len(labels)} labels:"]
    text += [f"#   {label}" + (f"  (guess: {' '.join(guessed[label]).replace('_', ' ')})" if label in guessed else "")
             for label in labels]
    text += ["", "# Started from a recording's own labels: look over every line, above all those marked as guesses.",
            "description: markers of our laboratory", "prefix: any"]
    for block in (*SIDES, "middle"):
        text.append(f"{block}:")
        roles, clusters = ((MIDDLE_ROLES, MIDDLE_CLUSTERS) if block == "middle" else (SIDED_ROLES, SIDED_CLUSTERS))
        for role in roles + clusters:
            sure = [label for label in labels if known.get(label) == (block, role)]
            maybe = [label for label in labels if guessed.get(label) == (block, role)]
            leg = legs.get(block) if role in _PLACES else None
            if leg is not None:
                sure, maybe = (sorted(found, key=lambda label: -leg.score(role, label)) for found in (sure, maybe))
            text.append(_line(role, sure, maybe, several=role in clusters, placed=leg is not None))
    unused = [label for label in labels if label not in known and label not in guessed]
    if unused:
        text.append("# Labels without a role:")
        text += [f"#   {label}" for label in unused]
    return "\n".join(text) + "\n"


@dataclass(frozen=True, eq=False)
class _Leg:
    """A side's markers (m), from its heel ahead along the foot, outward and up."""

    places: dict[str, np.ndarray]

    def score(self, role: str, label: str) -> float:
        """The larger, the likelier is the label that of the role, of several; least where it is never seen."""
        if label not in self.places:
            return -np.inf
        return float(_PLACES[role] @ [*self.places[label], -abs(self.places[label][1])])


def _legs(recording: Recording | None, roles: Mapping[str, tuple[str, str]]) -> dict[str, _Leg]:
    """By side, where labels lie; without a side whose heel or forefoot no label looks like."""
    if recording is None or not recording.markers:
        return {}
    labels = [label.rsplit(":", 1)[-1] for label in recording.markers]
    paths = np.stack(list(recording.markers.values()), axis=1)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", RuntimeWarning)
        middle = np.nanmedian(paths - np.nanmean(paths, axis=1, keepdims=True), axis=0)
    places = {label: place for label, place in zip(labels, middle, strict=True) if np.isfinite(place).all()}

    def mean(side: str, *wanted: str) -> np.ndarray:
        found = [place for label, place in places.items() if label in roles and roles[label][0] == side
                 and (not wanted or roles[label][1] in wanted)]
        return np.mean(found, axis=0) if found else np.full(3, np.nan)

    legs = {}
    for side, other in (SIDES, SIDES[::-1]):
        heel, away = mean(side, "heel"), mean(side) - mean(other)
        ahead = (mean(side, "toe", "toe_tip", "met1", "met5") - heel) * [1.0, 1.0, 0.0]
        outward = np.cross(ahead, [0.0, 0.0, 1.0]) * np.sign(np.cross(ahead, [0.0, 0.0, 1.0]) @ away)
        if np.linalg.norm(ahead) > WIDE_M and outward.any() and np.isfinite(outward).all():
            axes = np.array([ahead, outward, [0.0, 0.0, np.linalg.norm(ahead)]]) / np.linalg.norm(ahead)
            legs[side] = _Leg({label: axes @ (place - heel) for label, place in places.items()})
    return legs


def _by_side(guessed: dict[str, tuple[str, str]], known: set[tuple[str, str]], leg: _Leg, inner: tuple[str, str],
             outer: tuple[str, str]) -> None:
    """Gives labels that look like either side of a joint to the side on which they lie, where they lie apart."""
    pool = {label: leg.places[label][1] for label, place in guessed.items()
            if place in (inner, outer) and label in leg.places}
    numbered = inner[1] == "met1" and {inner, outer} - set(guessed.values())
    if known & {inner, outer} or numbered or not pool or max(pool.values()) - min(pool.values()) < WIDE_M:
        return
    middle = 0.5 * (max(pool.values()) + min(pool.values()))
    guessed |= {label: outer if out > middle else inner for label, out in pool.items()}


def _line(role: str, sure: list[str], maybe: list[str], *, several: bool, placed: bool) -> str:
    chosen = (sure + maybe) if several else (sure or maybe)
    if not chosen:
        return f"  # {role}:"
    remarks = []
    if any(label in maybe for label in chosen):
        way = "" if len(maybe) < 2 else " by its place in this recording" if placed else " by the file's order"
        remarks.append(f"guess{way}" if not several else f"guesses: {', '.join(maybe)}")
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
