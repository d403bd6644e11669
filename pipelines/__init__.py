"""The pipeline: stages chained by Algorithm 1, with or without Prefect, and the command line."""
