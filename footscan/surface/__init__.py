"""Cloud to closed mesh; decimation; texture."""
