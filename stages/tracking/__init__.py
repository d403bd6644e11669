"""What happened in a run: its event log, and its copy in MLflow."""
