"""Writes src/vector.rs and the columns that it includes from the estimator's reference vectors: python3 make_vector.py (needs pyarrow)."""

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


def column(name, said, key):
    values = table[key].to_pylist()
    file = f"{name.lower()}.txt"
    (HERE / "src" / file).write_text("[\n" + "".join(f"    {float(v)!r},\n" for v in values) + "]\n")
    return f'/// {said}\npub const {name}: [f64; {len(values)}] = include!("{file}");\n'


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
"""
    + column("POSITION_M", "δX, m.", "y")
    + column("LOAD_N", "Load, N.", "u")
    + column("S_M", "S after each sample, m.", "x_filt_2")
)
