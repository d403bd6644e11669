"""Any environment of the installed robosuite as a task."""
