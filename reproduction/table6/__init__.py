"""Table 6: how the sag of the eight cables grows with the size of the robot."""
