"""The nightly run on a real Spark cluster, of which a worker is killed in the middle; `run` starts the cluster.

The store must be that of one machine, and either side must go on where the other left off.
"""

from __future__ import annotations

import os
import shutil
import signal
import subprocess
import threading
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import freeplay_ema as fp
import freeplay_ema.spark
import pyarrow.parquet as pq
import pyspark
import pytest
from conftest import TOP, Command
from pyspark.sql import SparkSession
from compare_tables import differing

PORT = 7177
OF_A_RUN = {"run_id", "processed_utc"}


@pytest.fixture(scope="module")
def cluster(tmp_path_factory: pytest.TempPathFactory) -> Iterator[list[subprocess.Popen[bytes]]]:
    """A master and two workers of one core each on loopback, every one the head of a process group."""
    home, work = Path(pyspark.__file__).parent, tmp_path_factory.mktemp("cluster")
    env = {**os.environ, "SPARK_HOME": str(home), "SPARK_LOCAL_IP": "127.0.0.1", "SPARK_WORKER_DIR": str(work)}
    log = (work / "cluster.log").open("wb")

    def start(role: str, *args: str) -> subprocess.Popen[bytes]:
        cls = f"org.apache.spark.deploy.{role.lower()}.{role}"
        command = [str(home / "bin/spark-class"), cls, "--host", "127.0.0.1", "--webui-port", "0", *args]
        return subprocess.Popen(command, env=env, stdout=log, stderr=log, start_new_session=True)

    master = start("Master", "--port", str(PORT))
    worker = ("--cores", "1", "--memory", "1g", f"spark://127.0.0.1:{PORT}")
    workers = [start("Worker", *worker), start("Worker", *worker)]
    yield workers
    for process in [*workers, master]:
        if process.poll() is None:
            os.killpg(process.pid, signal.SIGKILL)
        process.wait()


@pytest.fixture(scope="module")
def spark(cluster: list[subprocess.Popen[bytes]]) -> Iterator[SparkSession]:
    builder = SparkSession.builder.master(f"spark://127.0.0.1:{PORT}").appName("freeplay")
    settings = {"spark.ui.enabled": "false", "spark.driver.host": "127.0.0.1", "spark.executor.memory": "512m"}
    for key, value in settings.items():
        builder = builder.config(key, value)
    session = builder.getOrCreate()
    deadline = time.monotonic() + 120
    while len(session.sparkContext._jsc.sc().statusTracker().getExecutorInfos()) < 3:
        assert time.monotonic() < deadline, "the two workers did not come"
        time.sleep(0.2)
    yield session
    session.stop()


@pytest.fixture(scope="module")
def fleet(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The small fleet, one of its logs cut short."""
    folder = tmp_path_factory.mktemp("fleet")
    shutil.copytree(TOP / "tests/data/three-aircraft", folder, dirs_exist_ok=True)
    log = next((folder / "sample-data/logs/N414FP").iterdir())
    (log.parent / "torn.parquet").write_bytes(log.read_bytes()[:5000])
    return folder


@pytest.fixture
def one_machine(fleet: Path, command: Command, monkeypatch: pytest.MonkeyPatch) -> Path:
    """What the command stores of the same logs."""
    monkeypatch.chdir(fleet)
    if not Path("one.parquet").exists():
        command("run", "--config", "pipeline.toml", code=1)
        command("store", "export", "--format", "parquet", "--output", "one.parquet")
        shutil.rmtree("results")
    return Path("one.parquet")


def kill_in_the_middle(spark: SparkSession, worker: subprocess.Popen[bytes], seen: dict[str, int]) -> None:
    """Waits until some tasks of the job are done, then kills a worker with its executor."""
    tracker = spark.sparkContext.statusTracker()
    while True:
        stages: list[Any] = [tracker.getStageInfo(stage) for stage in tracker.getActiveStageIds()]
        for stage in filter(None, stages):
            if stage.numCompletedTasks >= 4:
                os.killpg(worker.pid, signal.SIGKILL)
                seen.update(done=stage.numCompletedTasks, of=stage.numTasks)
                return
        time.sleep(0.02)


def test_a_run_on_spark_with_a_worker_killed_is_that_of_one_machine(
    spark: SparkSession, cluster: list[subprocess.Popen[bytes]], one_machine: Path, command: Command
) -> None:
    seen: dict[str, int] = {}
    killer = threading.Thread(target=kill_in_the_middle, args=(spark, cluster[0], seen), daemon=True)
    killer.start()
    account = fp.spark.run(spark, None, "pipeline.toml")
    killer.join(timeout=60)
    print(f"a worker was killed after {seen['done']} of {seen['of']} tasks")
    assert seen["done"] < seen["of"] - 2 and cluster[0].wait(timeout=10) == -signal.SIGKILL
    assert (account["found"], account["done"], account["not_reached"]) == (31, 31, 0)
    assert [error["complaint"]["code"] for error in account["errors"]] == ["not_parquet"]

    command("store", "verify")
    command("store", "export", "--format", "parquet", "--output", "spark.parquet")
    assert differing(pq.read_table("spark.parquet"), pq.read_table(one_machine), OF_A_RUN) == []
    # The command knows every log, the one in error too, and answers from what Spark wrote.
    assert "31 logs: 0 new or changed, 31 already processed" in command("run", code=1).stdout
    assert command("query", "tail", "N412FP", "--json").stdout.count('"flight_id"') == 40
    shutil.rmtree("results")


def test_spark_goes_on_where_the_command_left_off(
    spark: SparkSession, one_machine: Path, command: Command
) -> None:
    command("run", "--tail", "N412FP", code=1)
    account = fp.spark.run(spark, None, "pipeline.toml")
    assert (account["known"], account["done"], account["errors"]) == (11, 20, [])
    again = fp.spark.run(
        spark, "sample-data/logs/**/*.parquet", "pipeline.toml", "results", logs_per_job=7, redo=True
    )
    assert (again["done"], again["estimated"]) == (31, 120)
    command("store", "verify")
    command("store", "export", "--format", "parquet", "--output", "both.parquet")
    assert differing(pq.read_table("both.parquet"), pq.read_table(one_machine), OF_A_RUN) == []


def test_a_worker_with_other_settings_is_refused(spark: SparkSession, fleet: Path) -> None:
    files, task = (str(fleet / "pipeline.toml"),), ["{}"]
    work = fp.spark._worker(files, "of another configuration", task)
    with pytest.raises(Exception, match="worker_differs"):
        spark.range(0, 1, 1, 1).mapInArrow(work, "result string").collect()
