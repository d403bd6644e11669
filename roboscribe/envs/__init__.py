"""Simulated tasks: MuJoCo scenes on one batched engine, and a kinematic toy world."""
