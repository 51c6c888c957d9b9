"""A run through Spark Connect, the protocol of Databricks serverless; Sail serves it without Java.

A process of its own: one that has met classic Spark cannot speak to a remote one.
"""

from __future__ import annotations

import sys

import freeplay_ema as fp
import freeplay_ema.spark
from pysail.spark import SparkConnectServer
from pyspark.sql import SparkSession

server = SparkConnectServer()
server.start()
spark = SparkSession.builder.remote(f"sc://localhost:{server.listening_address[1]}").getOrCreate()
account = fp.spark.run(spark, None, "pipeline.toml", sys.argv[1], logs_per_job=20)
spark.stop()
server.stop()
print(account["done"], account["estimated"], len(account["errors"]), account["not_reached"])
