"""What happened in a run: its chronicle, and the copy of it in MLflow."""
