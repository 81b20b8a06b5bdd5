"""How fast a robot may move before its cables, static in the paper and here, would vibrate."""
