"""One run of one command, as a value: what it reads, what it makes, and the hash of all that determines the output."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from cfem.core.artefact.content import artefact_content
from cfem.core.artefact.files import content_sha256, plain
from cfem.core.artefact.manifest import harm, read_manifest
from cfem.core.errors import InputError
from cfem.core.kinds import FORMER
from cfem.core.spec import Spec, meaning


@dataclass(frozen=True)
class Stage:
    """One run of one command.

    name:     of the command, e.g. 'train'
    version:  raised when the stage's output changes meaning for the same inputs
    spec:     everything the user chose (values, not spelling, enter the hash; fields in `paths` do not)
    inputs:   artefact folders (with a manifest) or plain files that the stage reads
    out:      the artefact folder that it makes
    paths:    names of top-level spec fields that are paths; what they point to enters through `inputs`
    precious: True where the output costs so much that one from other inputs is kept unless --force, and then moved
              aside rather than deleted
    extra:    what else determines the output: values, or a function that reads them from the inputs
    spec_path, overrides: where the spec is and what --set changed in it, so that it can be read again
    extends:  of the manifest of an older output: whether this one keeps all that it holds, so that it takes its place
    agrees:   SpecError where the spec does not fit the other specs that it names: cheap, and asked before any work"""

    name: str
    version: int
    spec: Spec
    inputs: Mapping[str, Path]
    out: Path
    paths: tuple[str, ...] = ()
    precious: bool = False
    extra: Mapping[str, Any] | Callable[[], Mapping[str, Any]] = field(default_factory=dict)
    spec_path: Path | None = None
    overrides: Sequence[str] = ()
    extends: Callable[[Mapping[str, Any]], bool] = lambda manifest: False
    agrees: Callable[[], None] = lambda: None

    def demand_agreement(self) -> None:
        """Raises SpecError, with its file and line, where the spec does not fit the other specs that it names."""
        with self.spec.locating():
            self.agrees()

    def origin(self, gone: Mapping[str, str] | None = None) -> dict[str, Any]:
        """Plain data of all that determines the output. gone: content hashes of inputs, for those that are not there;
        InputError where there is none."""
        extra = self.extra() if callable(self.extra) else self.extra
        return plain(
            {
                "stage": FORMER.get(self.name, self.name),
                "version": self.version,
                "spec": meaning(self.spec, self.paths),
                "inputs": {
                    name: gone[name] if gone and name in gone and not path.exists() else artefact_content(path)
                    for name, path in self.inputs.items()
                },
                "extra": dict(extra),
            }
        )

    def made_from(self) -> str:
        """Content hash of all that determines the output."""
        return content_sha256(self.origin())

    def extended(self) -> bool:
        """True where the output that is there is whole, and this run keeps all that it holds."""
        try:
            manifest = read_manifest(self.out)
        except InputError:
            return False
        return self.extends(manifest) and not harm(self.out, manifest)
