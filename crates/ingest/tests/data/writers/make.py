"""Writes the small logs of this folder: one flight of two actuators, by five writers, in every layout.

    python make.py             needs pyarrow, polars, pandas, fastparquet, duckdb
    python make.py --spark     needs pyspark and Java, and adds spark_*.parquet

Sample k of actuator a (0 left, 1 right) at t = k/100 s, 400 samples:
    motor_deg = 720 sin(0.5 t) + 90 a,  screw_mm = 5 motor_deg/360 + 0.05 cos(t),  load_n = 1000 cos(0.7 t) + a
"""

import decimal
import math
import pathlib
import shutil
import sys

HERE = pathlib.Path(__file__).parent
N, RATE = 400, 100.0
POSITIONS = ["left", "right"]


def sample(k, a):
    t = k / RATE
    motor = 720 * math.sin(0.5 * t) + 90 * a
    return t, motor, 5 * motor / 360 + 0.05 * math.cos(t), 1000 * math.cos(0.7 * t) + a


def wide():
    columns = {"time_s": [k / RATE for k in range(N)]}
    for a, position in enumerate(POSITIONS):
        rows = [sample(k, a) for k in range(N)]
        columns[f"{position}_motor_deg"] = [r[1] for r in rows]
        columns[f"{position}_screw_mm"] = [r[2] for r in rows]
        columns[f"{position}_load_n"] = [r[3] for r in rows]
    return columns


def by_position():
    rows = [(sample(k, a), p) for k in range(N) for a, p in enumerate(POSITIONS)]
    names = ["time_s", "motor_deg", "screw_mm", "load_n"]
    columns = {name: [r[i] for r, _ in rows] for i, name in enumerate(names)}
    return columns | {"actuator": [p for _, p in rows]}


def by_channel(positions_in_names):
    columns = {"time_s": [], "parameter": [], "value": []} | ({} if positions_in_names else {"actuator": []})
    for k in range(N):
        for a, position in enumerate(POSITIONS):
            r = sample(k, a)
            for i, name in enumerate(["motor_deg", "screw_mm", "load_n"], 1):
                columns["time_s"].append(r[0])
                columns["parameter"].append(f"{position}_{name}" if positions_in_names else name)
                columns["value"].append(r[i])
                if not positions_in_names:
                    columns["actuator"].append(position)
    return columns


def arrow_files():
    import numpy as np
    import pyarrow as pa
    import pyarrow.parquet as pq

    table = pa.table(wide())
    for codec in ["none", "snappy", "zstd", "lz4", "gzip", "brotli"]:
        pq.write_table(table, HERE / f"pyarrow_{codec}.parquet", compression=codec)
    pq.write_table(table, HERE / "pyarrow_pages2.parquet", data_page_version="2.0", write_page_checksum=True,
                   use_dictionary=False, column_encoding="BYTE_STREAM_SPLIT", compression="zstd", row_group_size=150)
    pq.write_table(table, HERE / "pyarrow_checked.parquet", write_page_checksum=True, compression="zstd")
    kinds = {"time_s": pa.array(wide()["time_s"])}
    for position in POSITIONS:
        for name, kind in [("motor_deg", "f32"), ("screw_mm", "count"), ("load_n", "decimal")]:
            values = wide()[f"{position}_{name}"]
            if kind == "f32":
                array = pa.array(values, pa.float32()).dictionary_encode()
            elif kind == "count":  # 0.001 mm to the count, from -20 mm
                array = pa.array([round((v + 20) / 0.001) for v in values], pa.uint16())
            else:
                array = pa.array([decimal.Decimal(f"{v:.3f}") for v in values], pa.decimal128(12, 3))
            kinds[f"{position}_{name}"] = array
    pq.write_table(pa.table(kinds), HERE / "pyarrow_types.parquet")
    half = {k: pa.array(np.array(v, np.float16 if "load" in k else np.float64)) for k, v in wide().items()}
    pq.write_table(pa.table(half), HERE / "pyarrow_half.parquet")

    pq.write_table(pa.table(by_position()), HERE / "layout_by_position.parquet")
    pq.write_table(pa.table(by_channel(True)), HERE / "layout_by_channel.parquet")
    long = pa.table(by_channel(False))
    long = long.set_column(1, "parameter", long["parameter"].dictionary_encode())
    pq.write_table(long, HERE / "layout_by_channel_and_position.parquet")

    # A struct for each actuator.
    rows = [[dict(zip(["motor_deg", "screw_mm", "load_n"], sample(k, a)[1:])) for k in range(N)] for a in range(2)]
    pq.write_table(pa.table({"time_s": wide()["time_s"], "left": rows[0], "right": rows[1]}), HERE / "layout_structs.parquet")
    # A row for each second, a list of a hundred samples in it.
    bursts = {"time_s": [float(s) for s in range(4)]}
    for name, values in wide().items():
        if name != "time_s":
            bursts[name] = [values[100 * s:100 * (s + 1)] for s in range(4)]
    pq.write_table(pa.table(bursts), HERE / "layout_lists.parquet")
    # A row for each actuator, with its whole flight as a list of records.
    flights = [[dict(zip(["t", "motor_deg", "screw_mm", "load_n"], sample(k, a))) for k in range(N)] for a in range(2)]
    pq.write_table(pa.table({"actuator": POSITIONS, "samples": flights}), HERE / "layout_records.parquet")
    # One file for each actuator, in Hive's folders; and the loads in a file of their own, at 50 Hz.
    for a, position in enumerate(POSITIONS):
        folder = HERE / "hive" / "tail=N1" / "off=2026-11-19T04%3A13%3A00Z" / f"actuator={position}"
        folder.mkdir(parents=True, exist_ok=True)
        own = pa.table({name: [sample(k, a)[i] for k in range(N)] for i, name in enumerate(["time_s", "motor_deg", "screw_mm", "load_n"])})
        pq.write_table(own, folder / "part-0.parquet")
    positions = pa.table({k: v for k, v in wide().items() if "load" not in k})
    pq.write_table(positions, HERE / "group_positions.parquet")
    loads = pa.table({k: v[::2] for k, v in wide().items() if "load" in k or k == "time_s"})
    pq.write_table(loads, HERE / "group_loads.parquet")


def other_files():
    import duckdb
    import pandas as pd
    import polars as pl

    frame = pl.DataFrame(wide())
    for codec in ["zstd", "lz4", "snappy"]:
        frame.write_parquet(HERE / f"polars_{codec}.parquet", compression=codec)
    table = pd.DataFrame(wide())
    table.to_parquet(HERE / "pandas_pyarrow.parquet")
    table.to_parquet(HERE / "pandas_fastparquet.parquet", engine="fastparquet")
    for codec in ["snappy", "zstd"]:
        duckdb.sql(f"COPY (SELECT * FROM frame) TO '{HERE}/duckdb_{codec}.parquet' (FORMAT parquet, CODEC '{codec}')")


def spark_files():
    from pyspark.sql import SparkSession

    spark = SparkSession.builder.master("local[1]").config("spark.ui.enabled", "false").getOrCreate()
    columns = wide()
    rows = list(zip(*columns.values()))
    frame = spark.createDataFrame(rows, list(columns)).coalesce(1)
    for codec in ["snappy", "zstd", "gzip"]:
        folder = HERE / f"spark_{codec}"
        frame.write.mode("overwrite").option("compression", codec).parquet(str(folder))
        part = next(folder.glob("part-*.parquet"))
        shutil.move(part, HERE / f"spark_{codec}.parquet")
        shutil.rmtree(folder)
    spark.stop()


if "--spark" in sys.argv:
    spark_files()
else:
    arrow_files()
    other_files()
