select * from read_parquet('${data}/removals.parquet')
