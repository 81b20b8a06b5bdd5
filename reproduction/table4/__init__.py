"""Table 4: where vision-based and joint space control end, Tests 1 to 3."""
