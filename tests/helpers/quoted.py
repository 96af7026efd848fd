"""Pages whose numbers are drawn from what has them: their text, stored results, and what is left
over."""

from __future__ import annotations

import json
import re
from collections.abc import Iterable
from functools import cache
from pathlib import Path
from typing import Any

import vsf_drake as vsf
from vsf_drake.simulation.walk import Walker
from vsf_drake.walks.embedded import embedded_contact, embedded_trials
from vsf_drake.walks.prediction import TrialLayers, layers_of

ROOT = Path(__file__).resolve().parents[2]


def flat(text: str) -> str:
    """Words with one blank between them, without numbers of a list, links' targets, code blocks,
    equations and commands."""
    text = re.sub(r"^```.*?^```$", "", text, flags=re.MULTILINE | re.DOTALL)
    text = re.sub(r"\$\$.*?\$\$", "", text, flags=re.DOTALL)
    text = re.sub(r"^\d\. ", "", text, flags=re.MULTILINE)
    text = re.sub(r"`vsf-drake [^`]*`", "", text)
    return " ".join(re.sub(r"\]\([^)]*\)", "]", text).split())


def page(name: str) -> str:
    return flat((ROOT / name).read_text(encoding="utf-8"))


@cache
def stored(name: str) -> Any:
    return json.loads((ROOT / name).read_text(encoding="utf-8"))


def percent(share: float) -> str:
    return f"{100.0 * share:.1f}"


def left_over(text: str, pieces: Iterable[str]) -> list[str]:
    """The numbers of a text that stand in none of its pieces, with the words about them."""
    for piece in sorted(pieces, key=len, reverse=True):
        text = text.replace(piece, "\0")
    return [text[max(0, n.start() - 30) : n.end() + 20] for n in re.finditer(r"\d[\d.]*", text)]


@cache
def rows_in_layers(tier: str) -> list[TrialLayers]:
    """Nine SYNTHETIC walks of a tier in layers, with the contact that was fitted to two of them."""
    contact = vsf.load_contact(embedded_contact(tier))
    trials = [vsf.load_trial(path) for path in embedded_trials(tier)]
    applied = vsf.trial_with(trials[0], contact)
    walker = Walker(applied.subject, applied.model)
    return [
        layers_of(trial, trial.path.stem, contact, walker=walker, step_s=1e-3) for trial in trials
    ]
