"""Which detections of tags are doubtful: false ones seldom come twice."""

from collections.abc import Sequence

import numpy as np

from autonomy.arrays import BoolArray, FloatArray


def doubtful(
    tags: Sequence[str], receivers: Sequence[str], times_s: FloatArray, within_s: float
) -> BoolArray:
    """Tell which detections stand alone: none other of the same tag on the same receiver is near.

    Two collided transmissions may spell a third tag that is nowhere; such a code hardly comes twice
    within 30 delays. Doubtful detections are marked, never dropped.

    Args:
        tags: Transmitter of each detection.
        receivers: Receiver of each.
        times_s: When each was heard, s, in any order.
        within_s: Nearer than this, or as near, is another one near, s.

    Source:
        Pincock, False detections: what they are and how to remove them, Vemco 2012: at least one
        short interval, of 30 delays.
    """
    count = len(times_s)
    if not count:
        return np.zeros(0, dtype=np.bool_)
    tag = np.unique(np.asarray(tags), return_inverse=True)[1]
    receiver = np.unique(np.asarray(receivers), return_inverse=True)[1]
    order = np.lexsort((times_s, receiver, tag))
    is_next_near = (
        (np.diff(tag[order]) == 0)
        & (np.diff(receiver[order]) == 0)
        & (np.diff(times_s[order]) <= within_s)
    )
    near = np.zeros(count, dtype=np.bool_)
    near[:-1] |= is_next_near
    near[1:] |= is_next_near
    alone = np.empty(count, dtype=np.bool_)
    alone[order] = ~near
    return alone
