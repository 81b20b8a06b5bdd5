"""Figures 10 to 15: errors, tensions and dbeta of the paper's tests, on robot and simulator."""
