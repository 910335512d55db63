"""Runs the notebooks of docs/notebooks and stores what they print, for the site: scripts/notebooks.py [NAME ...]"""

import sys
from pathlib import Path
from tempfile import TemporaryDirectory

import nbformat
from nbclient import NotebookClient

FOLDER = Path(__file__).parents[1] / "docs" / "notebooks"


def main() -> None:
    for path in sorted(FOLDER.glob("*.ipynb")):
        if len(sys.argv) == 1 or path.stem in sys.argv:
            nbformat.write(executed(path), path)


def executed(path: Path) -> nbformat.NotebookNode:
    """The notebook with the outputs of a run just now; nothing of where and when it ran."""
    notebook = nbformat.read(path, as_version=4)
    with TemporaryDirectory() as folder:
        (Path(folder) / "s-arm.step").write_bytes((FOLDER.parent / "tutorial" / "s-arm.step").read_bytes())
        NotebookClient(notebook, timeout=300, resources={"metadata": {"path": folder}}).execute()
    for cell in notebook.cells:
        cell.metadata.pop("execution", None)
        printed = "".join(one.text for one in cell.get("outputs", []) if one.get("name") == "stdout")
        printed = printed.replace(f"{folder}/", "")
        if cell.cell_type == "code":
            cell.outputs = [nbformat.v4.new_output("stream", name="stdout", text=printed)] if printed else []
    notebook.metadata.language_info = {"name": "python"}
    return notebook


if __name__ == "__main__":
    main()
