"""Prepare a checkout for a release: `python docs/_generate/release.py --tag v1.2.3`.

A package index shows the README alone, so its links and pictures become addresses in the repository. Where that is says
`tool.release.repository` in pyproject.toml, from which the project's links are made, too.
"""

from __future__ import annotations

import re
import sys
import tomllib
from pathlib import Path

ROOT = Path(__file__).parents[2]
_LINK = re.compile(
    r"!\[(?P<alt>[^\]]*)\]\((?!https?:)(?P<picture>[^)\s]+)\)|\]\((?!https?:|#|mailto:)(?P<page>[^)\s]+)\)"
)


def absolute(text: str, repository: str, tag: str) -> str:
    """Return Markdown with links to files of the repository at a tag: pictures as they are, others as pages."""

    def address(match: re.Match[str]) -> str:
        if match["picture"]:
            return f"![{match['alt']}]({repository}/raw/{tag}/{match['picture']})"
        return f"]({repository}/blob/{tag}/{match['page']})"

    return _LINK.sub(address, text)


def with_urls(project: str, repository: str) -> str:
    """Return pyproject.toml with the project's links."""
    urls = {
        "Repository": repository,
        "Documentation": f"{repository}/blob/main/docs/index.md",
        "Changelog": f"{repository}/blob/main/CHANGELOG.md",
        "Issues": f"{repository}/issues",
    }
    table = "\n".join(f'{name} = "{url}"' for name, url in urls.items())
    return project.replace(
        "[project.optional-dependencies]", f"[project.urls]\n{table}\n\n[project.optional-dependencies]", 1
    )


def main() -> None:
    """Change README.md and pyproject.toml in place."""
    if len(sys.argv) != 3 or sys.argv[1] != "--tag":
        sys.exit("usage: release.py --tag v1.2.3")
    tag, file = sys.argv[2], ROOT / "pyproject.toml"
    project = file.read_text(encoding="utf-8")
    settings = tomllib.loads(project)
    repository = settings["tool"]["release"]["repository"].rstrip("/")
    if not repository:
        sys.exit("pyproject.toml: fill in tool.release.repository, the address of the repository")
    version = settings["project"]["version"]
    if tag != f"v{version}":
        sys.exit(f"the tag is {tag}, but pyproject.toml has version {version}")
    changelog = (ROOT / "CHANGELOG.md").read_text(encoding="utf-8")
    if f"\n## {version}" not in changelog:
        sys.exit(f"CHANGELOG.md has no section '## {version}'")
    readme = ROOT / "README.md"
    readme.write_text(absolute(readme.read_text(encoding="utf-8"), repository, tag), encoding="utf-8")
    file.write_text(with_urls(project, repository), encoding="utf-8")


if __name__ == "__main__":
    main()
