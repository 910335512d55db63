"""The condensed model of a robot at one state: delta = W lambda + delta_free. All that is downstream consumes this."""

from cfem.condensed.condensed import Condensed
from cfem.condensed.packing import entries, pack_upper, unpack_upper
from cfem.condensed.rows import Rows

__all__ = ["Condensed", "Rows", "entries", "pack_upper", "unpack_upper"]
