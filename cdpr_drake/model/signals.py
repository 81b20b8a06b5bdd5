"""What the entries of a vector signal are called: "pose/yaw", "motor_torques[8]".

Numbers count from 1, as the paper's cables do.
"""

from __future__ import annotations

POSE = ("roll", "pitch", "yaw", "x", "y", "z")
TWIST = ("omega_x", "omega_y", "omega_z", "v_x", "v_y", "v_z")
ERROR = ("rotation_x", "rotation_y", "rotation_z", "x", "y", "z")
WRENCH = ("torque_x", "torque_y", "torque_z", "force_x", "force_y", "force_z")

_SIX = {"pose_error": ERROR, "pose": POSE, "twist": TWIST, "wrench": WRENCH}


def vector_names(name: str, size: int) -> tuple[str, ...]:
    """Return the names of the entries of a vector, by what its port or block is called.

    Args:
        name: of the port or block.
        size: number of entries.
    """
    if size == 12 and name.endswith("platform_state"):
        return tuple(f"{name}/{part}" for part in POSE + TWIST)
    if size == 6:
        for word, parts in _SIX.items():
            if word in name:
                return tuple(f"{name}/{part}" for part in parts)
    if "tangents" in name and size % 3 == 0:
        return tuple(f"{name}[{i // 3 + 1}]/{'xyz'[i % 3]}" for i in range(size))
    return tuple(f"{name}[{i + 1}]" for i in range(size)) if size > 1 else (name,)


def joined(block: str, entry: str) -> str:
    """Return the name of an entry of a block: "block/entry", "block[3]".

    Args:
        block: its path.
        entry: its name there.
    """
    return f"{block}{entry}" if entry.startswith("[") or not entry else f"{block}/{entry}"
