"""Entry point of the `cfem` script, and `python -m cfem`."""

import os
import signal
from typing import Any

from cfem.core.interrupts import ENDS


def main() -> None:
    """Signals first: what takes time to import may be interrupted as well."""
    for number in ENDS:
        if signal.getsignal(number) != signal.SIG_IGN:
            signal.signal(number, _leave)
    from cfem.cli.app import app
    from cfem.cli.run import stdout_errors

    with stdout_errors():
        app()


def _leave(number: int, frame: Any) -> None:
    """Nothing has begun yet; exceptions raised in the middle of an import end in anything."""
    os.write(2, b"cfem: interrupted\n")
    os._exit(130)


if __name__ == "__main__":
    main()
