"""Arrays that compiled code borrows, without counting who refers to them.

numba counts references to every array that a function is given, by atomic steps: where a kernel
calls small functions with many arrays that takes longer than the work, and where several threads
share the arrays they wait for each other at each step.
"""

from collections.abc import Callable
from typing import Any, cast

import numba.extending
from numba.core import cgutils, types
from numba.np.arrayobj import make_array


def _borrowed(typing_context: Any, array: Any) -> Any:  # noqa: ANN401 - numba's own
    del typing_context
    if not isinstance(array, types.Array):
        return None

    def code(context: Any, builder: Any, signature: Any, args: Any) -> Any:  # noqa: ANN401
        kind = make_array(signature.return_type)
        found = kind(context, builder, value=args[0])
        found.meminfo = cgutils.get_null_value(found.meminfo.type)
        found.parent = cgutils.get_null_value(found.parent.type)
        return found._getvalue()  # noqa: SLF001 - numba's own name

    return array(array), code


borrowed = cast("Callable[[Any], Any]", numba.extending.intrinsic(_borrowed))
"""Return the same array as one that nobody counts references to.

Whoever calls the kernel keeps it alive meanwhile, and the kernel returns nothing of it.
"""
