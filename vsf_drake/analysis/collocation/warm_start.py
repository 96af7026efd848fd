"""Starts kept in files, and carried to another grid."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from scipy.interpolate import CubicHermiteSpline, CubicSpline

from vsf_drake.analysis.collocation.grid import Grid
from vsf_drake.analysis.collocation.problem import TrajectoryProblem
from vsf_drake.analysis.collocation.solution import Start, TrajectorySolution
from vsf_drake.errors import InputError
from vsf_drake.files import replaced
from vsf_drake.npz_file import read_npz

FORMAT = "vsf_drake trajectory 1"
_SAVED = {"names", "design", "z", "p", "multipliers", "method", "intervals", "duration_s", "periodic", "advance"}


def save_start(solution: TrajectorySolution, path: str | Path) -> None:
    """Writes a search's last iterate, whatever it is worth, as .npz with its grid, names and status."""
    problem, last = solution.problem, solution.last
    grid = problem.grid
    multipliers = np.zeros(0) if last.multipliers is None else last.multipliers
    with replaced(path, "wb") as stream:
        np.savez_compressed(
            stream, format=np.array(FORMAT), z=last.z, p=last.p, multipliers=multipliers,
            names=np.array(problem.layout.names), design=np.array([str(name) for name in problem.design.names]),
            method=np.array(grid.method), intervals=grid.intervals, duration_s=grid.duration_s, periodic=grid.periodic,
            advance=problem.advance, status=np.array(solution.status), cost=solution.last_cost)


def load_start(problem: TrajectoryProblem, path: str | Path) -> Start:
    """A saved start for a problem of the same variables; carried to the problem's grid if it is another one.

    Raises:
        InputError: the file is none of these, or its variables are others.
    """
    found = read_npz(path)
    if str(found.get("format", "")) != FORMAT or not _SAVED <= found.keys():
        raise InputError("is no saved trajectory", file=path, right="Give what save_start wrote")
    try:
        for name, own in (("names", problem.layout.names), ("design", [str(each) for each in problem.design.names])):
            known = [str(each) for each in found[name].tolist()]
            if known != list(own):
                raise InputError(f"is of other variables: {', '.join(known)}", where=name,
                                 right=f"This problem has {', '.join(own)}")
        grid = Grid(str(found["method"]), int(found["intervals"]), float(found["duration_s"]), bool(found["periodic"]))
        z, p, advance, multipliers = (np.asarray(found[name], dtype=float)
                                      for name in ("z", "p", "advance", "multipliers"))
        if z.shape != (grid.instants, problem.layout.size) or p.shape != (len(problem.design.names),):
            raise ValueError(f"shapes {z.shape} and {p.shape}")
        if not all(np.isfinite(array).all() for array in (z, p, advance, multipliers)):
            raise ValueError("a number is not finite")
        if grid == problem.grid:
            return Start(z, p, multipliers if multipliers.size else None)
        return Start(carried(problem, z, grid, problem.grid, advance=advance), p)
    except InputError as error:
        raise InputError(error.what, file=path, where=error.where, right=error.right) from None
    except (KeyError, TypeError, ValueError, ArithmeticError, AttributeError) as error:
        raise InputError(f"is damaged ({error})", file=path) from None


def resampled(solution: TrajectorySolution, grid: Grid) -> Start:
    """A search's last iterate on another grid, to begin there."""
    problem = solution.problem
    return Start(carried(problem, solution.last.z, problem.grid, grid, advance=problem.advance), solution.last.p)


def carried(problem: TrajectoryProblem, z: np.ndarray, old: Grid, new: Grid, *, advance: np.ndarray) -> np.ndarray:
    """Variables (N, Z) of one grid on another (M, Z): q and v as cubics with the rates they have, the rest by splines.

    Another duration stretches time: values stay, v and u scale with the ratio of durations, a with its square.

    Raises:
        InputError: one grid is periodic and the other is not.
    """
    if old.periodic != new.periodic:
        raise InputError("one grid is periodic and the other is not", where="grid")
    layout, ratio = problem.layout, old.duration_s / new.duration_s
    z, times = np.asarray(z, dtype=float), old.times_s
    if old.periodic:
        z, times = np.vstack([z, z[:1]]), np.append(times, old.duration_s)
        z[-1, layout.q] += advance
    at = np.clip(new.times_s * ratio, 0.0, old.duration_s)
    ends = "periodic" if old.periodic else "not-a-knot"
    found = np.empty((len(at), layout.size))
    found[:, layout.q] = CubicHermiteSpline(times, z[:, layout.q], z[:, layout.v])(at)
    found[:, layout.v] = CubicHermiteSpline(times, z[:, layout.v], z[:, layout.a])(at) * ratio
    rest = slice(layout.a.start, layout.size)
    found[:, rest] = CubicSpline(times, z[:, rest], bc_type=ends)(at)
    found[:, layout.a] *= ratio**2
    found[:, layout.u] *= ratio
    return found
