"""The page of a session: verdict, walks to play and in numbers, and what to record next; the rest
behind."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from vsf_drake.base.files import record
from vsf_drake.model.setting import AtSetting, setting_column
from vsf_drake.report.page import Chapter, render
from vsf_drake.report.results_folder import ResultsFolder
from vsf_drake.report.style import Arrays

IMPORT_FOLDER, FIT_FOLDER = "import", "fit"
STEPS = "steps.json"


def session_page(
    saved: Mapping[str, Any], arrays: Arrays, *, folder: Path, lenient: bool
) -> dict[str, Any]:
    """What `page.chapter_page` is to be given of session.json."""
    settings = [record(AtSetting, walk) for walk in saved["walks"]]
    passive = any(setting.fulcrum_mm is None for setting in settings)
    facts = {"t": saved, "place": setting_column(settings), "passive": passive}
    effect = Chapter(
        name="setting",
        title="What the setting does",
        template="session/setting.html.j2",
        facts=facts,
    )
    return {
        "title": f"Session of {saved['person']}",
        "chapters": [
            Chapter(name="verdict", title="", template="session/verdict.html.j2", facts=facts),
            *([] if passive else [effect]),
            Chapter(name="fit", title="The fit", template="session/fit.html.j2", facts=facts),
            Chapter(
                name="files",
                title="Files, and what was left out",
                template="session/files.html.j2",
                facts=facts,
            ),
        ],
        "synthetic": saved["synthetic"],
        "first_line": render("session/first_line.txt.j2", t=saved),
    }


SESSION = ResultsFolder(
    layered=True,
    kind="session",
    command="session",
    table="session.json",
    show=session_page,
    known=lambda table: "walks" in table and "files" in table,
    unfinished=lambda out: (out / STEPS).is_file(),
)
