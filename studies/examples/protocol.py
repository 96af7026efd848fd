"""The nominal foot by the clauses of ISO/TS 16955: what stands there, and what is not computed."""

from __future__ import annotations

import vsf_drake as vsf


def main() -> dict[str, tuple[float | None, ...]]:
    """Stiffness (N/mm) of heel, mid-foot and toe at 66, 108 and 151 mm under 600 N."""
    model = vsf.ModelParameters()
    rows = vsf.bench_protocol(model, "iso16955", fulcrums_m=[0.066, 0.108, 0.151]).table.rows
    for row in rows:
        print(row.clause.clause, row.clause.test, row.clause.label, row.values)
    return {r.clause.part: r.values for r in rows if r.clause.quantity == "stiffness_n_per_mm"}


if __name__ == "__main__":
    print(main())
