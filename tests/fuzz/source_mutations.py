"""Wrong versions of the program, each of which a test has to notice.

    python tests/fuzz/source_mutations.py [--area strength] [--workers 2]

Each mutation changes one place in a copy of the checkout, and the tests of its area, which all pass
there without it, run until one fails. Listed are changes by hand (a sign, a factor, a constant),
every constant of joint strength, and every sign and number of the table of published effects.
`test_source_mutations.py` holds the list to the sources as they are.
"""

from __future__ import annotations

import argparse
import os
import re
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
COPIED = (
    "vsf_drake",
    "models",
    "data",
    "studies",
    "tests",
    "docs",
    "README.md",
    "CHANGELOG.md",
    "pyproject.toml",
)
TIME_S = 1200.0


@dataclass(frozen=True)
class Mutation:
    """One change: `old`, which stands in the file once, becomes `new`; `also` changes with it what
    says the same."""

    area: str
    path: str
    old: str
    new: str
    also: Mutation | None = None

    def applied(self, text: str) -> str:
        """The file with the change; ValueError where the place is not there once."""
        if text.count(self.old) != 1:
            raise ValueError(f"{self.path}: {self.old!r} stands there {text.count(self.old)} times")
        return text.replace(self.old, self.new)


TESTS = {
    "strength": ("tests/laws/test_joint_strength.py",),
    "published": ("tests/walks/test_published.py",),
    "layers": ("tests/walks/test_prediction.py",),
    "sessions": ("tests/studies/test_session_tier.py", "tests/studies/test_sessions.py"),
    "device": (
        "tests/plants/test_foot.py",
        "tests/model/test_parameters.py",
        "tests/studies/test_foot_studies.py",
        "tests/simulation/test_bench.py",
        "tests/regression",
    ),
    "map": (
        "tests/device/test_cells.py",
        "tests/validation/test_roll_over_section.py",
        "tests/simulation/test_roll_over.py",
        "tests/device/test_make.py",
        "tests/device/test_surface.py",
    ),
    "level 2": ("tests/optimal_control/test_level2.py", "tests/optimal_control/test_normal.py"),
    "energy": (
        "tests/simulation/test_energy.py",
        "tests/walks/test_energy_ledger.py",
    ),
}
"""By area, what ought to fail, what takes least first."""
MOMENTUM = "vsf_drake/walks/momentum.py"
BETWEEN = "vsf_drake/walks/between_settings.py"
PERSON_CURVE = "vsf_drake/walks/person_curve.py"
PREDICTION = "vsf_drake/walks/prediction.py"
SESSION = "studies/virtual_laboratory/session.py"
NOMINAL = "models/nominal.yaml"
PARAMETERS = "vsf_drake/model/parameters.py"
CELLS = "vsf_drake/device/stiffness_map/cells.py"
ROLL_OVER = "vsf_drake/device/roll_over.py"
OUTCOMES = "vsf_drake/optimal_control/outcomes.py"
REACTIONS = "vsf_drake/simulation/reactions.py"
JOINT_STRENGTH = "vsf_drake/laws/joint_strength.py"
PUBLISHED = "vsf_drake/walks/published.py"
EFFECTS = "data/published/stiffness_effects.csv"

BY_HAND = (
    # what plates and momentum add to a prediction
    Mutation(
        "layers", MOMENTUM, "(missing[-1] + by @ c) / sigma", "(missing[-1] - by @ c) / sigma"
    ),
    Mutation("layers", MOMENTUM, "[forward, -right, up]", "[forward, right, up]"),
    Mutation("layers", MOMENTUM, "needed_force(walk) - on_plate", "needed_force(walk) + on_plate"),
    Mutation("layers", MOMENTUM, "np.maximum(1.0, np.sqrt", "np.maximum(0.0, np.sqrt"),
    Mutation("layers", MOMENTUM, "> MOST_MOVED_BW", "> 100.0"),
    Mutation("layers", MOMENTUM, "spread.min() > MOST_SPREAD", "spread.max() > MOST_SPREAD"),
    Mutation("layers", PERSON_CURVE, "* (_at(percent, model", "* (-_at(percent, model"),
    Mutation("layers", PERSON_CURVE, "NEED * _faded", "-NEED * _faded"),
    Mutation("layers", PERSON_CURVE, "place + ALIGNED * (own", "place - ALIGNED * (own"),
    Mutation("layers", PERSON_CURVE, "one.start_s - strike_s", "one.start_s + strike_s"),
    Mutation("layers", PERSON_CURVE, "one is not own", "True"),
    Mutation("layers", PERSON_CURVE, "foot + _at(theirs", "foot - _at(theirs"),
    Mutation(
        "layers",
        BETWEEN,
        "np.clip(fulcrum_m, places[0], places[-1])",
        "np.clip(fulcrum_m, places[0], places[0])",
    ),
    Mutation("layers", BETWEEN, "> SETTING_M", "> 20.0 * SETTING_M"),
    Mutation("layers", PREDICTION, "return min(errors, key", "return max(errors, key"),
    # errors that a synthetic session makes
    Mutation(
        "sessions",
        SESSION,
        "KNEE_M, ANKLE_M, PLACE_M, FOOT_DEG = 5e-3,",
        "KNEE_M, ANKLE_M, PLACE_M, FOOT_DEG = 9e-3,",
    ),
    Mutation("sessions", SESSION, "angles[name] ** 2 - own**2", "angles[name] ** 2 + own**2"),
    Mutation("sessions", SESSION, "np.sqrt(0.5 * np.pi)", "np.sqrt(2.0 * np.pi)"),
    Mutation(
        "sessions",
        SESSION,
        "MASS_KG, STATURE_M, FOOT_LENGTH_M = 0.3,",
        "MASS_KG, STATURE_M, FOOT_LENGTH_M = 3.0,",
    ),
    Mutation("sessions", SESSION, "SWAY_SPREAD = 0.2", "SWAY_SPREAD = 0.6"),
    Mutation("sessions", SESSION, "\nPARTS = 3", "\nPARTS = 1"),
    # the device
    *(
        Mutation(
            "device",
            NOMINAL,
            f"{name}: {old}",
            f"{name}: {new}",
            also=Mutation("device", PARAMETERS, *default),
        )
        for name, old, new, default in (
            (
                "flexural_modulus_pa",
                "7800000000.0",
                "8800000000.0",
                ("        7.8e9,", "        8.8e9,"),
            ),
            ("stiffness_n_per_m", "2000000.0", "176000.0", ("        2e6,", "        176e3,")),
            ("rearmost_m", "0.066", "0.076", ("        0.066, unit", "        0.076, unit")),
            ("thickness_m", "0.00635", "0.00615", ("quantity(0.00635,", "quantity(0.00615,")),
            ("foremost_m", "0.151", "0.141", ("        0.151, unit", "        0.141, unit")),
            ("width_m", "0.0684", "0.0584", ("quantity(0.0684,", "quantity(0.0584,")),
        )
    ),
    Mutation("device", PARAMETERS, "(0.066,) + (0.163 / 7,) * 7", "(0.066,) + (0.163 / 8,) * 8"),
    Mutation("device", PARAMETERS, "GRAVITY = 9.81", "GRAVITY = 9.91"),
    # the stiffness map and its machine
    Mutation("map", CELLS, "np.cos(tilt) / np.cos(line)", "np.cos(line) / np.cos(tilt)"),
    Mutation(
        "map",
        CELLS,
        "load.tilt_rad + np.radians(cell.slope_deg)",
        "load.tilt_rad - np.radians(cell.slope_deg)",
    ),
    Mutation(
        "map",
        CELLS,
        "line - np.radians(cell.alignment_deg)",
        "line + np.radians(cell.alignment_deg)",
    ),
    Mutation("map", CELLS, "damping_n_s_per_m=ratio * zone", "damping_n_s_per_m=1.0 * zone"),
    Mutation(
        "map",
        ROLL_OVER,
        "taken_j[fullest:].max() - taken_j[-1]",
        "taken_j[fullest:].max() + taken_j[-1]",
    ),
    Mutation("map", CELLS, "RATE_WINDOW_S = 0.02", "RATE_WINDOW_S = 0.05"),
    Mutation("map", ROLL_OVER, "164.651497111425", "166.651497111425"),
    Mutation("map", ROLL_OVER, "20.7217, -20041.0", "22.7217, -20041.0"),
    # what a stride that adapts means
    Mutation("level 2", OUTCOMES, "/ mass - [0.0, GRAVITY]", "/ mass + [0.0, GRAVITY]"),
    Mutation(
        "level 2",
        OUTCOMES,
        '- motion.x[pylon] * column("prosthetic_fz")',
        '+ motion.x[pylon] * column("prosthetic_fz")',
    ),
    Mutation(
        "level 2",
        OUTCOMES,
        "half = rows[len(rows) // 2 :] if late",
        "half = rows[len(rows) // 2 :] if not late",
    ),
    Mutation(
        "level 2",
        OUTCOMES,
        'column(f"q_{knee_p}") + socket_bends',
        'column(f"q_{knee_p}") - socket_bends',
    ),
    Mutation("level 2", PUBLISHED, '"+" if change > 0.0 else "-"', '"-" if change > 0.0 else "+"'),
    Mutation("level 2", OUTCOMES, "v[3:]).sum(0)", "v[3:]).max(0)"),
    Mutation(
        "level 2",
        OUTCOMES,
        "(model.subject.mass_kg * stride.advance_m)",
        "(model.subject.mass_kg * stride.speed)",
    ),
    # where energy is
    Mutation("energy", REACTIONS, "0.5 * h * (power", "0.4 * h * (power"),
    Mutation("energy", REACTIONS, "np.sum(0.5 * k * (x**2", "np.sum(0.4 * k * (x**2"),
    Mutation(
        "energy",
        REACTIONS,
        "- total(ledger, STORED) - total(ledger, LOST)",
        "- total(ledger, STORED)",
    ),
    Mutation(
        "energy",
        REACTIONS,
        "1.5 * rate[-1:] - 0.5 * rate[-2:-1]",
        "0.5 * rate[-1:] - 0.5 * rate[-2:-1]",
    ),
    Mutation(
        "energy",
        REACTIONS,
        "k = np.where(x < 0, s[:, 1], s[:, 0])",
        "k = np.where(x < 0, s[:, 0], s[:, 0])",
    ),
    Mutation(
        "energy",
        REACTIONS,
        "-self.moment_W[loaded, 1] / vertical",
        "self.moment_W[loaded, 1] / vertical",
    ),
)


def constants_of_strength() -> Iterator[Mutation]:
    """Every constant of ACTIVE and PASSIVE a twentieth larger; 0 becomes 0.1."""
    text = (ROOT / JOINT_STRENGTH).read_text(encoding="utf-8")
    start = text.index("\nACTIVE = {")
    block = text[start : text.index("\n\n", start)]
    for number in re.finditer(r"-?\d+\.\d+(?=[,)])", block):
        value = float(number.group())
        other = repr(1.05 * value) if value else "0.1"
        changed = block[: number.start()] + other + block[number.end() :]
        yield Mutation("strength", JOINT_STRENGTH, block, changed)


def entries_of_published_effects() -> Iterator[Mutation]:
    """Every sign turned, and every mean and standard deviation a tenth larger."""
    text = (ROOT / EFFECTS).read_text(encoding="utf-8")
    rows = [row for row in text.splitlines() if row and not row.startswith(("#", "source,"))]
    for row in rows:
        for cell in re.finditer(r"(?<=,)([+\-0]|\d+\.\d+)(?=,)", row):
            old = cell.group()
            new = {"+": "-", "-": "+", "0": "+"}.get(old) or f"{1.1 * float(old):.4f}"
            changed = row[: cell.start()] + new + row[cell.end() :]
            yield Mutation("published", EFFECTS, f"{row}\n", f"{changed}\n")


def mutations() -> list[Mutation]:
    """All of them, in order."""
    return [*constants_of_strength(), *entries_of_published_effects(), *BY_HAND]


def failing(area: str, copy: Path) -> str | None:
    """The first test of the area that fails in the copy, or how pytest ended otherwise; None if all
    pass."""
    words = [
        sys.executable,
        "-m",
        "pytest",
        "-x",
        "-q",
        "-rfE",
        "-n",
        "0",
        "-p",
        "no:cacheprovider",
        *TESTS[area],
    ]
    environment = os.environ | {"PYTHONPATH": str(copy)}
    try:
        done = subprocess.run(
            words,
            cwd=copy,
            env=environment,
            capture_output=True,
            text=True,
            timeout=TIME_S,
            check=False,
        )
    except subprocess.TimeoutExpired:
        return f"no end within {TIME_S:.0f} s"
    if done.returncode == 0:
        return None
    named = re.search(r"^(?:FAILED|ERROR) (\S+)", done.stdout, re.MULTILINE)
    return named.group(1) if named else f"pytest ended with {done.returncode}"


def noticed_by(mutation: Mutation, copy: Path) -> str | None:
    """What fails in the copy with the mutation, which it then loses again; None where the mutation
    survives.

    Tests that cannot even be collected and tests that never end notice it as well.
    """
    changes = [one for one in (mutation, mutation.also) if one]
    texts = {one.path: (copy / one.path).read_text(encoding="utf-8") for one in changes}
    for one in changes:
        (copy / one.path).write_text(one.applied(texts[one.path]), encoding="utf-8")
    try:
        return failing(mutation.area, copy)
    finally:
        for path, text in texts.items():
            (copy / path).write_text(text, encoding="utf-8")


def main() -> None:
    """Runs the mutations and prints which of them nothing noticed."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument(
        "--area", help="only these: " + ", ".join(dict.fromkeys(one.area for one in mutations()))
    )
    parser.add_argument(
        "--workers", type=int, default=1, help="so many copies of the checkout at a time"
    )
    arguments = parser.parse_args()
    chosen = [one for one in mutations() if arguments.area in (None, one.area)]
    with tempfile.TemporaryDirectory() as folder:
        copies = [Path(folder) / str(number) for number in range(arguments.workers)]
        for copy in copies:
            for name in COPIED:
                source = ROOT / name
                if source.is_dir():
                    shutil.copytree(source, copy / name)
                else:
                    copy.mkdir(exist_ok=True)
                    shutil.copy(source, copy / name)
        for area in dict.fromkeys(one.area for one in chosen):
            broken = failing(area, copies[0])
            if broken:
                sys.exit(f"{area}: {broken} fails without a mutation, so that nothing can be told")

        def run(number: int) -> list[Mutation]:
            survivors = []
            for mutation in chosen[number :: arguments.workers]:
                test = noticed_by(mutation, copies[number])
                changed = "a table entry" if len(mutation.old) > 200 else mutation.new.strip()
                print(
                    f"{f'killed by {test}' if test else 'SURVIVED'} {mutation.area}: {changed}",
                    flush=True,
                )
                if test is None:
                    survivors.append(mutation)
            return survivors

        with ThreadPoolExecutor(arguments.workers) as pool:
            survivors = [one for part in pool.map(run, range(arguments.workers)) for one in part]
    print(f"{len(chosen) - len(survivors)} of {len(chosen)} mutations are noticed")
    sys.exit(bool(survivors))


if __name__ == "__main__":
    main()
