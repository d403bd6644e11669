"""Steps of the pipeline, one per module: files in, one call of the library, files out. They know nothing of Prefect."""
