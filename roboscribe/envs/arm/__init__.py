"""Robot arms that are driven by torques: kinematics, inertia and operational-space control of many copies at once."""
