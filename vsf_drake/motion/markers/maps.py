"""Marker maps: which label of a recording marks what.

A map is a YAML file with the blocks `right`, `left` and `middle`. Each gives roles (`asis`, `knee_lateral`, ...) one
label or a list of spellings, and clusters (`pelvis`, `thigh`, `shank`, `foot`) a list of further markers that move with
the segment. `prefix: any` strips whatever stands before a colon ("Subject01:LASI"), `prefix: "Subject01:"` just
that. Where no label is spelled alike, letter case is disregarded.
"""

from __future__ import annotations

import dataclasses
import difflib
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

import yaml

from vsf_drake.errors import InputError
from vsf_drake.files import read_text, user_path
from vsf_drake.motion.formats.labels import listed
from vsf_drake.motion.formats.recording import Recording
from vsf_drake.resources import resource
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
