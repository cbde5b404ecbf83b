"""The README is true: its commands and programs run as they stand there."""

from __future__ import annotations

import shlex
import subprocess
import sys
from pathlib import Path

import pytest

README = Path(__file__).resolve().parents[2] / "README.md"
SKIP = "<!-- not run -->"
COMMANDS = (("pbdbench",), ("python", "-m", "comparisons"))
SECONDS = 120


def preceded(text: str) -> list[tuple[str, str, str]]:
    """(line above, language, content) of each fenced block."""
    lines, found, k = text.split("\n"), [], 0
    while k < len(lines):
        if lines[k].startswith("```"):
            end = next(i for i in range(k + 1, len(lines)) if lines[i].startswith("```"))
            found.append((lines[k - 1].strip() if k else "", lines[k][3:].strip(), "\n".join(lines[k + 1 : end])))
            k = end
        k += 1
    return found


def blocks_of(language: str) -> list[str]:
    text = README.read_text(encoding="utf-8")
    return [content for above, name, content in preceded(text) if name == language and above != SKIP]


def commands() -> list[list[str]]:
    """Command lines of bash blocks that are ours, without prompt, comment and continuation."""
    found = []
    for block in blocks_of("bash"):
        for line in block.replace("\\\n", " ").split("\n"):
            words = shlex.split(line.removeprefix("$ "), comments=True)
            if any(tuple(words[: len(start)]) == start for start in COMMANDS):
                found.append(words)
    return found


def test_the_reader_finds_blocks():
    text = "a\n```bash\npbdbench list\n```\n\n<!-- not run -->\n```python\nx\n```\n"
    assert preceded(text) == [("a", "bash", "pbdbench list"), (SKIP, "python", "x")]


def test_there_is_something_to_run():
    assert commands(), "no command in a bash block"
    assert blocks_of("python"), "no python block"


@pytest.mark.parametrize("words", commands(), ids=lambda words: " ".join(words)[:60])
def test_commands_run(words, tmp_path):
    start = next(start for start in COMMANDS if tuple(words[: len(start)]) == start)
    assert not set(words) & {"|", "&&", ";", ">", "&"}, "one plain command a line"
    run(["-m", "comparisons", *words[len(start) :]], tmp_path)


@pytest.mark.parametrize("index", range(len(blocks_of("python"))))
def test_programs_run(index, tmp_path):
    program = tmp_path / "program.py"
    program.write_text(blocks_of("python")[index], encoding="utf-8")
    run([str(program)], tmp_path)


def run(arguments: list[str], place: Path) -> None:
    done = subprocess.run([sys.executable, *arguments], cwd=place, capture_output=True, text=True, timeout=SECONDS)
    assert done.returncode == 0, f"{done.stdout}\n{done.stderr}"
