"""What programs are compared with: policies that see the whole state and know no subgoals (Sec. 5)."""
