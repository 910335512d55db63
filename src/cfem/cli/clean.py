"""`cfem clean`: what was set aside, how much room it takes, and what of it is deleted."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from cfem.core.artefact.set_aside import COPY, COSTLY, remove, set_asides
from cfem.core.artefact.verify import ROOTS
from cfem.core.console.shown import size

PIPELINES = Path("pipelines")


def clean(folders: Sequence[Path], delete: bool, dear: bool, as_json: bool) -> dict[str, Any] | str:
    """Lines or JSON data about what was set aside. delete: what is a copy or cheap to make; dear: what took long to
    compute, too. What cfem did not make alone always stays."""
    roots = list(folders) or [root for root in (*ROOTS, PIPELINES) if root.is_dir()]
    set_aside = set_asides(roots)
    goes = [aside for aside in set_aside if aside.worth == COPY or (dear and aside.worth == COSTLY)]
    if delete:
        for aside in goes:
            remove(aside)
    if as_json:
        listed = [vars(aside) | {"path": str(aside.path), "deleted": delete and aside in goes} for aside in set_aside]
        return {"set_aside": listed, "bytes": sum(aside.bytes for aside in set_aside)}
    if not set_aside:
        return "nothing is set aside"
    width = max(len(str(aside.path)) for aside in set_aside)
    lines = []
    for aside in set_aside:
        fate = "keeps" if aside not in goes else "deleted" if delete else "would delete"
        lines.append(f"{aside.path!s:<{width}}  {size(aside.bytes):>10}  {fate}: {aside.why}")
    freed, taken = sum(aside.bytes for aside in goes), sum(aside.bytes for aside in set_aside)
    lines.append(f"{size(taken)} in all; {size(freed)} {'deleted' if delete else 'with --delete'}")
    costly = sum(aside.bytes for aside in set_aside if aside.worth == COSTLY)
    if costly and not dear:
        lines[-1] += f"; {size(costly)} more with --delete --dear, which took long to compute"
    return "\n".join(lines)
