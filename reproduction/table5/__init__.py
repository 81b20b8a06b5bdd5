"""Table 5: vision-based control with a sagging and a straight cable model, Tests 4 and 5."""
