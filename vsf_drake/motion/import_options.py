"""How recordings become trials: what a manifest, an import or its command says beside the files."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

from vsf_drake.base.schema import SELDOM, option, quantity, same_as
from vsf_drake.motion.manifest import Manifest, ProsthesisSetting, Window
from vsf_drake.motion.markers.person_facts import PersonFacts

AROUND_STANCES_S = 0.3
"""What a walk keeps before and after its stances on plates: the 0.25 s that are scored, and a
little to settle in."""


@dataclass(frozen=True, kw_only=True)
class TrialOptions:
    """How markers and plates become a trial, as a manifest or an import says."""

    stated: Mapping[str, float] = field(default_factory=dict)
    """Fields of `Subject` that are known better than the markers tell, by name; they win."""
    hip: str = same_as(  # see `calibrate`
        Manifest, "hip_centre", help="Hip centre: harrington, bell, hara or davis.", panel=SELDOM
    )
    cutoff_hz: float | None = same_as(  # of the markers' filter; None leaves them as they are
        Manifest,
        "marker_cutoff_hz",
        help="Cut-off of the zero-phase low-pass of the markers.",
        panel=SELDOM,
    )
    longest_gap_s: float = quantity(  # see `fill_gaps`
        0.1,
        unit="s",
        low=0.0,
        source="choice",
        help="Longest gap of a marker to fill.",
        panel=SELDOM,
    )
    plate_sides: Mapping[str, str | None] | None = None
    """plate names by side, where the user says which is which foot"""
    window: Window | None = None
    around_stances_s: float | None = None
    """without a window: so much around the prosthetic foot's stances; None: all"""
    belt_speed_m_per_s: float = same_as(
        Manifest,
        "belt_speed_m_per_s",
        help="Belt speed of a treadmill; + when the belt runs backward.",
        panel=SELDOM,
    )
    unknown_force: Mapping[str, tuple[tuple[float, float], ...]] = field(default_factory=dict)
    """Spans (s) by side, stated beside what plates and feet tell; see `Trial.unmeasured`."""


@dataclass(frozen=True, kw_only=True)
class ImportOptions(TrialOptions):
    """How to read and what is known beside the files."""

    person: PersonFacts
    marker_map: str | None = option(
        None,
        "Marker map: plug_in_gait, rajagopal, ior, opencap or a file. Default: the best fit.",
        flag="--map --marker-map",
    )
    """a shipped map's name or a file; None: the one that fits the labels best"""
    fulcrum_mm: tuple[str, ...] = option(
        (),
        "Required unless the foot is passive: fulcrum position in mm from the keel's posterior "
        "end, or the forefoot's stiffness (16N/mm); once, or once per walk in their order.",
        metavar="MM|N/mm",
    )
    model: Path | None = option(
        None, "Model file of the foot that was worn. Default: the nominal one.", flag="--model"
    )
    laboratory: Mapping[str, str | None] = field(default_factory=dict)
    """up, forward, length_unit, as for `read_trial`"""
    foot_length_mm: float | None = same_as(ProsthesisSetting, "foot_length_mm")
    inverse_kinematics: bool = option(
        False, "Refine the angles by a global inverse kinematics.", flag="--ik", panel=SELDOM
    )
    around_stances_s: float | None = AROUND_STANCES_S
    synthetic: bool = option(False, "Nobody was recorded: all results then say SYNTHETIC.")
