"""Figure 16: errors and velocities of the 98 m robot with four cable models."""
