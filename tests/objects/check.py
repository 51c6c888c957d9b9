"""The command's rows over an S3 server that misbehaves are those over local files, bit by bit.

Usage: check.py FREEPLAY WORK [NAME...]: the binary, a scratch folder, and the names of tests to run (all by default).
"""

import csv
import io
import json
import logging
import os
import subprocess
import sys
import threading
import time
from pathlib import Path

import boto3
from moto.server import ThreadedMotoServer

import endless
from unreliable import Proxy

TOP = Path(__file__).resolve().parents[2]
FLEET = TOP / "tests/data/three-aircraft"
SEEDS = (1, 2, 3)
SHARE = 0.15
KEYS = int(os.environ.get("KEYS", "100000"))
OF_A_RUN = {"run_id", "processed_utc", "log_path"}


class Bench:
    """An S3 server with the small fleet in it, a bad line to it, and the command."""

    def __init__(self, freeplay, work):
        self.freeplay, self.work = Path(freeplay), Path(work)
        logging.getLogger("werkzeug").setLevel(logging.ERROR)
        server = ThreadedMotoServer(ip_address="127.0.0.1", port=0)
        server.start()
        address = server.get_host_and_port()
        self.line = Proxy(address)
        self.s3 = boto3.client(
            "s3",
            endpoint_url="http://{}:{}".format(*address),
            aws_access_key_id="key",
            aws_secret_access_key="secret",
            region_name="us-east-1",
        )
        self.s3.create_bucket(Bucket="fleet")
        self.logs = sorted((FLEET / "sample-data/logs").glob("*/*.parquet"))
        for log in self.logs:
            self.put(f"logs/{log.parent.name}/{log.name}", log.read_bytes())
        self.put("installations.csv", (FLEET / "sample-data/installations.csv").read_bytes())
        self.put("logs/readme.txt", b"no log")

    def put(self, key, content):
        self.s3.put_object(Bucket="fleet", Key=key, Body=content)

    def folder(self, name, logs="sample-data", store="results"):
        """A folder with a configuration: logs beside it or in the bucket, results likewise."""
        folder = self.work / name
        folder.mkdir()
        text = (FLEET / "pipeline.toml").read_text()
        text = text.replace('"sample-data/logs/**/*.parquet"', f'"{logs}/logs/**/*.parquet"')
        text = text.replace('"sample-data/installations.csv"', f'"{logs}/installations.csv"')
        text = text.replace('path = "results"', f'path = "{store}"')
        (folder / "pipeline.toml").write_text(text + "\n[objects]\ntimeout_s = 1\ngive_up_s = 60\n")
        if logs == "sample-data":
            (folder / "sample-data").symlink_to(FLEET / "sample-data")
        return folder

    def env(self, **more):
        kept = {k: v for k, v in os.environ.items() if not k.startswith(("AWS_", "FREEPLAY_"))}
        ours = {
            "AWS_ENDPOINT_URL": self.line.url,
            "AWS_ACCESS_KEY_ID": "key",
            "AWS_SECRET_ACCESS_KEY": "secret",
            "AWS_REGION": "us-east-1",
            "HOME": str(self.work),
        }
        return {k: v for k, v in {**kept, **ours, **more}.items() if v is not None}

    def start(self, folder, *args, **more):
        command = [self.freeplay, *args]
        return subprocess.Popen(
            command, cwd=folder, env=self.env(**more), stdin=subprocess.DEVNULL, stdout=-1, stderr=-1, text=True
        )

    def run(self, folder, *args, code=0, **more):
        """What the command answers, when it ends with this code."""
        process = self.start(folder, *args, **more)
        out, err = process.communicate(timeout=300)
        assert process.returncode == code, f"{args}: code {process.returncode}\n{out}\n{err}"
        return out if code == 0 else out + err

    def exported(self, folder):
        """Every record, without what differs between two runs of the same logs."""
        rows = csv.DictReader(io.StringIO(self.run(folder, "store", "export", "--format", "csv")))
        return [{k: v for k, v in row.items() if k not in OF_A_RUN} for row in rows]


def local_rows(bench):
    folder = bench.work / "local"
    if not folder.exists():
        bench.run(bench.folder("local"), "run")
    rows = bench.exported(folder)
    assert len(rows) > 10
    return rows


def logs_over_a_bad_line_give_the_rows_of_local_logs(bench):
    wanted = local_rows(bench)
    injected = {}
    for seed in SEEDS:
        folder = bench.folder(f"bad-line-{seed}", logs="s3://fleet")
        bench.line.spoil(SHARE, seed)
        bench.run(folder, "run")
        for fault, count in bench.line.faults().items():
            injected[fault] = injected.get(fault, 0) + count
        bench.line.spoil(0, 0)
        assert bench.exported(folder) == wanted
    assert len(injected) >= 5, f"hardly any fault was injected: {injected}"
    return f"{len(wanted)} rows the same, {len(SEEDS)} times, through {sum(injected.values())} faults: {injected}"


def only_the_needed_columns_are_fetched(bench):
    """A log with forty columns nobody asks for, of incompressible values, beside the needed ones."""
    import pyarrow.parquet as pq
    import numpy as np

    source = pq.read_table(bench.logs[0])
    stated = {k: v for k, v in pq.read_metadata(bench.logs[0]).metadata.items() if k != b"ARROW:schema"}
    noise = np.random.default_rng(1)
    needed = source.num_columns
    wide = source
    for column in range(40):
        wide = wide.append_column(f"other_{column}", [noise.random(source.num_rows)])
    file = bench.work / "wide.parquet"
    pq.write_table(wide.replace_schema_metadata(stated), file, row_group_size=200_000)
    chunks = pq.ParquetFile(file).metadata
    of_needed = sum(
        chunks.row_group(g).column(c).total_compressed_size
        for g in range(chunks.num_row_groups)
        for c in range(needed)
    )
    bench.put("wide/wide.parquet", file.read_bytes())
    folder = bench.folder("wide", logs="s3://fleet")
    bench.line.spoil(0, 0)
    rows = json.loads(bench.run(folder, "estimate", "s3://fleet/wide/wide.parquet", "--json"))
    assert rows and all(row["status"] == "estimated" for row in rows)
    fetched, size = bench.line.body_bytes("wide.parquet"), file.stat().st_size
    footer_at_most = 65_536 + 8
    hole_at_most = chunks.num_row_groups * (1 << 20)
    assert fetched <= of_needed + footer_at_most + hole_at_most, (fetched, of_needed)
    assert fetched < size / 4, (fetched, size)
    whole = json.loads(bench.run(bench.folder("narrow"), "estimate", str(bench.logs[0]), "--json"))
    assert [row["gap_m"] for row in rows] == [row["gap_m"] for row in whole]
    return f"{fetched} of {size} bytes fetched; the needed columns have {of_needed}"


def what_is_known_is_not_fetched_again(bench):
    """The second run lists; one key with new content is the only one that is opened."""
    folder = bench.folder("known", logs="s3://fleet")
    bench.line.spoil(0, 0)
    bench.run(folder, "run")
    bench.line.spoil(0, 0)
    assert f"0 new or changed, {len(bench.logs)} already processed" in bench.run(folder, "run")
    assert bench.line.body_bytes(".parquet") == 0
    asked = [r for r in bench.line.requests if r.path.split("?")[0].endswith(".parquet")]
    assert not asked, "a known object was asked for by itself"
    key = f"logs/{bench.logs[0].parent.name}/{bench.logs[0].name}"
    bench.put(key, bench.logs[1].read_bytes())
    plan = bench.run(folder, "run", "--dry-run")
    bench.put(key, bench.logs[0].read_bytes())
    assert "content changed" in plan, plan
    return f"{len(bench.logs)} known logs cost {len(bench.line.requests)} requests"


def a_store_that_is_down_is_told_with_a_remedy(bench):
    folder = bench.folder("down", logs="s3://fleet")
    text = (folder / "pipeline.toml").read_text().replace("give_up_s = 60", "give_up_s = 2")
    (folder / "pipeline.toml").write_text(text)
    down = bench.run(folder, "run", code=2, AWS_ENDPOINT_URL="http://127.0.0.1:9")
    assert "error[object_unreachable]" in down and "is the network up" in down, down
    assert not (folder / "results").exists()
    gone = bench.run(folder, "estimate", "s3://fleet/logs/gone.parquet", code=1)
    assert "error[object_missing]" in gone and "s3://fleet/logs/gone.parquet" in gone, gone
    tls = bench.run(folder, "estimate", "s3://fleet/logs/a.parquet", code=2, AWS_ENDPOINT_URL="https://127.0.0.1:9")
    assert "error[object_unreachable]" in tls, tls
    profile = bench.run(folder, "run", code=2, AWS_PROFILE="hangar")
    assert "no profile `hangar`" in profile, profile
    return "each with its code, address and remedy"


def keys_come_from_a_profile_too(bench):
    (bench.work / ".aws").mkdir(exist_ok=True)
    (bench.work / ".aws/credentials").write_text(
        "[hangar]\naws_access_key_id = hangar-key\naws_secret_access_key = secret\n"
    )
    folder = bench.folder("profile", logs="s3://fleet")
    nothing = dict(AWS_ACCESS_KEY_ID=None, AWS_SECRET_ACCESS_KEY=None)
    bench.line.spoil(0, 0)
    bench.run(folder, "run", AWS_PROFILE="hangar", **nothing)
    return "rows were made with the keys of a profile"


def a_store_in_a_bucket_is_the_local_one_over_a_bad_line(bench):
    wanted, injected = local_rows(bench), 0
    for seed in SEEDS[:2]:
        folder = bench.folder(f"bucket-{seed}", logs="s3://fleet", store=f"s3://fleet/store-{seed}")
        bench.line.spoil(SHARE, seed)
        bench.run(folder, "run")
        assert bench.exported(folder) == wanted
        assert "OK: all data files present" in bench.run(folder, "store", "verify")
        injected += sum(bench.line.faults().values())
    return f"{len(wanted)} rows written, read and verified twice, through {injected} faults"


def every_reader_reads_a_store_in_a_bucket(bench):
    folder = bench.folder("readers", store="s3://fleet/readers")
    local_rows(bench)
    bench.line.spoil(0, 0)
    assert "Dry run" in bench.run(folder, "run", "--dry-run")
    for wave in ("2026-09-25", "2026-10-10", "2026-12-01"):
        bench.run(folder, "run", "--until", wave)
    for question in (
        ("query", "tail", "N412FP", "--json"),
        ("query", "serial", "1040-0009", "--json"),
        ("trend", "--json"),
    ):
        here, there = (json.loads(bench.run(f, *question)) for f in (folder, bench.work / "local"))
        for rows in (here, there):
            for row in rows:
                for name in OF_A_RUN:
                    row.pop(name, None)
        assert here == there and here, question
    files = len(bench.run(folder, "store", "files").split())
    assert "merged" in bench.run(folder, "store", "compact")
    after = bench.run(folder, "store", "files").split()
    assert len(after) < files and all(f.startswith("s3://fleet/readers/gaps/") for f in after), after
    assert "OK: all data files present" in bench.run(folder, "store", "verify")
    assert bench.exported(folder) == local_rows(bench)
    info = json.loads(bench.run(folder, "store", "info", "--json"))
    assert info["path"] == "s3://fleet/readers" and info["records"] == len(local_rows(bench))
    bench.run(folder, "report", "--output", "report")
    assert (folder / "report/index.html").exists()
    bench.s3.delete_object(Bucket="fleet", Key=after[0].removeprefix("s3://fleet/"))
    broken = bench.run(folder, "store", "verify", code=1)
    assert "error[store_file_missing]" in broken and after[0] in broken, broken
    return f"query, trend, report, info, export, verify, and {files} files compacted to {len(after)}"


def two_runs_at_once_store_every_flight_once(bench):
    for name in ("twin-a", "twin-b"):
        bench.folder(name, logs="s3://fleet", store="s3://fleet/twins")
    bench.line.spoil(0, 0)
    first, second = (bench.start(bench.work / name, "run", "--jobs", "1") for name in ("twin-a", "twin-b"))
    ended = [process.communicate(timeout=300) + (process.returncode,) for process in (first, second)]
    assert [code for *_, code in ended] == [0, 0], ended
    folder = bench.work / "twin-a"
    assert bench.exported(folder) == local_rows(bench)
    assert "OK: all data files present" in bench.run(folder, "store", "verify")
    runs = json.loads(bench.run(folder, "store", "runs", "--json"))
    assert [run["ended"] for run in runs] == ["well", "well"], runs
    done = [run["done"] for run in runs]
    return f"runs that did {done[0]} and {done[1]} of {len(bench.logs)} logs left {len(bench.logs)} flights, each once"


def a_run_that_is_killed_leaves_whole_flights(bench):
    folder = bench.folder("killed", logs="s3://fleet", store="s3://fleet/killed")
    bench.line.spoil(0, 0)
    process = bench.start(folder, "run", "--jobs", "1")
    committed = lambda: [
        r for r in bench.line.requests if r.method == "PUT" and "/killed/gaps/_delta_log/" in r.path and r.status == 200
    ]
    deadline = time.monotonic() + 120
    while len(committed()) < 2 and process.poll() is None and time.monotonic() < deadline:
        time.sleep(0.002)
    assert process.poll() is None, "the run was over before it could be killed"
    process.kill()
    process.communicate()
    flights = {row["flight_id"]: 0 for row in bench.exported(folder)}
    for row in bench.exported(folder):
        flights[row["flight_id"]] += 1
    of_flight = {}
    for row in local_rows(bench):
        of_flight[row["flight_id"]] = of_flight.get(row["flight_id"], 0) + 1
    assert flights and all(of_flight[flight] == count for flight, count in flights.items())
    bench.run(folder, "run")
    assert bench.exported(folder) == local_rows(bench)
    return f"killed after {len(flights)} of {len(of_flight)} flights; the next run did the rest"


def a_listing_takes_no_more_memory_the_longer_it_is(bench):
    folder = bench.folder("endless", logs="s3://fleet")
    text = (folder / "pipeline.toml").read_text()
    text = text.replace("s3://fleet/installations.csv", str(FLEET / "sample-data/installations.csv"))
    text = text.replace("logs/**/*.parquet", "logs/**/00000007.parquet")
    (folder / "pipeline.toml").write_text(text)

    def peak_mib(keys):
        process = bench.start(folder, "run", "--dry-run", AWS_ENDPOINT_URL=endless.serve(keys))
        _, status, used = os.wait4(process.pid, 0)
        out = process.stdout.read()
        assert os.waitstatus_to_exitcode(status) == 0, process.stderr.read()
        assert "1 log of 1 would be processed (0 up to date)" in out, out
        return used.ru_maxrss / 1024

    few, many = peak_mib(1_000), peak_mib(KEYS)
    assert many < few + 16, (few, many)
    return f"peak {few:.0f} MiB for 1000 keys, {many:.0f} MiB for {KEYS}"


def a_table_in_a_bucket_is_read_by_its_log(bench):
    """Three flights of one tail were added and one was withdrawn; the pattern names the table, a part of it, or a file."""
    logs = [log for log in bench.logs if log.parent.name == "N412FP"][:3]
    names = [f"part=1/{log.name}" for log in logs]
    for name, log in zip(names, logs):
        bench.put(f"lake/table/{name}", log.read_bytes())
    schema = '{"type":"struct","fields":[{"name":"time_s","type":"double","nullable":true,"metadata":{}}]}'
    first = [
        {"protocol": {"minReaderVersion": 1, "minWriterVersion": 2}},
        {
            "metaData": {
                "id": "af23c9d7-fff1-4a5a-a2c8-55c59bd782aa",
                "format": {"provider": "parquet", "options": {}},
                "schemaString": schema,
                "partitionColumns": [],
                "configuration": {},
            }
        },
    ]
    add = lambda name, log: {
        "add": {
            "path": name.replace("=", "%3D"),
            "partitionValues": {},
            "size": log.stat().st_size,
            "modificationTime": 0,
            "dataChange": True,
        }
    }
    first += [add(name, log) for name, log in zip(names, logs)]
    remove = {"remove": {"path": names[1].replace("=", "%3D"), "deletionTimestamp": 0, "dataChange": True}}
    for version, entries in enumerate((first, [remove])):
        text = "".join(json.dumps(entry) + "\n" for entry in entries)
        bench.put(f"lake/table/_delta_log/{version:020}.json", text.encode())
    bench.line.spoil(0, 0)
    for number, pattern in enumerate(("lake/**/*.parquet", "lake/table/part=1/*.parquet", f"lake/table/{names[1]}")):
        folder = bench.folder(f"table-{number}", logs="s3://fleet")
        text = (folder / "pipeline.toml").read_text().replace("logs/**/*.parquet", pattern)
        (folder / "pipeline.toml").write_text(text)
        if number == 2:
            assert "error[no_log_matched]" in bench.run(folder, "run", code=2)
        else:
            assert "8 records of 2 flights" in bench.run(folder, "run")
    return "the withdrawn flight is in no store"


TESTS = [
    logs_over_a_bad_line_give_the_rows_of_local_logs,
    only_the_needed_columns_are_fetched,
    a_table_in_a_bucket_is_read_by_its_log,
    what_is_known_is_not_fetched_again,
    a_store_that_is_down_is_told_with_a_remedy,
    keys_come_from_a_profile_too,
    a_listing_takes_no_more_memory_the_longer_it_is,
    a_store_in_a_bucket_is_the_local_one_over_a_bad_line,
    every_reader_reads_a_store_in_a_bucket,
    two_runs_at_once_store_every_flight_once,
    a_run_that_is_killed_leaves_whole_flights,
]


def main():
    freeplay, work, *names = sys.argv[1:]
    bench = Bench(freeplay, work)
    for test in TESTS:
        if names and test.__name__ not in names:
            continue
        clock = time.monotonic()
        said = test(bench)
        print(f"{test.__name__.replace('_', ' ')}: {said} ({time.monotonic() - clock:.1f} s)", flush=True)


if __name__ == "__main__":
    main()
    os._exit(0)
