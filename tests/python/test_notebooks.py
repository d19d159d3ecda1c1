"""The notebooks of examples/notebooks run unchanged, and their links lead to themselves."""

from __future__ import annotations

import json
import os
import re
from pathlib import Path
from urllib.parse import unquote

import pytest
from nightly import nightly_unless

ROOT = Path(__file__).resolve().parents[2]
NOTEBOOKS = sorted((ROOT / "examples/notebooks").glob("*.ipynb"))


def test_there_are_three() -> None:
    assert len(NOTEBOOKS) == 3


@pytest.mark.parametrize(
    "path", nightly_unless(lambda path: path.stem == "first_steps", NOTEBOOKS), ids=lambda path: path.stem
)
def test_a_notebook_runs_unchanged(path: Path, tmp_path: Path) -> None:
    if os.environ.get("FRACGYRO_SKIP_NOTHING") != "1":
        pytest.importorskip("nbclient", reason="nbclient is missing")
        pytest.importorskip("ipykernel", reason="ipykernel is missing")
    import nbformat
    from nbclient import NotebookClient

    notebook = nbformat.read(path, as_version=4)
    nbformat.validate(notebook)
    NotebookClient(notebook, timeout=600, resources={"metadata": {"path": str(tmp_path)}}).execute()
    outputs = [each for cell in notebook.cells if cell.cell_type == "code" for each in cell.outputs]
    assert any("image/png" in each.get("data", {}) for each in outputs)
    assert not any(each.output_type == "error" for each in outputs)


@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_a_notebook_has_no_outputs_and_links_to_itself(path: Path) -> None:
    cells = json.loads(path.read_text(encoding="utf-8"))["cells"]
    assert all(not cell["outputs"] and cell["execution_count"] is None for cell in cells if cell["cell_type"] == "code")
    links = re.findall(r"\]\((https:[^)]*)\)", "".join(cells[0]["source"]))
    readme = (path.parent / "README.md").read_text(encoding="utf-8")
    assert len(links) == 2
    for link in links:
        assert unquote(link).endswith(f"examples/notebooks/{path.name}")
        assert link in readme


def test_the_container_of_editors_is_a_stage_that_is_installed_from_the_wheel() -> None:
    build = json.loads((ROOT / ".devcontainer/devcontainer.json").read_text(encoding="utf-8"))["build"]
    docker = (ROOT / "Dockerfile").read_text(encoding="utf-8")
    stages = dict(re.findall(r"^FROM (\S+) AS (\S+)$", docker, re.MULTILINE))
    assert (ROOT / ".devcontainer" / build["dockerfile"]).resolve() == ROOT / "Dockerfile"
    assert stages["base"] == build["target"]
    assert re.search(r"^FROM base$", docker, re.MULTILINE)
    assert "/wheels/*.whl" in docker.partition("AS base")[2].partition("FROM")[0]
