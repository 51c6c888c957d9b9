select * from read_parquet('${data}/log_errors.parquet')
