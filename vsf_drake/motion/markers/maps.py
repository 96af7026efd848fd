"""Marker maps: which label of a recording marks what.

A map is a YAML file with the blocks `right`, `left` and `middle`. Each gives roles (`asis`, `knee_lateral`, ...) one
label or a list of spellings, and clusters (`pelvis`, `thigh`, `shank`, `foot`) a list of further markers that move with
the segment. `prefix: any` strips whatever stands before a colon ("Subject01:LASI"), `prefix: "Subject01:"` just
that. Where no label is spelled alike, letter case is disregarded.
"""

from __future__ import annotations

import dataclasses
import difflib
import warnings
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import yaml

from vsf_drake.errors import InputError
from vsf_drake.files import read_text, resource, user_path
from vsf_drake.motion.formats.recording import Recording
from vsf_drake.motion.formats.text import listed
from vsf_drake.yaml_file import MOST_BYTES, parse_yaml

SIDED_ROLES = ("asis", "psis", "trochanter", "knee_lateral", "knee_medial", "ankle_lateral", "ankle_medial", "heel",
               "toe", "met1", "met5", "toe_tip", "thigh_plane", "shank_plane")
"""`toe` is the second metatarsal head; `thigh_plane` and `shank_plane` lie, as Plug-in Gait's THI and TIB do, in the
plane of the proximal joint centre, the lateral marker and the distal joint centre."""
SIDED_CLUSTERS = ("thigh", "shank", "foot")
MIDDLE_ROLES, MIDDLE_CLUSTERS = ("sacrum", "head_top"), ("pelvis",)
SIDES = ("right", "left")
SEGMENT_ROLES = {
    "pelvis": ("asis", "psis"), "thigh": ("thigh_plane", "trochanter", "knee_lateral", "knee_medial"),
    "shank": ("shank_plane", "ankle_lateral", "ankle_medial"), "foot": ("heel", "toe", "met1", "met5", "toe_tip")}
"""The roles whose markers move with each segment."""
SHIPPED = ("plug_in_gait", "rajagopal", "ior")


@dataclass(frozen=True)
class FoundMarkers:
    """What a map finds in a recording.

    Attributes:
        roles: label by role and side ("asis_right", "sacrum"), those present.
        segments: labels by segment ("pelvis", "thigh_right", ...), roles and clusters, each once.
    """

    roles: dict[str, str]
    segments: dict[str, tuple[str, ...]]


@dataclass(frozen=True)
class MarkerMap:
    """Spellings by role ("asis_right", "sacrum") and further markers by segment ("thigh_right", "pelvis").

    `path` is the file; `prefix` is "any", "" (none) or the text to strip.
    """

    name: str
    path: Path
    roles: dict[str, tuple[str, ...]]
    clusters: dict[str, tuple[str, ...]]
    prefix: str = "any"

    def spellings(self) -> set[str]:
        """All labels that the map knows."""
        return {label for labels in (*self.roles.values(), *self.clusters.values()) for label in labels}

    def translate(self, labels: Iterable[str], file: str | Path | None = None) -> dict[str, str]:
        """The map's spelling of each label: prefix stripped, letter case as in the map where that is unambiguous.

        Raises:
            InputError: two labels become one.
        """
        known = self.spellings()
        folded: dict[str, list[str]] = {}
        for label in known:
            folded.setdefault(label.casefold(), []).append(label)
        stripped = {label: self._strip(label) for label in labels}
        present = set(stripped.values())
        result: dict[str, str] = {}
        for label, bare in stripped.items():
            alike = folded.get(bare.casefold(), [])
            fits = len(alike) == 1 and bare not in known and alike[0] not in present
            result[label] = alike[0] if fits else bare
        self._refuse_doubles(result, file)
        return result

    def rename(self, recording: Recording) -> Recording:
        """`recording` with its labels in the map's spelling, so that a calibration's labels fit every trial.

        Raises:
            InputError: two labels become one.
        """
        names = self.translate(recording.markers, recording.path)
        if all(old == new for old, new in names.items()):
            return recording
        return dataclasses.replace(recording, markers={names[k]: v for k, v in recording.markers.items()})

    def find(self, labels: Iterable[str], file: str | Path | None = None) -> FoundMarkers:
        """The markers of a standing trial, by role and segment; `labels` in the map's spelling.

        Raises:
            InputError: a role has two candidates or a required one none.
        """
        labels = list(labels)
        present = set(labels)
        roles: dict[str, str] = {}
        for role, spellings in self.roles.items():
            here = [s for s in spellings if s in present]
            if len(here) > 1:
                raise InputError(f"{' and '.join(here)} both look like {role.replace('_', ' ')}", file=file,
                                 where=f"marker map {self.path}", right="Give this role one label in a map of your own")
            if here:
                roles[role] = here[0]
        _require(roles, self, labels, file)
        segments: dict[str, tuple[str, ...]] = {}
        for segment, side in _segment_sides():
            key = f"{segment}_{side}" if side else segment
            wanted = [roles.get(f"{role}_{s}") for s in ((side,) if side else SIDES) for role in SEGMENT_ROLES[segment]]
            wanted += [roles.get("sacrum")] if segment == "pelvis" else []
            wanted += [label for label in self.clusters.get(key, ()) if label in present]
            segments[key] = tuple(dict.fromkeys(label for label in wanted if label))
        return FoundMarkers(roles, segments)

    def _strip(self, label: str) -> str:
        if self.prefix == "any":
            return label.rsplit(":", 1)[-1]
        return label.removeprefix(self.prefix) if self.prefix else label

    def _refuse_doubles(self, names: dict[str, str], file: str | Path | None) -> None:
        seen: dict[str, str] = {}
        for old, new in names.items():
            if new in seen:
                raise InputError(f"{seen[new]} and {old} are both {new}", file=file, where=f"marker {new}",
                                 right="With two people in a file, say in a marker map whose prefix counts")
            seen[new] = old


def load_marker_map(name_or_path: str | Path) -> MarkerMap:
    """A shipped map by its name ("plug_in_gait", "rajagopal", "ior") or a user's by its path.

    Raises:
        InputError: there is no such map, or it is not one.
    """
    shipped = str(name_or_path) in SHIPPED
    path = resource(f"models/marker_maps/{name_or_path}.yaml") if shipped else user_path(name_or_path)
    right = f"Shipped marker maps are {', '.join(SHIPPED)}; any other is the path of a file"
    return parse_marker_map(read_text(path, most=MOST_BYTES, right=right), path)


def parse_marker_map(text: str, path: str | Path) -> MarkerMap:
    """The map that the YAML `text` of the file `path` describes.

    Raises:
        InputError: not YAML, an unknown or doubled key, a value that is neither a label nor a list of labels, a label
            that stands for two things.
    """
    path = Path(path)
    root = parse_yaml(text, path)
    roles: dict[str, tuple[str, ...]] = {}
    clusters: dict[str, tuple[str, ...]] = {}
    prefix = "any"
    for _, key, node in _items(root, "", path, ("description", "prefix", *SIDES, "middle")):
        if key == "prefix":
            prefix = _labels(node, key, path, empty=True)[0]
        elif key != "description":
            kinds = (MIDDLE_ROLES, MIDDLE_CLUSTERS) if key == "middle" else (SIDED_ROLES, SIDED_CLUSTERS)
            for block, role, value in _items(node, f"{key}.", path, kinds[0] + kinds[1]):
                target = clusters if role in kinds[1] else roles
                target[role if key == "middle" else f"{role}_{key}"] = _labels(value, block + role, path)
    owners: dict[str, str] = {}
    for role, labels in (*roles.items(), *clusters.items()):
        for label in labels:
            if label in owners:
                raise InputError(f"stands for {owners[label]} and for {role}", file=path, where=f"label {label}",
                                 right="A marker has one place on one segment")
            owners[label] = role
    return MarkerMap(name=path.stem, path=path, roles=roles, clusters=clusters, prefix=prefix)


def _items(node: yaml.Node | None, block: str, path: Path, known: tuple[str, ...]) -> list[tuple[str, str, yaml.Node]]:
    if block and node is not None and node.tag == "tag:yaml.org,2002:null":
        return []
    if not isinstance(node, yaml.MappingNode):
        raise InputError("must be a mapping of keys to values", file=path, where=block.rstrip(".") or None,
                         right=f"Its keys are: {', '.join(known)}")
    items: dict[str, yaml.Node] = {}
    for key_node, value in node.value:
        key, where = str(key_node.value), f"line {key_node.start_mark.line + 1}, {block}{key_node.value}"
        if key not in known:
            near = difflib.get_close_matches(key, known, n=1)
            raise InputError("unknown key", file=path, where=where,
                             right=f"Did you mean {near[0]}?" if near else f"Known keys are: {', '.join(known)}")
        if key in items:
            raise InputError("the key stands twice", file=path, where=where)
        items[key] = value
    return [(block, key, value) for key, value in items.items()]


def _labels(node: yaml.Node, key: str, path: Path, *, empty: bool = False) -> tuple[str, ...]:
    nodes = node.value if isinstance(node, yaml.SequenceNode) else [node]
    labels = tuple(str(n.value).strip() if isinstance(n, yaml.ScalarNode) else "" for n in nodes)
    if not labels or not (all(labels) or empty) or (empty and not isinstance(node, yaml.ScalarNode)):
        raise InputError("must be a label or a list of labels", file=path,
                         where=f"line {node.start_mark.line + 1}, {key}")
    return labels


def _segment_sides() -> list[tuple[str, str]]:
    return [("pelvis", "")] + [(segment, side) for side in SIDES for segment in SIDED_CLUSTERS]


def _require(roles: dict[str, str], marker_map: MarkerMap, labels: list[str], file: str | Path | None) -> None:
    """Refuses a standing trial in which a marker that every calibration needs has no label."""
    wanted = [(f"{role}_{side}",) for role in ("asis", "knee_lateral", "ankle_lateral", "heel") for side in SIDES]
    missing = [group for group in wanted if group[0] not in roles]
    if "sacrum" not in roles and not all(f"psis_{side}" in roles for side in SIDES):
        missing.append(("psis_right", "psis_left", "sacrum"))
    for side in SIDES:
        mets = all(f"{met}_{side}" in roles for met in ("met1", "met5"))
        if not mets and not any(f"{toe}_{side}" in roles for toe in ("toe", "toe_tip")):
            missing.append((f"toe_{side}", f"toe_tip_{side}"))
    if not missing:
        return
    names = [" or ".join(role.replace("_", " ") for role in group) for group in missing]
    spellings = [s for group in missing for role in group for s in marker_map.roles.get(role, ())]
    near = {s: difflib.get_close_matches(s, labels, n=2, cutoff=0.6) for s in spellings}
    hints = [f"{s} (like {', '.join(found)})" for s, found in near.items() if found]
    sought = ", ".join(hints or spellings) or "no label, for the map names none"
    right = f"Labels in the file: {listed(list(labels))}. Sought: {sought}. "
    raise InputError(f"no marker for {'; '.join(names)}", file=file, where=f"marker map {marker_map.path}",
                     right=right + "`vsf-drake import --list-markers` starts a map from the file's own labels")


# Which shipped map fits a recording's labels, and a first map of a recording's own.


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
