"""Whether the markers of a standing trial are where their labels say: exchanged ones show by geometry."""

from __future__ import annotations

from itertools import combinations, pairwise
from pathlib import Path

import numpy as np

from vsf_drake.errors import InputError
from vsf_drake.motion.markers.handedness import facing, typical
from vsf_drake.motion.markers.maps import SIDES, FoundMarkers
from vsf_drake.motion.markers.posture import Posture, forefoot_labels

ASTRAY_M = 0.05
"""A marker that is this much nearer to another thigh or shank than to its own is on the other one (a choice)."""
SAME_PLACE_M = 1e-3
"""No two markers are nearer to each other than their own size; a millimetre is the same one twice."""
ASKEW_RAD = np.radians(45.0)
"""The lines over both ASIS and over both PSIS are nearly parallel, and the former nearly level (a choice)."""
LEAST_RATIO, MOST_RATIO = 0.65, 1.6
"""Thigh / shank; people have about 0.8 to 1.1 (de Leva 1996: 0.84 women, 0.96 men), prosthetic shanks aside (a
choice)."""
_RIGHT = "Check the labels of these markers, or the marker map"


def check_labels(posture: Posture, found: FoundMarkers, file: str | Path) -> None:
    """Refuses exchanged labels.

    Forward is from the back of the pelvis to the ASIS, up is up, left follows. Over the frames of a walk the medians
    count.

    Raises:
        InputError: feet point backwards, left is not left of right, a leg's joints are not one below the other, a
            medial marker is outside a lateral one, or a marker lies on another segment.
    """
    _Checker(posture, found, file).run()


class _Checker:
    def __init__(self, posture: Posture, found: FoundMarkers, file: str | Path) -> None:
        self.points, self.roles, self.found, self.file = posture.points, found.roles, found, file
        self.places()
        front = self.middle("asis")
        self.forward = facing(front, self.middle("psis") if "psis_right" in self.roles and "psis_left" in self.roles
                              else self.at("sacrum"))
        self.left = np.cross([0.0, 0.0, 1.0], self.forward)

    def at(self, role: str) -> np.ndarray:
        return self.points[self.roles[role]]

    def middle(self, role: str) -> np.ndarray:
        return 0.5 * (self.at(f"{role}_right") + self.at(f"{role}_left"))

    def forefoot(self, side: str) -> np.ndarray:
        return np.mean([self.points[label] for label in forefoot_labels(self.found, side)], axis=0)

    def refuse(self, what: str, labels: list[str], right: str = _RIGHT) -> None:
        raise InputError(what, file=self.file, where=f"markers {', '.join(labels)}", right=right)

    def run(self) -> None:
        self.pelvis()
        self.facing()
        self.sides()
        self.heights()
        self.medial()
        self.segments()

    def places(self) -> None:
        labels = [label for label in dict.fromkeys(self.roles.values()) if label in self.points]
        for a, b in combinations(labels, 2):
            apart = np.linalg.norm(self.points[a] - self.points[b], axis=1)
            apart = apart[np.isfinite(apart)]
            if len(apart) and np.median(apart) < SAME_PLACE_M:
                self.refuse("lie in the same place", [a, b], "Each marker has one label; look for a doubled trajectory")

    def pelvis(self) -> None:
        across = self.at("asis_left") - self.at("asis_right")
        slope = float(np.nanmedian(np.arcsin(np.abs(across[:, 2]) / np.linalg.norm(across, axis=1))))
        if slope > ASKEW_RAD:
            self.refuse(f"one ASIS is far above the other: the line over both slopes by {np.degrees(slope):.0f} "
                        "degrees", [self.roles[f"asis_{side}"] for side in SIDES])
        roles = [f"{role}_{side}" for role in ("asis", "psis") for side in SIDES]
        if any(role not in self.roles for role in roles):
            return
        front = self.at("asis_left") - self.at("asis_right")
        back = self.at("psis_left") - self.at("psis_right")
        lengths = np.linalg.norm(front, axis=1) * np.linalg.norm(back, axis=1)
        cosine = float(np.nanmedian(np.sum(front * back, axis=1) / lengths))
        if abs(cosine) < np.cos(ASKEW_RAD):
            self.refuse(f"the line over both ASIS and that over both PSIS make an angle of "
                        f"{np.degrees(np.arccos(cosine)):.0f} degrees: an ASIS and a PSIS seem exchanged",
                        [self.roles[role] for role in roles])

    def facing(self) -> None:
        ahead = {}
        for side in SIDES:
            ahead[side] = typical(self.forefoot(side) - self.at(f"heel_{side}"), self.forward)
        backwards = [side for side in SIDES if ahead[side] < 0]
        if len(backwards) == len(SIDES):
            labels = [self.roles[role] for role in ("asis_right", "asis_left", "psis_right", "psis_left", "sacrum")
                      if role in self.roles]
            self.refuse("both feet point backwards: front and back of the pelvis seem exchanged (or heel and toe of "
                        "both feet)", labels)
        for side in backwards:
            self.refuse("the foot points backwards: heel and toe seem exchanged",
                        [self.roles[f"heel_{side}"], *forefoot_labels(self.found, side)])
        for side in SIDES:
            heel, ankle = self.at(f"heel_{side}"), self.at(f"ankle_lateral_{side}")
            along = facing(self.forefoot(side), heel)
            if typical(ankle - heel, along) < 0:
                self.refuse("the ankle is behind the heel",
                            [self.roles[f"ankle_lateral_{side}"], self.roles[f"heel_{side}"]])
            if typical(self.forefoot(side) - ankle, along) < 0:
                self.refuse("the ankle is ahead of the forefoot",
                            [self.roles[f"ankle_lateral_{side}"], *forefoot_labels(self.found, side)])

    def sides(self) -> None:
        pairs = [role.removesuffix("_right") for role in self.roles if role.endswith("_right")]
        pairs = [role for role in pairs if f"{role}_left" in self.roles and self.seen(role)]
        wrong = [role for role in pairs
                 if typical(self.at(f"{role}_left") - self.at(f"{role}_right"), self.left) < 0]
        if wrong:
            self.refuse("left and right seem exchanged",
                        [self.roles[f"{role}_{side}"] for role in wrong for side in SIDES])

    def seen(self, role: str) -> bool:
        return all(self.roles[f"{role}_{side}"] in self.points for side in SIDES)

    def heights(self) -> None:
        for side in SIDES:
            chain = [f"{role}_{side}" for role in ("asis", "knee_lateral", "ankle_lateral")]
            for upper, lower in pairwise(chain):
                if typical(self.at(upper) - self.at(lower), np.array([0.0, 0.0, 1.0])) < 0:
                    self.refuse(f"the {_words(upper)} is below the {_words(lower)}",
                                [self.roles[upper], self.roles[lower]])

    def medial(self) -> None:
        for side, out in (("right", -1.0), ("left", 1.0)):
            pairs = ("knee_medial", "knee_lateral"), ("ankle_medial", "ankle_lateral"), ("met1", "met5")
            for medial, lateral in ((f"{inner}_{side}", f"{outer}_{side}") for inner, outer in pairs):
                if medial in self.roles and lateral in self.roles and typical(
                        self.at(lateral) - self.at(medial), out * self.left) < 0:
                    self.refuse(f"the {_words(medial)} is outside the {_words(lateral)}",
                                [self.roles[medial], self.roles[lateral]])

    def segments(self) -> None:
        """Every marker of a thigh or shank is nearest to its own, all four taken as straight lines."""
        lines, spans = {}, {}
        for side in SIDES:
            knee, ankle = (self.at(f"{joint}_lateral_{side}") for joint in ("knee", "ankle"))
            names = [self.roles[f"{role}_{side}"] for role in ("asis", "knee_lateral", "ankle_lateral")]
            spans |= {f"thigh_{side}": names[:2], f"shank_{side}": names[1:]}
            lines |= {f"thigh_{side}": (self.at(f"asis_{side}"), knee), f"shank_{side}": (knee, ankle)}
        for segment in lines:
            for label in self.found.segments[segment]:
                if label not in self.points:
                    continue
                away = {name: float(np.nanmedian(_distance(self.points[label], *line))) for name, line in lines.items()}
                nearest = min(away, key=lambda name: away[name])
                if away[segment] > away[nearest] + ASTRAY_M:
                    self.refuse(f"{label} lies {1e3 * away[nearest]:.0f} mm from the {_words(nearest)} and "
                                f"{1e3 * away[segment]:.0f} mm from the {_words(segment)} to which the map gives it",
                                list(dict.fromkeys((label, *spans[segment]))),
                                f"Check {label} and the markers that span this segment")


def check_proportions(lengths_m: dict[str, float], found: FoundMarkers, file: str | Path) -> None:
    """Refuses a thigh far too short or too long for its shank: a knee or ankle marker is not at its joint.

    Raises:
        InputError: names hip, knee and ankle markers.
    """
    for side in SIDES:
        thigh, shank = lengths_m[f"thigh_{side}"], lengths_m[f"shank_{side}"]
        if not LEAST_RATIO * shank < thigh < MOST_RATIO * shank:
            labels = [found.roles[f"{role}_{side}"] for role in ("asis", "knee_lateral", "ankle_lateral")]
            raise InputError(f"the {side} thigh of {1e3 * thigh:.0f} mm and the shank of {1e3 * shank:.0f} mm belong "
                             "to nobody", file=file, where=f"markers {', '.join(labels)}", right=_RIGHT)


def _words(role: str) -> str:
    name, side = role.rsplit("_", 1)
    return f"{side} {name.replace('_', ' ')}"


def _distance(point: np.ndarray, a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """(n,) m from a point to the straight line from a to b."""
    part = np.clip(np.sum((point - a) * (b - a), axis=1) / np.sum((b - a) ** 2, axis=1), 0.0, 1.0)
    return np.linalg.norm(point - a - part[:, None] * (b - a), axis=1)
