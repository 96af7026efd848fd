"""Marker maps: which label of a recording marks what.

A map is a YAML file with the blocks `right`, `left` and `middle`. Each gives roles (`asis`,
`knee_lateral`, ...) one label or a list of spellings, and clusters (`pelvis`, `thigh`, ...) further
markers that move with the segment. `prefix: any` strips whatever stands before a colon
("Subject01:LASI"). Letter case counts only where it tells labels.
"""

from __future__ import annotations

import dataclasses
import difflib
import re
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

from vsf_drake.base.errors import InputError, require
from vsf_drake.base.files import resource, user_path
from vsf_drake.base.schema import load_yaml
from vsf_drake.base.sentences import say
from vsf_drake.motion.formats.recording import SIDES, Recording
from vsf_drake.motion.formats.units import listed
from vsf_drake.motion.markers.segments import SEGMENTS

SIDED_CLUSTERS = ("thigh", "shank", "foot")
MIDDLE_CLUSTERS = ("pelvis",)
SEGMENT_ROLES = {
    "pelvis": ("asis", "psis"),
    "thigh": ("thigh_plane", "trochanter", "knee_lateral", "knee_medial"),
    "shank": ("shank_plane", "ankle_lateral", "ankle_medial"),
    "foot": ("heel", "toe", "met1", "met5", "toe_tip"),
}
"""The roles whose markers move with each segment. `toe` is the second metatarsal head;
`thigh_plane` and `shank_plane` lie, as Plug-in Gait's THI and TIB do, in the plane of proximal
joint centre, lateral marker and distal joint centre."""
ROLES = {
    "side": (
        "asis",  # anterior superior iliac spine
        "psis",  # posterior superior iliac spine
        "trochanter",  # greater trochanter
        "knee_lateral",  # lateral femoral epicondyle
        "knee_medial",  # medial femoral epicondyle
        "ankle_lateral",  # lateral malleolus
        "ankle_medial",  # medial malleolus
        "heel",  # rear of the heel
        "toe",  # second metatarsal head
        "met1",  # first metatarsal head
        "met5",  # fifth metatarsal head
        "toe_tip",  # tip of the toes
        "thigh_plane",  # in the plane of hip centre, lateral knee marker and knee centre
        "shank_plane",  # in the plane of knee centre, lateral ankle marker and ankle centre
        *SIDED_CLUSTERS,  # further markers that move with the segment
    ),
    "middle": (
        "sacrum",  # midway between the PSIS, in their place
        "head_top",  # top of the head
        *MIDDLE_CLUSTERS,  # further markers that move with the pelvis
    ),
}
"""What a map's blocks may give labels to."""
SHIPPED = ("plug_in_gait", "rajagopal", "ior")
Labels = tuple[str, ...]
_Side, _Middle = (
    dataclasses.make_dataclass(
        name, [(role, Labels, ()) for role in roles], frozen=True, kw_only=True
    )
    for name, roles in ROLES.items()
)


@dataclass(frozen=True, kw_only=True)
class _MapFile:
    description: str | None = None  # of the marker set, in words
    prefix: str | None = "any"  # text before each label to strip; any: up to a colon
    right: _Side | None = None  # type: ignore[valid-type]
    """labels of the right side, by role"""
    left: _Side | None = None  # type: ignore[valid-type]
    """labels of the left side, by role"""
    middle: _Middle | None = None  # type: ignore[valid-type]
    """labels in the midline, by role"""


@dataclass(frozen=True)
class FoundMarkers:
    """What a map finds in a recording."""

    roles: dict[str, str]  # label by role and side ("asis_right", "sacrum"), those present
    segments: dict[str, Labels]
    """labels by segment ("pelvis", "thigh_right", ...), roles and clusters, each once"""


@dataclass(frozen=True)
class MarkerMap:
    """Spellings by role and further markers by segment."""

    path: Path
    roles: dict[str, Labels]  # by "asis_right", "sacrum", ...
    clusters: dict[str, Labels]  # by "thigh_right", "pelvis", ...
    prefix: str = "any"  # or "" (none), or the text to strip

    @property
    def name(self) -> str:
        return self.path.stem

    def spellings(self) -> set[str]:
        return {
            label for labels in (*self.roles.values(), *self.clusters.values()) for label in labels
        }

    def translate(self, labels: Iterable[str], file: str | Path | None = None) -> dict[str, str]:
        """The map's spelling of each label, letter case too where that is unambiguous; refused
        where two become one."""
        known = self.spellings()
        folded: dict[str, list[str]] = {}
        for label in known:
            folded.setdefault(label.casefold(), []).append(label)
        stripped = {
            label: label.rsplit(":", 1)[-1]
            if self.prefix == "any"
            else label.removeprefix(self.prefix)
            for label in labels
        }
        present = set(stripped.values())
        owners: dict[str, str] = {}
        for label, bare in stripped.items():
            alike = folded.get(bare.casefold(), [])
            name = (
                alike[0]
                if len(alike) == 1 and bare not in known and alike[0] not in present
                else bare
            )
            if name in owners:
                raise InputError(
                    f"{owners[name]} and {label} are both {name}",
                    file=file,
                    where=f"marker {name}",
                    right="With two people in a file, say in a marker map whose prefix counts",
                )
            owners[name] = label
        return {label: name for name, label in owners.items()}

    def rename(self, recording: Recording) -> Recording:
        """`recording` with its labels in the map's spelling."""
        names = self.translate(recording.markers, recording.path)
        return dataclasses.replace(
            recording, markers={names[k]: v for k, v in recording.markers.items()}
        )

    def find(self, labels: Iterable[str], file: str | Path | None = None) -> FoundMarkers:
        """The markers of a standing trial, by role and segment; `labels` in the map's spelling.

        Refused where a role has two candidates, or one that every calibration needs has none.
        """
        present = dict.fromkeys(labels)
        roles: dict[str, str] = {}
        for role, spellings in self.roles.items():
            here = [s for s in spellings if s in present]
            require(
                len(here) < 2,
                f"{' and '.join(here)} both look like {role.replace('_', ' ')}",
                f"marker map {self.path}",
                "Give this role one label in a map of your own",
                file=file,
            )
            if here:
                roles[role] = here[0]
        self._require(roles, list(present), file)
        segments: dict[str, Labels] = {}
        for key in SEGMENTS:
            kind, _, side = key.partition("_")
            wanted = [
                roles.get(f"{role}_{s}")
                for s in ([side] if side else SIDES)
                for role in SEGMENT_ROLES[kind]
            ]
            wanted += [roles.get("sacrum")] if kind == "pelvis" else []
            wanted += [label for label in self.clusters.get(key, ()) if label in present]
            segments[key] = tuple(dict.fromkeys(label for label in wanted if label))
        return FoundMarkers(roles, segments)

    def _require(self, roles: dict[str, str], labels: list[str], file: str | Path | None) -> None:
        missing: list[Labels] = [
            (key,)
            for role in ("asis", "knee_lateral", "ankle_lateral", "heel")
            for side in SIDES
            if (key := f"{role}_{side}") not in roles
        ]
        if "sacrum" not in roles and not all(f"psis_{side}" in roles for side in SIDES):
            missing.append(("psis_right", "psis_left", "sacrum"))
        missing += [
            (f"toe_{side}", f"toe_tip_{side}")
            for side in SIDES
            if not (
                {f"met1_{side}", f"met5_{side}"} <= {*roles}
                or {f"toe_{side}", f"toe_tip_{side}"} & {*roles}
            )
        ]
        if not missing:
            return
        names = [" or ".join(role.replace("_", " ") for role in group) for group in missing]
        spellings = [s for group in missing for role in group for s in self.roles.get(role, ())]
        near = {s: difflib.get_close_matches(s, labels, n=2, cutoff=0.6) for s in spellings}
        hints = [f"{s} (like {', '.join(alike)})" for s, alike in near.items() if alike]
        sought = ", ".join(hints or spellings) or "no label, for the map names none"
        raise InputError(
            f"no marker for {'; '.join(names)}",
            file=file,
            where=f"marker map {self.path}",
            right=f"Labels in the file: {listed(labels)}. Sought: {sought}. "
            "`vsf-drake import --list-markers` starts a map from the file's own labels",
        )


def load_marker_map(name_or_path: str | Path) -> MarkerMap:
    """A shipped map by its name ("plug_in_gait", "rajagopal", "ior") or a user's by its path."""
    shipped = str(name_or_path) in SHIPPED
    path = (
        resource(f"models/marker_maps/{name_or_path}.yaml") if shipped else user_path(name_or_path)
    )
    content = load_yaml(
        path,
        _MapFile,
        right=f"Shipped marker maps are {', '.join(SHIPPED)}; any other is the path of a file",
    )
    places = {
        f"{role}{side}": labels
        for side, block in (
            ("_right", content.right),
            ("_left", content.left),
            ("", content.middle),
        )
        if block is not None
        for role, labels in vars(block).items()
        if labels
    }
    owners: dict[str, str] = {}
    for role, labels in places.items():
        for label in labels:
            require(label.strip(), "must be a label or a list of labels", role, file=path)
            if label in owners:
                raise InputError(
                    f"stands for {owners[label]} and for {role}",
                    file=path,
                    where=f"label {label}",
                    right="A marker has one place on one segment",
                )
            owners[label] = role
    clusters = {
        role: labels
        for role, labels in places.items()
        if _block(role)[1] in SIDED_CLUSTERS + MIDDLE_CLUSTERS
    }
    roles = {role: labels for role, labels in places.items() if role not in clusters}
    return MarkerMap(path, roles, clusters, content.prefix or "")


def _block(role: str) -> tuple[str, str]:
    """Block and name of a role: ("right", "asis") for asis_right, ("middle", "sacrum") for
    sacrum."""
    name, _, side = role.rpartition("_")
    return (side, name) if side in SIDES else ("middle", role)


# Which shipped map fits a recording's labels, and a first map of a recording's own.


# least similarity (difflib's ratio) of a label to a known spelling for a guess (a choice)
ALIKE = 0.75
# endings of computed points beside the markers, not guessed for anything
VIRTUAL = ("HJC", "KJC", "AJC")
WORDS = {
    role: tuple(words.split())
    for role, words in {
        "asis": "asis asi ias iliacanterior",
        "psis": "psis psi ips iliacposterior",
        "trochanter": "trochanter troc gtr ftc",
        "knee_medial": (
            "kneemed kneem kneeint medknee medialknee mknee femmed condylemed medcon fme mek"
        ),
        "knee_lateral": (
            "kneelat kneel kneeext latknee lateralknee lknee femlat condylelat latcon knee fle lek"
        ),
        "ankle_medial": "anklemed anklem ankleint medankle mankle malmed medmal mmal tam",
        "ankle_lateral": "anklelat anklel ankleext latankle lankle mallat latmal lmal ankle fal",
        "heel": "heel calc cal fcc",
        "toe_tip": "toetip hallux toe",
        "toe": "mt2 met2 mth2 2mt 2met 2mth fm2 fmt2",
        "met1": "mt1 met1 mth1 1mt 1met 1mth fm1 fmt1",
        "met5": "mt5 met5 mth5 5mt 5met 5mth fm5 fmt5",
        "thigh": "thigh th femur fem lthi",
        "shank": "shank sh sk lsha tibia tib calf leg fax ttc",
        "foot": "foot midfoot",
        "sacrum": "sacrum sacral sacr sac",
        "head_top": "tophead headtop vertex",
        "pelvis": "iliaccrest crest pelvis",
    }.items()
}
"""What laboratories write, without the side and without punctuation; the longest that a label
starts with counts."""
# after a form of so few letters only a number may follow: RSH1 is a shank, RSHO a shoulder
SHORT = 3


def choose_map(recording: Recording) -> tuple[MarkerMap, list[str]]:
    """The one shipped map that finds all needed markers in a standing trial and knows most of its
    labels; a note."""
    fitting: list[tuple[int, MarkerMap, FoundMarkers]] = []
    failing: list[tuple[int, InputError]] = []
    for marker_map in map(load_marker_map, SHIPPED):
        labels = marker_map.translate(recording.markers, recording.path).values()
        known = len(marker_map.spellings() & set(labels))
        try:
            fitting.append((known, marker_map, marker_map.find(labels, recording.path)))
        except InputError as error:
            failing.append((known, error))
    where = "marker_map (--map)"
    if not fitting:
        known, nearest = max(failing, key=lambda pair: pair[0])
        if 2 * known >= len(recording.markers):
            raise nearest
        raise InputError(
            "no shipped marker map fits its labels: " + listed(list(recording.markers)),
            file=recording.path,
            where=where,
            right=(
                "Write a map: `vsf-drake import --list-markers` starts one from the file's own "
                "labels"
            ),
        )
    most = max(known for known, _, _ in fitting)
    best = [(marker_map, markers) for known, marker_map, markers in fitting if known == most]
    require(
        all(markers == best[0][1] for _, markers in best),
        f"the marker maps {' and '.join(m.name for m, _ in best)} fit equally well",
        where,
        "Say which one",
        file=recording.path,
    )
    return best[0][0], say(
        "markers", "chosen_map", name=best[0][0].name, known=most, labels=len(recording.markers)
    )


def suggest_map(labels: Iterable[str]) -> str:
    """YAML text of a marker map for these labels, to be looked over; comments list the labels.

    Labels that a shipped map knows are taken from there, others by what they look like, marked as
    guesses; of several for one role the first stands. Roles without a label stand in comments,
    labels without a role at the end.
    """
    labels = list(dict.fromkeys(label.rsplit(":", 1)[-1] for label in labels))
    maps = [
        (marker_map, marker_map.translate(labels)) for marker_map in map(load_marker_map, SHIPPED)
    ]
    best, spelled = max(maps, key=lambda pair: len(pair[0].spellings() & set(pair[1].values())))
    owner = {
        label: role
        for role, spellings in (best.roles | best.clusters).items()
        for label in spellings
    }
    known = {label: _block(owner[bare]) for label, bare in spelled.items() if bare in owner}
    guessed = {
        label: place
        for label in labels
        if label not in known
        and not label.upper().endswith(VIRTUAL)
        and (place := _guess(label)) is not None
    }
    text = [f"# {len(labels)} labels:"]
    text += [
        f"#   {label}"
        + (f"  (guess: {' '.join(guessed[label]).replace('_', ' ')})" if label in guessed else "")
        for label in labels
    ]
    text += [
        "",
        (
            "# Started from a recording's own labels: look over every line, above all those marked "
            "as guesses."
        ),
        "description: markers of our laboratory",
        "prefix: any",
    ]
    for block in (*SIDES, "middle"):
        text.append(f"{block}:")
        for role in ROLES.get(block, ROLES["side"]):
            sure = [label for label in labels if known.get(label) == (block, role)]
            maybe = [label for label in labels if guessed.get(label) == (block, role)]
            text.append(_line(role, sure, maybe))
    unused = [label for label in labels if label not in known and label not in guessed]
    if unused:
        text += ["# Labels without a role:", *(f"#   {label}" for label in unused)]
    return "\n".join(text) + "\n"


def _line(role: str, sure: list[str], maybe: list[str]) -> str:
    several = role in SIDED_CLUSTERS + MIDDLE_CLUSTERS
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
    quoted = (
        label
        if re.fullmatch(r"[A-Za-z][\w.]*", label, re.ASCII)
        else "'" + label.replace("'", "''") + "'"
        for label in (chosen if several else chosen[:1])
    )
    value = ", ".join(quoted)
    return f"  {role}: {f'[{value}]' if several else value}" + (
        f"  # {'; '.join(remarks)}" if remarks else ""
    )


def _guess(label: str) -> tuple[str, str] | None:
    word = "".join(ch for ch in label.casefold() if ch.isalnum())
    for role in ("sacrum", "head_top"):
        if word in WORDS[role]:
            return "middle", role
    for side in SIDES:
        for mark in (side, side[0]):
            rests = [
                rest for rest in (word.removeprefix(mark), word.removesuffix(mark)) if rest != word
            ]
            likely = next(filter(None, map(_role, rests)), None)
            if likely is not None:
                return ("middle", likely) if likely in MIDDLE_CLUSTERS else (side, likely)
    return None


def _role(word: str) -> str | None:
    starts = [
        (len(form), role)
        for role, forms in WORDS.items()
        for form in forms
        if word.startswith(form)
        and (len(form) > SHORT or not word[len(form) :].strip("0123456789"))
    ]
    if starts:
        return max(starts)[1]
    long = [form for forms in WORDS.values() for form in forms if len(form) > SHORT]
    close = difflib.get_close_matches(word, long, n=1, cutoff=ALIKE)
    return next((role for role, forms in WORDS.items() if close and close[0] in forms), None)
