"""Writes src/vector.rs and the samples that it includes from the estimator's reference vectors: python3 make_vector.py (needs pyarrow)."""

import json
from pathlib import Path

import pyarrow.parquet as parquet

HERE = Path(__file__).parent
DATA = HERE / "../../crates/estimator/tests/data/lkf"
NAME = "a_nominal_250hz"

row = json.loads((DATA / "vectors.json").read_text())[NAME]
table = parquet.read_table(DATA / f"{NAME}.parquet")


def numbers(values):
    return "[" + ", ".join(repr(float(v)) for v in values) + "]"


columns = [table[key].to_pylist() for key in ("y", "u", "x_filt_2")]
samples = "".join(f"    {numbers(row)},\n" for row in zip(*columns))
(HERE / "src/samples.txt").write_text(f"[\n{samples}]\n")

# W_d is symmetric, so that rows are columns.
(HERE / "src/vector.rs").write_text(
    f"""//! Set `{NAME}` of the estimator's reference vectors, made by mpmath in 50 digits. Written by
//! `make_vector.py`; not to be edited.

/// K, N/m; f, N·s/m; m_s, kg.
pub const ACTUATOR: [f64; 3] = {numbers(row[k] for k in ("stiffness", "damping", "inertia"))};
/// Step, s.
pub const STEP_S: f64 = {1.0 / row["sample_rate_hz"]!r};
/// W_d, 3×3.
pub const W_D: [[f64; 3]; 3] = [{", ".join(numbers(r) for r in row["W_d"])}];
/// V_d, m².
pub const V_D_M2: f64 = {row["V_d"]!r};
/// ΔS, m.
pub const GAP_M: f64 = {row["gap"]!r};
/// δX, m, load, N, and S, m, of each sample.
pub const SAMPLES: [[f64; 3]; {len(columns[0])}] = include!("samples.txt");
"""
)
