"""Progress: what it says, how often, and that nothing is said unasked."""

from __future__ import annotations

from dataclasses import replace

import pytest

from vsf_drake.simulation.many import SweepProgress, processes, simulate_many
from vsf_drake.simulation.many.processes import LINE_EVERY_S, sparse_lines

HALF = SweepProgress(total=100, done=50, failed=1, from_cache=20, simulated=30, elapsed_s=10.0)


def test_rate_counts_what_was_simulated_and_tells_the_time_left():
    assert HALF.rate_per_s == pytest.approx(3.0)
    assert HALF.left_s == pytest.approx(50 / 3.0)
    assert str(HALF) == "50 of 100 walks (20 from the cache), 1 failed, 3.0 walks/s, 0:17 left"


def test_without_a_simulation_there_is_no_rate_and_at_the_end_no_time_left():
    start = replace(HALF, simulated=0, elapsed_s=0.0)
    assert start.rate_per_s is None and start.left_s is None
    assert replace(HALF, done=100).left_s == 0.0


def test_lines_are_sparse_and_the_last_one_is_never_left_out():
    now, lines = [0.0], []
    show = sparse_lines(lines.append, clock=lambda: now[0])
    for done in range(101):
        now[0] = 1.0 * done
        show(replace(HALF, done=done))
    assert [int(line.split()[0]) for line in lines] == [0, *range(int(LINE_EVERY_S), 100, int(LINE_EVERY_S)), 100]


def test_a_library_call_prints_nothing_and_true_prints_to_stderr(sweep, capsys):
    simulate_many(sweep(2), workers=1)
    assert capsys.readouterr() == ("", "")
    simulate_many(sweep(2), workers=1, progress=True)
    out, err = capsys.readouterr()
    assert out == "" and "2 of 2 walks" in err


def test_a_terminal_gets_a_bar_with_rate(sweep, capsys, monkeypatch):
    monkeypatch.setattr(processes.sys.stderr, "isatty", lambda: True, raising=False)
    simulate_many(sweep(2), workers=1, progress=True)
    err = capsys.readouterr().err
    assert "2/2" in err and "walks/s" in err


def test_a_function_is_told_the_start_every_member_and_what_came_from_the_cache(sweep, tmp_path):
    states = []
    simulate_many(sweep(2), workers=1, cache=tmp_path)
    simulate_many(sweep(4), workers=1, cache=tmp_path, progress=states.append)
    assert states[-1].done == states[-1].total == 4
    assert [s.simulated for s in states] == list(range(len(states)))
    assert all(s.from_cache == states[0].from_cache for s in states)
