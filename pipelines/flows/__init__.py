"""The synthesis and the measurements as Prefect flows, and the server that they run on."""
