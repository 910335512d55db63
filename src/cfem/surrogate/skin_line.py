"""What training says of the skin."""

from typing import Any

from cfem.core.console.shown import length


def skin_line(skin: dict[str, Any]) -> str:
    """Line about the results' "skin": the errors with all modes, and with fewer."""
    share, count, largest = skin["largest_percent_of_length"], skin["modes"], length(skin["largest_mm"])
    few = sorted({max(1, count // 4), max(1, count // 2)} - {count}) if "front" in skin else []
    fewer = "".join(f"; with {number} modes {length(skin['front']['largest_mm'][number])}" for number in few)
    return (
        f"skin: the largest error of {skin['nodes']} surface nodes is {largest} ({share:.2g} % of the length), "
        f"{length(skin['rms_mm'])} rms, with {count} modes{fewer or skin.get('of', '')}"
    )
