select * from read_parquet('${data}/changes.parquet')
