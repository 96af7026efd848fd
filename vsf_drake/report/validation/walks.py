"""The walks of a study on disk: a folder each, and the replay of one."""

from __future__ import annotations

from pathlib import Path

from vsf_drake.analysis.validation.study import HELD_OUT, Study, StudyWalk
from vsf_drake.json_file import write_json
from vsf_drake.report.replay import write_replay
from vsf_drake.report.style import save_figure
from vsf_drake.report.walk_figure import walk_figure
from vsf_drake.simulation.results import save_walk

WALKS, REPLAY = "walks", "replay.html"


def write_walks(study: Study, out: Path) -> None:
    """`walks/LABEL/` in the existing folder `out` for each walk: its saved result, metrics.json and figure.

    Raises:
        InputError: `out` cannot be written.
    """
    names = _folders(study)
    for walk in study.walks:
        metrics = {**walk.metrics, "role": walk.role, "doubts": list(walk.doubts), "notes": list(walk.result.notes)}
        folder = out / WALKS / names[walk.label]
        folder.mkdir(parents=True)
        save_walk(walk.result, folder)
        save_figure(walk_figure(walk.result, walk.recorded.prosthetic_plate, metrics), folder / "walk")
        write_json(folder / "metrics.json", metrics)


def write_replay_of(study: Study, out: Path) -> str:
    """Writes the replay of one walk, a held-out one of the middle condition where there is one; returns its label.

    Raises:
        InputError: `out` cannot be written.
    """
    walk = _shown(study)
    write_replay(walk.result, out / REPLAY, plate=walk.recorded.prosthetic_plate)
    return walk.label


def _folders(study: Study) -> dict[str, str]:
    """The folder's name of each walk by its label, in which folders may tell trials of one name apart."""
    names: dict[str, str] = {}
    for walk in study.walks:
        name = walk.label.replace("/", "_").replace("..", "_")
        while name in names.values():
            name += "_"
        names[walk.label] = name
    return names


def _shown(study: Study) -> StudyWalk:
    conditions = [*study.conditions().values()]
    middle = conditions[len(conditions) // 2]
    return next((walk for walk in middle if walk.role == HELD_OUT), middle[0])
