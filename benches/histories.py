"""Histories of a fleet: this code and Polars read one Parquet file of estimates and group it by unit.

Usage: histories.py HISTORIES FOLDER [--units N] [--flights N] [--rounds N]: the release build of
crates/pipeline/benches/histories.rs, and a folder for the file. Needs numpy, polars and pyarrow. Contestants run in turn, each
in its own process; the CPU time of importing Polars is not counted.
"""

import argparse
import multiprocessing
import os
import statistics
import subprocess
import sys
from pathlib import Path

POLARS = """
import polars as pl, resource, sys
used = lambda: sum(resource.getrusage(resource.RUSAGE_SELF)[:2])
begun, unit = used(), ["part_number", "serial_number"]
rows = pl.scan_parquet(sys.argv[1])
if sys.argv[2] == "sorted":
    found = rows.sort("departure_utc").group_by(unit).agg(pl.all())
elif sys.argv[2] == "categories":
    names = [*unit, "tail_number", "position"]
    found = rows.with_columns(pl.col(names).cast(pl.Categorical)).group_by(unit).agg(pl.all().sort_by("departure_utc"))
else:
    found = rows.group_by(unit).agg(pl.all().sort_by("departure_utc"))
print(found.collect().height, used() - begun)
"""


def write(file, units, flights):
    """One row for each unit and flight, by date; four units to a tail."""
    import numpy as np
    import pyarrow as pa
    import pyarrow.parquet as pq

    random, rows = np.random.default_rng(1), units * flights
    unit, flight = np.tile(np.arange(units), flights), np.repeat(np.arange(flights), units)
    names = lambda texts, which: pa.array(texts).take(pa.array(which))
    departure = 1_700_000_000_000_000 + flight * 86_400_000_000 + (unit // 4) * 1_000_000
    table = pa.table(
        {
            "serial_number": names([f"S{i:06d}" for i in range(units)], unit),
            "part_number": names(["EMA-27-1040", "EMA-27-1060"], unit % 2),
            "tail_number": names([f"N{i:04d}X" for i in range(units // 4 + 1)], unit // 4),
            "position": names(["aileron_left", "aileron_right", "elevator_left", "elevator_right"], unit % 4),
            "flight_id": pa.array([f"F{a:04d}-{b:05d}" for a, b in zip(unit // 4, flight)]),
            "departure_utc": pa.array(departure, pa.timestamp("us", tz="UTC")),
            "flight_hours": np.full(rows, 2.0),
            "tail_hours_end": flight * 2.0 + 100,
            "load_reversals": random.integers(10, 40, rows),
            "gap_m": 50e-6 + 1e-9 * flight + random.normal(0, 3e-7, rows),
            "gap_se_m": np.full(rows, 3e-7),
        }
    )
    pq.write_table(table, file, compression="zstd", row_group_size=100_000)


def measure(command):
    """CPU seconds, peak memory in MiB and the output of a process."""
    process = subprocess.Popen(command, stdout=subprocess.PIPE, text=True)
    out = process.stdout.read().strip()
    _, status, used = os.wait4(process.pid, 0)
    assert status == 0, out
    return used.ru_utime + used.ru_stime, used.ru_maxrss / 1024, out


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("histories")
    parser.add_argument("folder", type=Path)
    parser.add_argument("--units", type=int, default=4000)
    parser.add_argument("--flights", type=int, default=1000)
    parser.add_argument("--rounds", type=int, default=5)
    args = parser.parse_args()
    file = args.folder / "estimates.parquet"
    # A process of its own: a process begins with the peak memory of the one that started it.
    writer = multiprocessing.get_context("spawn").Process(target=write, args=(file, args.units, args.flights))
    writer.start()
    writer.join()
    script = args.folder / "polars_histories.py"
    script.write_text(POLARS)
    contestants = {"this code": [args.histories, file]}
    for kind in ("sorted", "sort_by", "categories"):
        contestants[f"Polars, {kind}"] = [sys.executable, script, file, kind]
    found = {name: [] for name in contestants}
    for _ in range(args.rounds):
        for name, command in contestants.items():
            cpu, peak, out = measure(command)
            found[name].append((cpu if name == "this code" else float(out.split()[-1]), peak))
    first = statistics.median(cpu for cpu, _ in found["this code"])
    for name, rounds in found.items():
        cpu, peak = (statistics.median(column) for column in zip(*rounds))
        print(f"| {name} | {cpu:.2f} | {cpu / first:.2f} | {peak:.0f} |")


if __name__ == "__main__":
    main()
