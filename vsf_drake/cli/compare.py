"""`vsf-drake compare`: two walks, settings or folders of walks on one page."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated

import typer

from vsf_drake.base.errors import InputError
from vsf_drake.base.files import user_path
from vsf_drake.cli.app import Out, app, manifests_of, print_text, say

if TYPE_CHECKING:  # it imports Drake
    from collections.abc import Sequence

    from vsf_drake.motion.trial import Trial
    from vsf_drake.walks.difference import Side

_SIDE = "trial manifest, a folder of them, or one that simulate, import or session wrote"
_Side = Annotated[
    str,
    typer.Argument(
        metavar="WALKS",
        help=f"A {_SIDE}; with @108, @16N/mm or a passive foot's @NAME its walks at that setting.",
    ),
]


@app.command()
def compare(a: _Side, b: _Side, out: Out) -> None:
    """Two walks, settings or sessions beside each other: both to play over one slider of stance,
    their curves, and whether they differ by more than walks of one side do."""
    from vsf_drake.report.compare_page import COMPARE, difference_rows, write_comparison
    from vsf_drake.report.results_folder import PAGE
    from vsf_drake.simulation.archive import provenance
    from vsf_drake.walks.difference import difference_of, difference_sentences

    COMPARE.check(out)
    side_a = _side(a)
    side_b = _side(b)
    table = difference_of(side_a, side_b)
    inputs = {
        f"{letter}: {file}": digest
        for letter, side in (("A", side_a), ("B", side_b))
        for trial in side.trials
        for file, digest in trial.inputs.items()
    }
    write_comparison(out, table, side_a, side_b, provenance(inputs))
    print_text("compare", sentences=difference_sentences(table), rows=difference_rows(table))
    say(f"written to {out / PAGE}")


def _side(name: str) -> Side:
    """The walks of a side."""
    from vsf_drake.motion.trial import load_trial
    from vsf_drake.simulation.results import ARRAYS_FILE, load_walk
    from vsf_drake.walks.difference import side_of, trial_of

    path = user_path(name)
    before, at, setting = name.rpartition("@")
    asked = bool(at) and not path.exists()
    if asked:
        path = user_path(before)
    if not path.exists():
        raise InputError("there is no such file or folder", file=path, right=f"Name a {_SIDE}")
    results = [
        file.parent for below in ("", "*/") for file in sorted(path.glob(f"{below}{ARRAYS_FILE}"))
    ]
    if results:
        trials = [trial_of(load_walk(folder), folder) for folder in results]
    else:
        trials = [load_trial(file) for file in manifests_of([path])]
    if not asked:
        return side_of(name, trials, simulated=bool(results))
    own = [trial for trial in trials if setting and trial.setting.foot == setting]
    if not own:
        own = _standing_at(setting, trials, name)
    return side_of(name, own, simulated=bool(results))


def _standing_at(setting: str, trials: Sequence[Trial], side: str) -> list[Trial]:
    """The walks with the fulcrum where `setting` says; InputError if there is none."""
    from vsf_drake.model.setting import moves
    from vsf_drake.simulation.fulcrum_place import fulcrum_place
    from vsf_drake.walks.between_settings import SETTING_M

    known = sorted({trial.setting for trial in trials}, key=lambda known: known.setting_order)
    there = f"There are walks with {', '.join(one.setting_words for one in known)}"
    own = []
    at_m = None
    for trial in trials:
        if moves(trial.model.foot):
            at_m = fulcrum_place(setting, trial.model.foot, file=side, where="behind the @")
            if abs(trial.fulcrum_m - at_m) <= SETTING_M:
                own.append(trial)
    if not own:
        place = setting if at_m is None else f"{1e3 * at_m:g} mm"
        raise InputError(f"holds no walk at {place}", file=side, right=there)
    return own
