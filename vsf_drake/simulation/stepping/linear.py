"""Small dense linear algebra without calls out of compiled code: a dozen unknowns, thousands of times."""

from __future__ import annotations

import math

from vsf_drake.laws.compiled import internal


@internal
def copy(source, target):
    """Copies a vector; the assignment of slices does the same but takes seconds to compile."""
    for i in range(source.shape[0]):
        target[i] = source[i]


@internal
def cholesky(A, L):
    """Writes the lower factor L with A = L L^T of a symmetric positive definite A; what is above L's diagonal stays."""
    n = A.shape[0]
    for j in range(n):
        d = A[j, j]
        for k in range(j):
            d -= L[j, k] * L[j, k]
        L[j, j] = math.sqrt(d)
        for i in range(j + 1, n):
            s = A[i, j]
            for k in range(j):
                s -= L[i, k] * L[j, k]
            L[i, j] = s / L[j, j]


@internal
def scaled_norm(L, r, y):
    """Norm sqrt(r^T A^-1 r) of r for A = L L^T; y (n,) is work space."""
    n = r.shape[0]
    total = 0.0
    for i in range(n):
        s = r[i]
        for k in range(i):
            s -= L[i, k] * y[k]
        y[i] = s / L[i, i]
        total += y[i] * y[i]
    return math.sqrt(total)


@internal
def solve_columns(A, B):
    """Overwrites B (n, m) with A^-1 B by Gaussian elimination with partial pivoting; A is destroyed."""
    n, m = B.shape
    for k in range(n):
        pivot = k
        for i in range(k + 1, n):
            if abs(A[i, k]) > abs(A[pivot, k]):
                pivot = i
        if pivot != k:
            for j in range(k, n):
                A[k, j], A[pivot, j] = A[pivot, j], A[k, j]
            for j in range(m):
                B[k, j], B[pivot, j] = B[pivot, j], B[k, j]
        for i in range(k + 1, n):
            factor = A[i, k] / A[k, k]
            if factor != 0.0:
                for j in range(k + 1, n):
                    A[i, j] -= factor * A[k, j]
                for j in range(m):
                    B[i, j] -= factor * B[k, j]
    for k in range(n - 1, -1, -1):
        for j in range(m):
            B[k, j] /= A[k, k]
        for i in range(k):
            factor = A[i, k]
            if factor != 0.0:
                for j in range(m):
                    B[i, j] -= factor * B[k, j]
