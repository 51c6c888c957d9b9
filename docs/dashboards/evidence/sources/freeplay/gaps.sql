select * from read_parquet('${data}/gaps.parquet')
