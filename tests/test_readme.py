"""The README's Python blocks run as they stand, outside the checkout, with only the package installed."""

from __future__ import annotations

import re
import subprocess
import sys
from pathlib import Path

import pytest

README = (Path(__file__).resolve().parents[1] / "README.md").read_text(encoding="utf-8")
BLOCKS = re.findall(r"^```python\n(.*?)^```$", README, flags=re.MULTILINE | re.DOTALL)


def test_readme_shows_bench_walk_and_validation():
    text = "\n".join(BLOCKS)
    for name in ("run_bench", "simulate_trial", "write_walk", "make_gait", "wire_foot("):
        assert name in text


@pytest.mark.parametrize("number", range(len(BLOCKS)))
def test_readme_block_runs_outside_the_checkout(number, tmp_path):
    script = tmp_path / "block.py"
    script.write_text(BLOCKS[number], encoding="utf-8")
    done = subprocess.run([sys.executable, script.name], cwd=tmp_path, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    assert done.stdout.strip()
    if "wire_foot(" in BLOCKS[number]:  # the leg comes to rest on its weight
        force, weight = (re.findall(r"-?\d+\.\d*", line) for line in done.stdout.splitlines())
        assert float(force[2]) == pytest.approx(float(weight[0]), rel=1e-3)
        assert abs(float(force[0])) < 0.01 * float(weight[0])
