"""Marker maps: which label of a recording marks what.

A map is a YAML file with the blocks `right`, `left` and `middle`. Each gives roles (`asis`,
`knee_lateral`, ...) one label or a list of spellings, and clusters (`pelvis`, `thigh`, ...) further
markers that move with the segment. `prefix: any` strips whatever stands before a colon
("Subject01:LASI"). Letter case and punctuation count only where they tell labels.
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
SHIPPED = ("plug_in_gait", "rajagopal", "ior", "opencap")
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

    def places(self) -> dict[str, str]:
        """Role or cluster by spelling."""
        return {
            label: place
            for place, labels in (self.roles | self.clusters).items()
            for label in labels
        }

    def translate(self, labels: Iterable[str], file: str | Path | None = None) -> dict[str, str]:
        """The map's spelling of each label, letter case and punctuation too where that is
        unambiguous; refused where two become one. A marker that lies in a plane is so by its exact
        name alone: any other thigh marker may be called R_Thigh."""
        known = self.places()
        folded: dict[str, list[str]] = {}
        for label, place in known.items():
            for form in {label.casefold(), label if "_plane" in place else _letters(label)}:
                folded.setdefault(form, []).append(label)
        stripped = {
            label: label.rsplit(":", 1)[-1]
            if self.prefix == "any"
            else label.removeprefix(self.prefix)
            for label in labels
        }
        present = set(stripped.values())
        owners: dict[str, str] = {}
        for label, bare in stripped.items():
            alike = folded.get(bare.casefold()) or folded.get(_letters(bare), [])
            one_place = len({known[spelling] for spelling in alike}) == 1
            name = bare
            if one_place and bare not in known and not present & {*alike}:
                name = alike[0]
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


def _letters(label: str) -> str:
    return "".join(ch for ch in label.casefold() if ch.isalnum())


def load_marker_map(name_or_path: str | Path) -> MarkerMap:
    """A shipped map by its name, one of `SHIPPED`, or a user's by its path."""
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
ALIKE = 0.8
COMPUTED = re.compile(
    r"^([lr](fe|ti|fo|to|cl|hu|ra|hn)|pel|hed|trx|csp|sac)[opal]$|jc$|[hka]jc|jointcent|proj"
)
"""In the letters of points that a program adds to the markers, not guessed for anything: axes of
Plug-in Gait's segments (docs.vicon.com/display/Nexus215/Plug-in+Gait+bones), joint centres, and
points projected on the floor."""
WORDS = {
    role: tuple(words.split())
    for role, words in {
        "asis": "asis asi ias iliacanterior fwt",
        "psis": "psis psi ips iliacposterior bwt",
        "trochanter": "trochanter troc gtr gtro gt ftc ft",
        "knee_medial": (
            "kneemed kneem kneeint kneein medknee medialknee mknee femmed condylemed medcon fme "
            "mek mke mfc mfe mepi knm mkn me"
        ),
        "knee_lateral": (
            "kneelat kneel kneeext kneeout latknee lateralknee lknee femlat condylelat latcon knee "
            "fle lek lke lfc lfe lepi kne le"
        ),
        "ankle_medial": (
            "anklemed anklem ankleint anklein medankle mankle malmed medmal mmal tam med mm"
        ),
        "ankle_lateral": (
            "anklelat anklel ankleext ankleout latankle lankle mallat latmal lmal ankle fal ank lm"
        ),
        "heel": "heel calc cal fcc hee ca",
        "toe_tip": "toetip hallux toe toe1 bigtoe",
        "toe": "mt2 met2 mth2 2mt 2met 2mth fm2 fmt2 meta2 2meta smh sm",
        "met1": "mt1 met1 mth1 1mt 1met 1mth fm1 fmt1 meta1 1meta fmh fm toein toemed first",
        "met5": "mt5 met5 mth5 5mt 5met 5mth fm5 fmt5 meta5 5meta vmh vm toeout toelat fifth",
        "thigh": "thigh th femur fem lthi thi thap thad thlp thld",
        "shank": (
            "shank sh1 sh2 sh3 sh4 sk lsha tibia tib calf leg fax ttc shin shn fibula hf fh tt tb "
            "ati tiap tiad tilat"
        ),
        "foot": "foot midfoot heellat heelmed calclat calcmed latfoot nav mfs mfl p1mt p5mt",
        "sacrum": "sacrum sacral sacr sac vsacral",
        "head_top": "tophead headtop vertex thead",
        "pelvis": "iliaccrest crest pelvis ilium",
    }.items()
}
"""What laboratories write, without the side and without punctuation; the longest that a label
starts with counts."""
# after a form of so few letters nothing may follow, or a number in a cluster: RSH1 is a shank,
# RSHO a shoulder
SHORT = 3


def choose_map(recording: Recording) -> tuple[MarkerMap, list[str]]:
    """The one shipped map that finds all needed markers in a standing trial and knows most of its
    labels; a note."""
    fitting: list[tuple[int, MarkerMap, FoundMarkers]] = []
    failing: list[tuple[int, MarkerMap, InputError]] = []
    for marker_map in map(load_marker_map, SHIPPED):
        labels = marker_map.translate(recording.markers, recording.path).values()
        known = len({*marker_map.places()} & {*labels})
        try:
            fitting.append((known, marker_map, marker_map.find(labels, recording.path)))
        except InputError as error:
            failing.append((known, marker_map, error))
    where = "marker_map (--map)"
    if not fitting:
        known, nearest, why = max(failing, key=lambda one: one[0])
        raise InputError(
            "no shipped marker map fits its labels. The nearest, "
            f"{nearest.name}, knows {known} of the {len(recording.markers)}: {why.what}",
            file=recording.path,
            where=where,
            right=why.right,
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
    best, spelled = max(maps, key=lambda pair: len({*pair[0].places()} & {*pair[1].values()}))
    owner = best.places()
    known = {label: _block(owner[bare]) for label, bare in spelled.items() if bare in owner}
    guessed = {
        label: place
        for label in labels
        if label not in known and (place := _guess(label)) is not None
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
    word = _letters(label)
    if COMPUTED.search(word):
        return None
    for role in ("sacrum", "head_top"):
        if word in WORDS[role]:
            return "middle", role
    for side, rest in _sides(label):
        likely = _role(rest)
        if likely is not None:
            return ("middle", likely) if likely in MIDDLE_CLUSTERS else (side, likely)
    return ("middle", "pelvis") if re.fullmatch(r"pelvis\d*", word) else None


def _sides(label: str) -> list[tuple[str, str]]:
    """The sides that a label may be of and its other letters, likelier ones first: a side that
    stands apart in front ("L_Thigh_Rear"), else one that does at the end, counts alone."""
    parts = [part for part in re.split(r"[\W_]+", label.casefold()) if part]
    marks = [*zip(SIDES, SIDES, strict=True), *zip(SIDES, "rl", strict=True)]
    for end, others in ((0, parts[1:]), (-1, parts[:-1])):
        apart = [(side, "".join(others)) for side, mark in marks if parts[end:][:1] == [mark]]
        if apart:
            return apart
    word = "".join(parts)
    return [
        (side, without(word, mark))
        for without in (str.removeprefix, str.removesuffix)
        for side, mark in marks
        if without(word, mark) != word
    ]


def _role(word: str) -> str | None:
    word = word.removesuffix("study")  # of OpenCap's markers that are guessed from videos
    forms = {
        form: role for role in (*ROLES["side"], *MIDDLE_CLUSTERS) for form in WORDS.get(role, ())
    }
    starts = [
        (len(form), role)
        for form, role in forms.items()
        if word == form
        or (word.startswith(form) and len(form) > SHORT)
        or (role in SIDED_CLUSTERS and re.fullmatch(rf"{form}\d+", word))
    ]
    if starts or len(word) <= SHORT:
        return max(starts)[1] if starts else None
    long = [form for form in forms if len(form) > SHORT]
    close = difflib.get_close_matches(word, long, n=1, cutoff=ALIKE)
    return forms[close[0]] if close else None
