"""Size and decode time of one normalized log in several encodings, by the readers of pyarrow and polars.

    python docs/measure_encodings.py NORMALIZED.parquet      needs pyarrow, polars
"""

import os
import pathlib
import sys
import tempfile
import time

os.environ["POLARS_MAX_THREADS"] = "1"
import polars as pl
import pyarrow as pa
import pyarrow.parquet as pq

NAMES = ["motor_m", "dx_m", "load_n"]
pa.set_cpu_count(1)
once = pq.read_table(sys.argv[1], columns=NAMES)
table = pa.concat_tables([once] * (1_000_000 // len(once) + 1)).slice(0, 1_000_000).combine_chunks()


def fastest(read):
    times = []
    for _ in range(7):
        start = time.process_time()
        read()
        times.append(time.process_time() - start)
    return min(times)


ways = {
    "zstd, byte stream split": {"compression": "zstd", "column_encoding": {n: "BYTE_STREAM_SPLIT" for n in NAMES}},
    "zstd, plain": {"compression": "zstd", "column_encoding": {n: "PLAIN" for n in NAMES}},
    "zstd, dictionary": {"compression": "zstd", "use_dictionary": True},
    "snappy, plain": {"compression": "snappy", "column_encoding": {n: "PLAIN" for n in NAMES}},
    "none, plain": {"compression": "none", "column_encoding": {n: "PLAIN" for n in NAMES}},
}
print("| encoding | bytes a value | pyarrow ns a value | polars ns a value |")
print("|---|---|---|---|")
values = table.num_rows * len(NAMES)
with tempfile.TemporaryDirectory() as folder:
    for name, options in ways.items():
        file = pathlib.Path(folder) / "log.parquet"
        pq.write_table(table, file, **({"use_dictionary": False} | options))
        arrow = fastest(lambda: pq.read_table(file, columns=NAMES, use_threads=False))
        frame = fastest(lambda: pl.read_parquet(file, columns=NAMES))
        print(f"| {name} | {file.stat().st_size / values:.2f} | {arrow / values * 1e9:.1f} | {frame / values * 1e9:.1f} |")
