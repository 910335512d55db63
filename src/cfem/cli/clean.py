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
    goes = [each for each in set_aside if each.worth == COPY or (dear and each.worth == COSTLY)]
    if delete:
        for each in goes:
            remove(each)
    if as_json:
        listed = [vars(each) | {"path": str(each.path), "deleted": delete and each in goes} for each in set_aside]
        return {"set_aside": listed, "bytes": sum(each.bytes for each in set_aside)}
    if not set_aside:
        return "nothing is set aside"
    width = max(len(str(each.path)) for each in set_aside)
    lines = []
    for each in set_aside:
        fate = "keeps" if each not in goes else "deleted" if delete else "would delete"
        lines.append(f"{each.path!s:<{width}}  {size(each.bytes):>10}  {fate}: {each.why}")
    freed, taken = sum(each.bytes for each in goes), sum(each.bytes for each in set_aside)
    lines.append(f"{size(taken)} in all; {size(freed)} {'deleted' if delete else 'with --delete'}")
    costly = sum(each.bytes for each in set_aside if each.worth == COSTLY)
    if costly and not dear:
        lines[-1] += f"; {size(costly)} more with --delete --dear, which took long to compute"
    return "\n".join(lines)
