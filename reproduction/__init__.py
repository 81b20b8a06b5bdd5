"""The paper's tables and figures, made again: printed numbers beside ours."""
