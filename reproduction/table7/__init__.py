"""Table 7: 20 m across a room of 75 x 98 x 38.9 m with four cable models."""
