"""Opens a store with every installed engine and compares the row counts.

    pip install polars deltalake duckdb pysail pyspark-client
    python docs/store_elsewhere.py results

Spark itself reads Delta with its package (`io.delta:delta-spark`); Sail speaks Spark's protocol without Java.
"""

import sys
from importlib.util import find_spec

ASKED = "count(*), count(distinct concat(departure_utc, tail_number, flight_id, position))"


def polars(gaps):
    import polars

    rows = polars.scan_delta(gaps)
    keys = ["departure_utc", "tail_number", "flight_id", "position"]
    return rows.select(polars.len()).collect().item(), rows.select(keys).unique().collect().height


def duckdb(gaps):
    import deltalake
    import duckdb

    files = deltalake.DeltaTable(gaps).file_uris()
    return duckdb.sql(f"select {ASKED} from read_parquet({files!r})").fetchall()[0]


def sail(gaps):
    from pysail.spark import SparkConnectServer
    from pyspark.sql import SparkSession

    server = SparkConnectServer()
    server.start()
    spark = SparkSession.builder.remote(f"sc://localhost:{server.listening_address[1]}").getOrCreate()
    spark.read.format("delta").load(gaps).createOrReplaceTempView("gaps")
    answer = tuple(spark.sql(f"select {ASKED} from gaps").collect()[0])
    spark.stop()
    server.stop()
    return answer


def main(store):
    engines = {"polars": (polars, ["polars", "deltalake"]), "duckdb": (duckdb, ["duckdb", "deltalake"])}
    engines["sail"] = (sail, ["pysail", "pyspark"])
    answers = {}
    for name, (ask, needs) in engines.items():
        if all(find_spec(need) for need in needs):
            answers[name] = ask(f"{store}/gaps")
            print(f"{name:8} {answers[name][0]} rows, {answers[name][1]} of them different")
        else:
            print(f"{name:8} not installed")
    agree = len(set(answers.values())) <= 1
    return 0 if agree and all(rows == different for rows, different in answers.values()) else 1


if __name__ == "__main__":
    sys.exit(main(sys.argv[1]))
