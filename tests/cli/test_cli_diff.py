"""`rendergraph diff`."""

from __future__ import annotations

import xml.etree.ElementTree as ET
from pathlib import Path
from typing import Any


def test_the_verb(cli: Any, tmp_path: Path) -> None:
    told = cli("diff", "forward", "forward-prepass", "--json").json
    assert told["added"] == ["prepass"]
    assert told["plan"]["b"]["passes"] == told["plan"]["a"]["passes"] + 2
    shown = cli("diff", "forward", "forward-prepass")
    assert shown.code == 0
    assert "+ prepass" in shown.out
    assert cli("diff", "forward", "forward-prepass", "--svg", "d.svg").out == "d.svg\n"
    ET.fromstring((tmp_path / "d.svg").read_text())
    assert cli("diff", "forward", "forwrad").code == 3
