"""The README's Python blocks run as they stand, outside the checkout, with only the package installed."""

from __future__ import annotations

import ast
import json
import re
import subprocess
import sys
from pathlib import Path

import pytest

README = (Path(__file__).resolve().parents[1] / "README.md").read_text(encoding="utf-8")
BLOCKS = re.findall(r"^```python\n(.*?)^```$", README, flags=re.MULTILINE | re.DOTALL)
RUNNING = """
import contextlib, io, json, sys
if __name__ == "__main__":
    for number, block in enumerate(json.load(open("blocks.json", encoding="utf-8"))):
        with contextlib.redirect_stdout(io.StringIO()) as said:
            exec(compile(block, f"block {number}", "exec"), {"__name__": "__main__"})
        print(json.dumps(said.getvalue()), flush=True)
"""
LATER = """
for moment in (0.75, 1.0):
    simulator.AdvanceTo(moment)
    print(wired.GetOutputPort("grf").Eval(forces))
"""


def test_readme_shows_bench_walk_and_validation_and_what_it_imports_is_there():
    text = "\n".join(BLOCKS)
    for name in ("run_bench", "simulate_trial", "write_walk", "make_gait", "wire_foot("):
        assert name in text
    imports = [node for node in ast.walk(ast.parse(text)) if isinstance(node, (ast.Import, ast.ImportFrom))]
    exec(compile(ast.Module(imports, []), "imports", "exec"), {})


@pytest.mark.slow
def test_readme_blocks_run_outside_the_checkout_and_the_leg_comes_to_rest_on_its_weight(tmp_path):
    """One process for all, each with names of its own.

    Friction that creeps (in proportion to speed below its threshold) holds nothing at rest: what the landing bent in
    hip and knee slides away, by one exponential of 0.8 s. Three equal steps of it tell where it ends (Aitken).
    """
    blocks = [block + LATER if "wire_foot(" in block else block for block in BLOCKS]
    (tmp_path / "blocks.json").write_text(json.dumps(blocks), encoding="utf-8")
    (tmp_path / "run.py").write_text(RUNNING, encoding="utf-8")
    done = subprocess.run([sys.executable, "run.py"], cwd=tmp_path, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    said = [json.loads(line) for line in done.stdout.splitlines()]
    assert len(said) == len(BLOCKS) and all(text.strip() for text in said)
    leg = said[next(number for number, block in enumerate(BLOCKS) if "wire_foot(" in block)]
    force, weight, *later = ([float(x) for x in re.findall(r"-?\d+\.\d*", line)] for line in leg.splitlines())
    assert force[2] == pytest.approx(weight[0], rel=1e-3)
    first, second, third = force[0], later[0][0], later[1][0]
    assert 0.0 < third / second < 1.0 and 0.0 < second / first < 1.0
    assert abs(first * third - second**2) < 1e-3 * weight[0] * abs(first + third - 2.0 * second)
