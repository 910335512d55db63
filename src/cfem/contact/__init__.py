"""Contact at a few points, on one linearisation: who is open, who sticks and who slides, and with what force;
and how far points are from rigid obstacles. Knows matrices and vectors only."""

from pathlib import Path

from cfem.core.cache import place_compiled_code

place_compiled_code(Path(__file__).parent)
