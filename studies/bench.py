"""The paper's bench: five fulcrum positions and the heel at 50 mm/min, and the same at half and
double speed."""

from __future__ import annotations

import argparse
from pathlib import Path

from vsf_drake.base.files import resource
from vsf_drake.device.bench_metrics import bench_table
from vsf_drake.model.model_file import load_model
from vsf_drake.report.outputs import write_bench
from vsf_drake.simulation.bench import PUBLISHED_SPEED_M_PER_S, run_bench


def main() -> None:
    """Runs the bench, writes its results and prints how little the speed matters."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--out", type=Path, default=Path("results/bench"))
    parser.add_argument("--quick", action="store_true", help="the published speed only")
    arguments = parser.parse_args()
    model = load_model(resource("models/nominal.yaml"))
    table = write_bench(run_bench(model), arguments.out)
    columns = {1.0: table}
    for ratio in () if arguments.quick else (0.5, 2.0):
        columns[ratio] = bench_table(
            run_bench(model, speed_m_per_s=ratio * PUBLISHED_SPEED_M_PER_S)
        )
    print("fulcrum (mm)" + "".join(f"{50 * ratio:10.0f} mm/min" for ratio in columns))
    for i, row in enumerate(table.settings):
        values = [columns[ratio].settings[i].stiffness_n_per_mm for ratio in columns]
        print(f"{row.fulcrum_mm:12.0f}" + "".join(f"{value:12.3f} N/mm" for value in values))
    print(f"heel {table.heel_stiffness_n_per_mm:.2f} N/mm")


if __name__ == "__main__":
    main()
