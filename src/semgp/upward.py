"""Which way is up: the axis of a world that points upwards, by its name."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Literal, TypeAlias, cast, get_args

from semgp.errors import InputError

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    F64: TypeAlias = NDArray[np.float64]

Up: TypeAlias = Literal["x", "y", "z", "-x", "-y", "-z"]
"""An axis and its sign: "z" in ROS REP-103 and in most maps, "-y" in a world that is a camera's optical frame."""


def direction(up: str) -> F64:
    """Return the upward direction (3,), of length one.

    Raises
    ------
    InputError
        What names no axis.
    """
    import numpy as np

    axis = np.zeros(3)
    axis[vertical(up)] = -1.0 if up.startswith("-") else 1.0
    return axis


def vertical(up: str) -> int:
    """Return the axis of gravity: 0, 1 or 2 for x, y or z.

    Raises
    ------
    InputError
        What names no axis.
    """
    if up not in get_args(Up):
        raise InputError(f"up is one of {', '.join(get_args(Up))}, not {up!r}.")
    return "xyz".index(up[-1])


def level(up: str) -> F64:
    """Return the rotation (3, 3) from a world to a level frame, whose z points up: the identity for "z".

    The other axes follow in a circle, so that a camera's optical frame ("-y") is turned to the body's frame of
    ROS REP-103: x forward, y left.

    Raises
    ------
    InputError
        What names no axis.
    """
    import numpy as np

    k = vertical(up)
    R, sign = np.zeros((3, 3)), direction(up)[k]
    R[0, (k + 1) % 3], R[1, (k + 2) % 3], R[2, k] = 1.0, sign, sign
    return R


def up_of_cameras(poses: Sequence[F64]) -> Up:
    """Return the axis nearest to what the cameras of a recording hold upwards on average.

    People and robots hold cameras upright: the y axis of their optical frames points down.

    Parameters
    ----------
    poses : sequence of (4, 4) arrays
        At least one `T_world_sensor` of an optical frame (x right, y down, z forward).
    """
    import numpy as np

    upward = -np.mean([T[:3, 1] for T in poses], axis=0)
    axis = int(np.abs(upward).argmax())
    return cast("Up", ("-" if upward[axis] < 0 else "") + "xyz"[axis])
